// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark fit-codec: compresses a model that was not trained for a codec (compmark/app/run/fit_codec.hpp).
#include <memory>

#include "commands.hpp"
#include "training_options.hpp"

namespace tool {

Command add_fit_codec(Options& app) {
  auto options = std::make_shared<FitCodecOptions>();
  bind_options(app, *options);
  return [options, &app]() -> int { return show_command(app, *options, compmark::fit_codec); };
}

}  // namespace tool
