// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The LPIPS networks that a user gave weights of, read once for all views.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/core/views.hpp>
#include <compmark/metric/lpips.hpp>
#include <optional>

#include "evaluation.hpp"

namespace tool {

class LpipsNets {
 public:
  /// Of every file that is named; none is no error.
  static compmark::Result<LpipsNets> open(const LpipsFiles& files);

  struct Distances {
    std::optional<double> alex, squeeze;  ///< empty: no weights were given
  };
  /// Between two images of one size in [0, 1]. Cost: two passes of each network.
  compmark::Result<Distances> between(compmark::ImageView<const float> image,
                                      compmark::ImageView<const float> reference, compmark::ThreadExecutor& executor);

 private:
  std::optional<compmark::Lpips> alex_, squeeze_;
  compmark::LpipsRange range_ = compmark::LpipsRange::signed_unit;
  compmark::Lpips::Context context_;
};

}  // namespace tool
