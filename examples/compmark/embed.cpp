// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark embed: hides a message in a finished model (compmark/app/run/embed.hpp).
#include <memory>

#include "commands.hpp"
#include "training_options.hpp"

namespace tool {

Command add_embed(Options& app) {
  auto options = std::make_shared<EmbedOptions>();
  bind_options(app, *options);
  return [options, &app]() -> int { return show_command(app, *options, compmark::embed_message); };
}

}  // namespace tool
