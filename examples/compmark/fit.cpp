// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark fit: makes a message decoder for one scene from its unmarked model and its cameras, and a JSON of the fit
// (compmark/app/run/fit_decoder.hpp). No message is hidden yet: embed does that.
#include <compmark/app/run/fit_decoder.hpp>
#include <cstdio>
#include <memory>

#include "commands.hpp"
#include "common.hpp"
#include "run_options.hpp"
#include "run_telling.hpp"

namespace tool {
namespace {

struct FitOptions {
  compmark::DecoderFileSettings settings;
  std::size_t threads = 0;
};

int fit(const FitOptions& options) {
  compmark::ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  RunTelling telling({}, {}, false);
  const auto fitted = compmark::fit_decoder_file(options.settings, executor, telling);
  if (!fitted) return fail(fitted.error());
  std::printf("decoder %s\nsha256 %s\n", options.settings.out.string().c_str(), fitted->sha256.c_str());
  std::printf(
      "agreement between views %.3f (of a single feature %.3f), noise %.2g of a feature's, "
      "%.1f s\n",
      fitted->agreement, fitted->feature_agreement, fitted->noise_ratio, fitted->seconds);
  return success;
}

}  // namespace

Command add_fit(Options& app) {
  auto options = std::make_shared<FitOptions>();
  app.reads("--model", options->settings.model, InputKind::model,
            "the unmarked model (model.safetensors of a training or of fit-codec)")
      ->required();
  app.reads("--data", options->settings.data, InputKind::dataset,
            "the dataset it was trained on, or the splat file itself; only its cameras are used")
      ->required();
  app.writes("--out", options->settings.out, OutputKind::decoder,
             "decoder file to write (safetensors); keep it with the key")
      ->required();
  app.number("--bits", options->settings.fit.bits, WholeRange{1, 128}, "length of the message")->capture_default_str();
  app.number("--features", options->settings.fit.features, WholeRange{1, 1024},
             "number of Fourier features of the decoder (default: 20 for every 3 bits)");
  app.number("--period", options->settings.fit.period, RealRange{0.01, 2},
             "period of the Fourier features, in colours from 0 to 1; each has half to twice this."
             " A long period gives more even bits in all views and a more visible mark")
      ->capture_default_str();
  app.number("--views", options->settings.fit.statistics_views, WholeRange{1, 20000},
             "sampled novel views from which the cover interference is learned (default: 8 for "
             "each feature); memory is 32 bytes times their square");
  app.number("--coordinates", options->settings.fit.coordinates, WholeRange{0, 1024},
             "dimension of the nuisance subspace, from which the cover interference is predicted; "
             "0: no prediction (default: two fifths of the features)");
  app.number("--stride", options->settings.fit.stride, WholeRange{1, 64},
             "distance in pixels between the positions that are read (default: as many positions "
             "as 500 x 500 pixels have)");
  app.number("--gradient-views", options->settings.fit.gradient_views, WholeRange{2, 1000},
             "sampled novel views in which the effect of a mark on the features is measured")
      ->capture_default_str();
  app.number("--edit-weight", options->settings.fit.edit_weight, share_range,
             "weight of edited renders (JPEG, noise, resize, crop, brightness, blur) beside clean "
             "ones; more weight: the mark survives more edits; 0: it is the least visible")
      ->capture_default_str();
  app.number("--tone", options->settings.fit.tone, RealRange{0, 0.5},
             "standard deviation of exposure and white balance in the sampled views, as gains of "
             "the channels; the decoder ignores changes of this size; 0: only the model's own "
             "light")
      ->capture_default_str();
  app.number("--region-limit", options->settings.fit.region_limit, RealRange{0, 100},
             "limit for the logits of one region of an image (about 24 regions), in medians over "
             "sampled views of the loudest region; a louder region gets a smaller weight; 0: no "
             "limit")
      ->capture_default_str();
  app.number("--downscale", options->settings.downscale, downscale_range,
             "divide the size of the images by this; use the value of the training")
      ->capture_default_str();
  add_splat_up(app, options->settings.splat_up);
  app.number("--seed", options->settings.fit.seed, any_seed, "seed of features, views and rotation")
      ->capture_default_str();
  app.number("--threads", options->threads, thread_range, "0: all; the result is the same for any number")
      ->capture_default_str();
  app.flag("--force", options->settings.force,
           "if --out is there already, move that to OUT.<beginning of its SHA-256>.old");
  app.writes("--json", options->settings.json, OutputKind::words,
             "write figures of the fit to this file (default: --out with the ending .json)");
  app.also([options](FileUse& use) {
    if (options->settings.json.empty())
      use.write(std::filesystem::path(options->settings.out).replace_extension(".json"), "--json", OutputKind::words);
  });
  return [options]() -> int { return fit(*options); };
}

}  // namespace tool
