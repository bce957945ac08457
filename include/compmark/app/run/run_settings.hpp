// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Settings that the runs of app share: train_scene, embed_message and fit_codec. A run works in a folder of its own,
// writes checkpoints there, and can be resumed from them to the same bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "compmark/app/lpips_nets.hpp"

namespace compmark {

/// Of any run. Errors name these fields as the tool's options do ("--out").
struct RunSettings {
  std::filesystem::path data;                     ///< a dataset, as open_dataset reads it
  std::filesystem::path out;                      ///< folder of the run; no other run may be at work there
  std::optional<std::array<double, 3>> splat_up;  ///< of splats that are the data (DatasetSettings::splat_up)
  double downscale = 1;                           ///< the size of the photographs is divided by this
  std::optional<std::uint64_t> seed;              ///< of every random number; not set: the profile's
  std::int64_t checkpoint_every = 1000;           ///< iterations, at least 1; the last one has a checkpoint anyway
  std::size_t memory_budget_mb = 0;               ///< MiB of memory for decoded photographs; 0: chosen by the library
  bool resume = false;                            ///< continue from the checkpoint in `out`
  bool force = false;                             ///< replace a finished run in `out`
  LpipsFiles lpips;                               ///< to report it; may be empty
};

/// What is hidden, and the numbers of the mark; those that are not set are the function's own.
struct MarkSettings {
  std::size_t bits = 0;           ///< length of the message, checked against the key's; 0: the key's
  std::filesystem::path key;      ///< the owner's, whose message is hidden
  std::size_t recipient = 0;      ///< whose copy it will be, 1 to the recipients of the key; 0: a key without
  std::filesystem::path decoder;  ///< empty: one is fitted to the scene where the mark is hidden in a finished model
  /// A decoder for every scene that is taken where `decoder` is empty; its mark is hidden in a finished model too.
  std::filesystem::path universal;
  std::filesystem::path unmarked;      ///< unmarked model to compare with; may be empty
  std::optional<double> period, tone;  ///< of a decoder that is fitted on the way (DecoderFitSettings)
  std::optional<double> weight;        ///< of the message
  std::optional<double> margin;        ///< of the hinge, in logits
  std::optional<double> power;         ///< of the hinge
  std::optional<double> rate;          ///< at which the mark is learned
  std::optional<double> step_rate;     ///< of the distortion layer (DistortionSettings::rate_weight)
  std::optional<double> fidelity;      ///< of the marked renders to the unmarked ones
  std::optional<double> fall;          ///< power by which the fidelity falls with the distance from the photographs
  std::optional<double> by_cost;       ///< share of the draw of cameras that follows what the message costs there
  std::optional<double> orbit;         ///< share of the sampled views that orbit a training view
  std::optional<double> photographs;   ///< share of the readings that are held to a photograph
  std::optional<double> edits;         ///< share of the readings before which the render is edited (CommonEdits)
  std::optional<double> lost_anchors;  ///< largest share of the anchors that is left out of a reading
  /// PSNR of a spread mark of the same key (app/spread.hpp) that is hidden in a finished model before the message, dB.
  std::optional<double> spread;
  std::optional<std::int64_t> calibrate_steps;  ///< cadence of PosthocSettings::calibrate_steps_every
  std::int64_t message_every = 1;               ///< cadence
  bool for_compression = false;                 ///< with the noise of quantization
  /// Whether any of them was given. A key without a decoder, or a decoder without a key, is an error and not an
  /// unmarked model.
  [[nodiscard]] bool wanted() const {
    return bits != 0 || !key.empty() || recipient != 0 || !decoder.empty() || !unmarked.empty() || period || tone ||
           weight || margin || power || rate || step_rate || fidelity || fall || by_cost || orbit || photographs ||
           edits || lost_anchors || spread || calibrate_steps || message_every != 1 || for_compression;
  }
};

}  // namespace compmark
