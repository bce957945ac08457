// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark fit: an unmarked model and the cameras it was trained on in; a message decoder for this scene out (pipeline/decoder_fit.hpp), and a JSON of
// what it found. The decoder reads no message yet: embed hides one for it.
#include "fit_run.hpp"

#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "common.hpp"

namespace tool {
namespace {

int run(const FitOptions& options) {
  const compmark::Result<FittedFile> fit = fit_to_file(options);
  if (!fit) return fail(fit.error());
  std::printf("decoder %s\nsha256 %s\n", options.out.string().c_str(), fit->sha256.c_str());
  std::printf("agreement between views %.3f (a wave alone %.3f), noise %.2g of a wave's, %.1f s\n", fit->agreement,
              fit->wave_agreement, fit->noise_ratio, fit->seconds);
  return success;
}

}  // namespace

Command add_fit(Options& app) {
  auto options = std::make_shared<FitOptions>();
  app.reads("--model", options->model, InputKind::model,
            "the unmarked model (model.safetensors of a training or of fit-codec)")
      ->required();
  app.reads("--data", options->data, InputKind::dataset, "the dataset it was trained on; its cameras alone are used")
      ->required();
  app.writes("--out", options->out, OutputKind::decoder, "decoder file to write (safetensors); keep it with the key")
      ->required();
  app.number("--bits", options->fit.bits, WholeRange{1, 128}, "length of the message")->capture_default_str();
  app.number("--waves", options->fit.waves, WholeRange{1, 1024}, "to choose from (default: 20 for 3 bits)");
  app.number("--period", options->fit.period, RealRange{0.01, 2},
             "of the waves, where colours go from 0 to 1, half to twice this: longer ones are heard more evenly and "
             "cost more")
      ->capture_default_str();
  app.number("--views", options->fit.statistics_views, WholeRange{1, 20000},
             "drawn views that say what the scene says (default: eight a wave); 32 bytes times their square are taken");
  app.number("--coordinates", options->fit.coordinates, WholeRange{0, 1024},
             "loud directions of the waves that tell the view, and so what the scene says in the others; 0: none "
             "(default: two of five waves)");
  app.number("--stride", options->fit.stride, WholeRange{1, 64},
             "pixels between the positions that are read (default: as many positions as 500 x 500 pixels have)");
  app.number("--gradient-views", options->fit.gradient_views, WholeRange{2, 1000},
             "drawn views that say what a mark can move")
      ->capture_default_str();
  app.number("--edit-weight", options->fit.edit_weight, share_range,
             "of edited readings (JPEG, noise, resize, crop, brightness, blur) beside those of clean renders: more "
             "outlives more of them, 0 is the least visible")
      ->capture_default_str();
  app.number("--tone", options->fit.tone, RealRange{0, 0.5},
             "deviation of exposure and white balance, as gains of the channels, in the views that say what the "
             "scene says: what shifts by so much is not taken for a message; 0: the model's own light alone")
      ->capture_default_str();
  app.number(
         "--region-limit", options->fit.region_limit, RealRange{0, 100},
         "parts of an image, about 24, that say more than this many medians of what the loudest part of a drawn view "
         "says count less; 0: no limit")
      ->capture_default_str();
  app.number("--downscale", options->downscale, downscale_range, "divide the images' size by this; as in the training")
      ->capture_default_str();
  app.number("--seed", options->fit.seed, any_seed, "seed of waves, views and rotation")->capture_default_str();
  app.number("--threads", options->threads, thread_range, "0: all; the result is the same for any number")
      ->capture_default_str();
  app.flag("--force", options->force, "if --out is there already, move that to OUT.<beginning of its SHA-256>.old");
  app.writes("--json", options->json, OutputKind::words, "what was found (default: --out with the ending .json)");
  app.also([options](FileUse& use) {
    if (options->json.empty())
      use.write(std::filesystem::path(options->out).replace_extension(".json"), "--json", OutputKind::words);
  });
  return [options]() -> int { return run(*options); };
}

}  // namespace tool
