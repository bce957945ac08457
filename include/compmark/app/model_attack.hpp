// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on a model that need more than its numbers: renders (LightGaussian's significance), other copies of it
// (averaging, collusion), or a scene to put a part into. watermark/attack has the others; docs/robustness.md says what
// each is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compiled.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/watermark/attack/attack_list.hpp"

namespace compmark {

struct EvidenceSettings {
  double volume_power = 0.1;  ///< LightGaussian's beta
  std::size_t views = 0;      ///< of those that count, evenly spaced; 0: all
};

/// What renders of the cameras that a model stores say of each anchor: those of its training, and all of them where it
/// stores none of these, as compressed files and splat files do. Significance is LightGaussian's
/// sum over views and pixels of alpha * transmittance, times min(volume / the 90th percentile, 1)^beta, of the
/// Gaussians of an anchor together; its volume is the mean over the views that draw it. Cost: a forward and a backward
/// pass a view. Error: a model that stores no camera.
[[nodiscard]] Result<AnchorEvidence> anchor_evidence(AnyModel& model, ThreadExecutor& executor,
                                                     const EvidenceSettings& settings = {});

/// Does to a model what `text` names, an attack of ModelAttacks, with the evidence that it asks for. Errors are those
/// of attack_model and of anchor_evidence, with the model's file.
[[nodiscard]] Result<Done> attack_any_model(AnyModel& model, std::string_view text, std::uint64_t seed,
                                            ThreadExecutor& executor);

/// Every number of `model` becomes the mean of it and of `copies`: collusion of those who got them. Error: a copy of
/// another recipe, of other tensors, or whose anchors are not the same ones, row by row (a hundredth of their extent
/// apart, or more). The model then stays as it is.
[[nodiscard]] Result<Done> average_models(AnyModel& model, const std::vector<std::filesystem::path>& copies,
                                          ThreadExecutor& executor);

/// Puts the anchors of `part` into `scene`, at their places. Error: one model given as both, another recipe, unit or
/// origin, or networks that are not the same to the bit: the anchors of one then mean nothing to those of the other.
[[nodiscard]] Result<Done> insert_model(AnyModel& scene, AnyModel& part);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/model_attack.hpp"
#endif
