// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "run_options.hpp"

#include <compmark/app/spread.hpp>
#include <compmark/io/owner_key.hpp>
#include <memory>
#include <string>

#include "decoder_choice.hpp"

namespace tool {

using namespace compmark;

void add_finished_model_options(Options& app, RunSettings& run, RunOptions& options) {
  app.number("--downscale", run.downscale, downscale_range,
             "divide the size of the images by this; use the value of the training")
      ->capture_default_str();
  app.number("--seed", run.seed, any_seed, "seed of every random number (default: 0)");
  app.number("--threads", options.threads, thread_range, "0: all; the result is the same for any number")
      ->capture_default_str();
  app.number("--checkpoint-every", run.checkpoint_every, run_length, "iterations between checkpoints")
      ->capture_default_str();
  app.flag("--resume", run.resume, "continue the run in --out from its checkpoint");
  app.flag("--force", run.force, "replace a finished run in --out");
  app.writes("--json-log", options.json_log, OutputKind::words,
             "write progress to this file, one JSON object a line (default: log.jsonl in --out)");
  app.reads("--lpips-alex", run.lpips.alex, InputKind::weights, "LPIPS weights (safetensors) to report lpips_alex");
}

void add_splat_up(Options& app, std::optional<std::array<double, 3>>& up, const std::string& otherwise) {
  const auto word = std::make_shared<std::string>();
  app.word("--up", *word,
           "which way is up in a splat file: x, y, z, -x, -y or -z (write --up=-z); of captures it is -y, of Blender z "
           "(default: what the file says, or " +
               otherwise + ")")
      ->check(CLI::IsMember({"x", "y", "z", "-x", "-y", "-z"}))
      ->each([&up, word](const std::string& name) {
        up = std::array<double, 3>{0, 0, 0};
        (*up)[static_cast<std::size_t>(name.back() - 'x')] = name.size() == 2 ? -1 : 1;
      });
}

void add_recipient(Options& app, std::size_t& recipient) {
  app.number("--recipient", recipient, WholeRange{0, OwnerKey::recipients_limit},
             "whose copy it is, for a key that was made with keygen --recipients (1 to their number)");
}

void add_mark_options(Options& app, MarkSettings& options, bool required) {
  CLI::Option* key =
      app.reads("--key", options.key, InputKind::key, "the owner's key (compmark keygen), whose message is hidden");
  add_recipient(app, options.recipient);
  app.reads_or(fitted_decoder_word, "--decoder", options.decoder, InputKind::decoder,
               "the message decoder: a file, or the word fit: one is fitted to the scene, as compmark fit does, and "
               "written to --out; its marks are the least visible ones, and most edits of a picture remove them "
               "(default: the decoder that comes with the program, for every scene)");
  app.number("--period", options.period, RealRange{0.01, 2},
             "period of the Fourier features of a fitted decoder, in colours from 0 to 1; a long "
             "period gives more even bits in all views and a more visible mark");
  app.number("--tone", options.tone, RealRange{0, 0.5},
             "standard deviation of exposure and white balance that a fitted decoder ignores, as "
             "gains of the channels");
  if (required) {
    key->required();
  }
  app.number("--bits", options.bits, WholeRange{0, OwnerKey::bits_limit}, "length of the message (default: the key's)");
  app.reads("--unmarked", options.unmarked, InputKind::model,
            "the unmarked counterpart, to measure the cost of the mark (default of embed: the "
            "unmarked model, or its compressed file)");
  app.number("--message-weight", options.weight, RealRange{0, 1e9, true},
             "weight of the message in the loss (default: the profile's)");
  app.number("--message-margin", options.margin, RealRange{0, 1e9, true},
             "margin of the hinge: a bit whose logit is right by this costs nothing (default: the "
             "profile's)");
  app.number("--message-power", options.power, RealRange{1, 4},
             "power of the hinge; 1: all bits within the margin are pulled equally; 2: bits with "
             "larger errors are pulled harder (default: 2 for post-hoc embedding with the "
             "decoder of the program or one that is fitted to the scene, else 1)");
  app.number("--message-rate", options.rate, RealRange{0, 1e3, true},
             "learning rate of the mark; a smaller rate gives a less visible mark and takes longer"
             " (default: 0.01 with the decoder of the program, 0.006 with one that is fitted to the "
             "scene; docs/watermark.md has the others)");
  app.number("--step-rate", options.step_rate, RealRange{0, 1e3},
             "weight that holds the step of the published distortion layer, which then stays as large as the picture "
             "allows; 0: none, as published, and the step falls to nothing (default: the profile's)");
  app.number(
      "--fidelity", options.fidelity, RealRange{0, 1e6},
      "weight of the distortion, the mean square difference between marked and unmarked "
      "renders; 0: the message joins the loss of the photographs, as published (default: "
      "1200 with the decoder of the program, 1600 where it does not look at photographs; docs/watermark.md has the "
      "others)");
  app.number("--fidelity-fall", options.fall, RealRange{0, 4},
             "exponent by which --fidelity falls with the distance of a view from the nearest "
             "photograph, where the scene has larger errors of its own; 0: no fall (default: 2)");
  app.number("--sample-by-loss", options.by_cost, share_range,
             "share of the sampled novel views that go where the message loss was high lately, so "
             "that hard views are seen more often; 0: none (default: 1 with the decoder of the program, "
             "else 0)");
  app.number("--orbit", options.orbit, share_range,
             "share of the sampled views that orbit a training view, in every direction; the others lie between "
             "neighbours (default: 0.5 with the decoder of the program, else 0)");
  app.number(
      "--photographs", options.photographs, share_range,
      "share of the iterations that look at a photograph in place of the unmarked render, so that the mark makes up "
      "for a part of what it costs (default: 0.5 with the decoder of the program, where the photographs have no "
      "exposures of their own, else 0)");
  app.number("--edits", options.edits, share_range,
             "share of the readings before which the render is edited, as pictures are on their way (resized, turned, "
             "cropped, other colours, softer, noisy, JPEG), so that the mark is learned to survive it (default: 0.7 "
             "with the decoder of the program, else 0)");
  app.number("--lost-anchors", options.lost_anchors, RealRange{0, 0.9},
             "largest share of the anchors that is left out of a reading, in one reading of three, so that the mark is "
             "learned to survive pruning (default: 0)");
  app.number("--spread", options.spread, RealRange{least_spread_psnr, largest_spread_psnr},
             "decibels of a spread mark of the same key that is hidden first, for readers who have the unmarked model; "
             "50 is proven by one picture (default: none)");
  app.number("--calibrate-steps", options.calibrate_steps, any_count,
             "iterations between step-bias calibrations of a context_gs model, without which a "
             "mark makes the file grow; 0: none (default: 50)");
  app.number("--message-every", options.message_every, run_length,
             "iterations between two readings of the message in training")
      ->capture_default_str();
  app.flag("--for-compression", options.for_compression,
           "add the noise of quantization in training, so that the message survives a codec");
}

void add_run_files(FileUse& use, const RunFiles& run, const std::filesystem::path& out) {
  use.write_in(out, {"model.safetensors", "model.cmk", "checkpoint.safetensors", "results.json", "report.html"},
               "--out");
  if (run.json_log.empty() || out != run.out) use.write(out / "log.jsonl", "--out");
  if (run.marks && out == run.out) use.write_in(out, {"verification.json", "mark.json"}, "--out");
  if (run.model.empty()) return;
  const std::filesystem::path source = run.model.parent_path();  // its page's curves are shown again
  for (const char* name : {"results.json", "log.jsonl"}) use.read(source / name, "--model (the run that it is of)");
}

}  // namespace tool
