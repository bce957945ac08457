// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark train: trains a model on a dataset and writes it with its measurements and a page; with a key it hides a
// message too (compmark/app/run/train.hpp). Ctrl-C writes a checkpoint; --resume continues from it to the same bits as an
// uninterrupted run.
#include <memory>

#include "commands.hpp"
#include "training_options.hpp"

namespace tool {

Command add_train(Options& app) {
  auto options = std::make_shared<TrainOptions>();
  bind_options(app, *options);
  return [options, &app]() -> int { return show_command(app, *options, compmark::train_scene); };
}

}  // namespace tool
