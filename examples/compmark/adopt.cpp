// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark adopt: makes a model of ours from the splats of another program, without photographs
// (compmark/app/splat_capture.hpp), to be marked and compressed as any other. Its test PSNR is the distance to the
// splats from cameras that it was not trained with.
#include <compmark/io/splat/read_splat.hpp>
#include <memory>

#include "commands.hpp"
#include "training_options.hpp"

namespace tool {

Command add_adopt(Options& app) {
  auto options = std::make_shared<TrainOptions>();
  bind_adopt_options(app, *options);
  return [options, &app]() -> int {
    using namespace compmark;
    const std::filesystem::path& splat = options->settings.data;
    if (!is_splat_file(splat))
      return fail({ErrorKind::invalid, splat.string(), "--splat", "is no splat file",
                   "train a model from photographs with compmark train"});
    return show_command(app, *options, train_scene);
  };
}

}  // namespace tool
