// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The LPIPS networks that a user gave weights of, read once for all views.
#pragma once

#include <filesystem>
#include <optional>

#include "compmark/app/compiled.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/metric/lpips.hpp"

namespace compmark {

/// Weight files of LPIPS; empty: not measured.
struct LpipsFiles {
  std::filesystem::path alex;
  std::filesystem::path squeeze;
  bool family_range = false;  ///< feed [0, 1] as the 3DGS family does, instead of the [-1, 1] that LPIPS defines
};

class LpipsNets {
 public:
  /// Of every file that is named; none is no error.
  [[nodiscard]] static Result<LpipsNets> open(const LpipsFiles& files);

  struct Distances {
    std::optional<double> alex, squeeze;  ///< empty: no weights were given
  };
  /// Between two images of one size in [0, 1]. Cost: two passes of each network.
  [[nodiscard]] Result<Distances> between(ImageView<const float> image, ImageView<const float> reference,
                                          ThreadExecutor& executor);

 private:
  std::optional<Lpips> alex_, squeeze_;
  LpipsRange range_ = LpipsRange::signed_unit;
  Lpips::Context context_;
};

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/lpips_nets.hpp"
#endif
