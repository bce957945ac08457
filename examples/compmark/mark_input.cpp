// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "mark_input.hpp"

#include <compmark/app/files.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/version.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <string>
#include <utility>

#include "evaluation.hpp"
#include "mark_record.hpp"

namespace tool {

using namespace compmark;

void add_mark_options(Options& app, MarkOptions& options, bool required) {
  CLI::Option* key =
      app.reads("--key", options.key, InputKind::key, "the owner's key (compmark keygen), whose message is hidden");
  app.reads("--decoder", options.decoder, InputKind::decoder,
            "the message decoder (default: one is fitted to the scene, as compmark fit does, and "
            "written to --out)");
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
  app.reads("--twin", options.twin, InputKind::model,
            "the unmarked counterpart, to measure the cost of the mark (default of embed: the "
            "unmarked model, or its compressed file)");
  app.number("--message-weight", options.weight, RealRange{0, 1e9, true},
             "weight of the message in the loss (default: the profile's)");
  app.number("--message-margin", options.margin, RealRange{0, 1e9, true},
             "margin of the hinge: a bit whose logit is right by this costs nothing (default: the "
             "profile's)");
  app.number("--message-power", options.power, RealRange{1, 4},
             "power of the hinge; 1: all bits within the margin are pulled equally; 2: bits with "
             "larger errors are pulled harder (default: 2 for post-hoc embedding with a decoder "
             "that is fitted to the scene, else 1)");
  app.number("--message-rate", options.rate, RealRange{0, 1e3, true},
             "learning rate of the mark; a smaller rate gives a less visible mark and takes longer"
             " (default: 0.006 for post-hoc embedding with a decoder that is fitted to the scene; "
             "docs/watermark.md has the others)");
  app.number("--fidelity", options.fidelity, RealRange{0, 1e6},
             "weight of the distortion, the mean square difference between marked and unmarked "
             "renders; 0: the message joins the loss of the photographs, as published (default: "
             "3000 of embed, 2000 for a codec; docs/watermark.md has the others)");
  app.number("--fidelity-fall", options.fall, RealRange{0, 4},
             "exponent by which --fidelity falls with the distance of a view from the nearest "
             "photograph, where the scene has larger errors of its own; 0: no fall (default: 2)");
  app.number("--draw-by-cost", options.by_cost, share_range,
             "share of the sampled novel views that go where the message loss was high lately, so "
             "that hard views are seen more often; 0: none (default: 0)");
  app.number("--hold-steps", options.hold_steps, any_count,
             "iterations between step-bias calibrations of a context_gs model, without which a "
             "mark makes the file grow; 0: none (default: 50)");
  app.number("--message-every", options.message_every, run_length,
             "iterations between two readings of the message in training")
      ->capture_default_str();
  app.flag("--for-compression", options.for_compression,
           "add the noise of quantization in training, so that the message survives a codec");
}

bool fitted_decoder(const std::filesystem::path& path) {
  const Result<SafetensorsFile> file = read_safetensors(path, FileKind::decoder);
  return file && file->metadata.contains("centres");
}

Result<OwnerKey> key_of(const MarkOptions& options) {
  Result<OwnerKey> key = load_key(options.key);
  if (key && options.bits != 0 && options.bits != key->bits) {
    return Error{ErrorKind::invalid, options.key.string(), "bits",
                 "is " + std::to_string(key->bits) + ", and --bits is " + std::to_string(options.bits),
                 "leave out --bits, or make a key of that length with compmark keygen"};
  }
  return key;
}

Result<Done> check_to_fit(const MarkOptions& options) {
  for (const auto& [number, name] : {std::pair(options.period, "--period"), std::pair(options.tone, "--tone")}) {
    if (!number) continue;
    if (options.decoder.empty()) continue;
    return Error{ErrorKind::unsupported,
                 {},
                 name,
                 "belongs to a decoder that this command fits, but --decoder names a finished one",
                 "leave out one of the two options, or fit the decoder with compmark fit first"};
  }
  return Done{};
}

Result<Done> check_held(const MarkOptions& options, double fidelity) {
  for (const auto& [number, name] :
       {std::pair(options.fall, "--fidelity-fall"), std::pair(options.by_cost, "--draw-by-cost")}) {
    if (!number) continue;
    if (fidelity > 0) continue;
    return Error{ErrorKind::unsupported,
                 {},
                 name,
                 "needs post-hoc embedding, but --fidelity is 0 here",
                 "give --fidelity above 0, or leave this option out"};
  }
  return Done{};
}

Result<MarkInput> load_mark(const MarkOptions& options, TrainSettings& settings) {
  const auto missing = [](const char* option, const char* remedy) {
    return Error{ErrorKind::invalid, {}, option, "is missing", remedy};
  };
  if (options.key.empty()) return missing("--key", "make one with compmark keygen");
  if (options.decoder.empty())
    return missing("--decoder",
                   "give a decoder of compmark fit or of weights/; only embed, and train without --twin "
                   "and --for-compression, can fit one");
  const Result<OwnerKey> key = key_of(options);
  if (!key) return key.error();
  Result<Decoder> decoder = open_decoder(options.decoder, &*key);
  if (!decoder) return decoder.error();
  MarkInput input;
  if (!options.twin.empty()) {  // better now than after the training
    const auto twin = load_model(options.twin);
    if (!twin) return twin.error();
    input.twin_unit = twin->info().unit;
    input.twin_origin = twin->info().origin;
  }
  input.message = message_of(*key);
  for (std::size_t i = 0; i < input.message.size(); ++i) input.bits.push_back(input.message[i] ? 1 : 0);
  const Result<std::string> digest = file_sha256(options.decoder);
  if (!digest) return digest.error();
  const Result<SafetensorsFile> tensors = read_safetensors(options.decoder);
  if (!tensors) return tensors.error();
  input.decoder_tensors = tensors_sha256(*tensors);
  input.key = *key;
  input.key_file = options.key;
  input.sources.program = std::string("compmark ") + version;
  input.sources.key_id = key->id();
  input.sources.key_commitment = key->commitment();
  input.sources.key_created = key->created;
  input.sources.decoder = options.decoder.filename().string();
  input.sources.decoder_sha256 = *digest;
  input.twin = options.twin;
  input.for_compression = options.for_compression;

  MarkNumbers& mark = settings.mark;
  if (options.fidelity && (*options.fidelity > 0) != (mark.posthoc.fidelity > 0)) {
    mark = *options.fidelity > 0 ? posthoc_mark() : mark_in_the_photographs();
  }
  if (mark.posthoc.fidelity > 0 && fitted_decoder(options.decoder)) mark.message.hinge_power = 2;
  mark.message.logit_scale = decoder->logit_scale();
  if (options.weight) mark.message.lambda = *options.weight;
  if (options.margin) mark.message.hinge_margin = *options.margin * mark.message.logit_scale;
  if (options.power && mark.message.hinge_margin <= 0) {
    return Error{ErrorKind::unsupported,
                 {},
                 "--message-power",
                 "belongs to a hinge loss, but this profile uses cross entropy",
                 "give --message-margin too, or leave this option out"};
  }
  if (options.power) mark.message.hinge_power = *options.power;
  if (options.rate) mark.residual.learning_rate = *options.rate;
  if (options.fidelity) mark.posthoc.fidelity = *options.fidelity;
  if (Result<Done> held = check_held(options, mark.posthoc.fidelity); !held) return held.error();
  if (options.by_cost) mark.posthoc.draw_by_cost = *options.by_cost;
  if (options.hold_steps) mark.posthoc.hold_steps_every = *options.hold_steps;
  if (options.fall) mark.posthoc.fidelity_fall = *options.fall;
  mark.message.every = options.message_every;
  if (mark.message.between_every != 0) mark.message.between_every = options.message_every;
  // A run is resumed with the same key, decoder and stages alone. The commitment says nothing of the message.
  mark.identity = key->commitment().substr(0, 16) + digest->substr(0, 16) + (options.for_compression ? "c" : "");
  input.decoder = std::move(*decoder);
  return input;
}

Result<MarkMeasurement> measure_mark(AnyModel& model, const MarkInput& mark, DatasetViews views,
                                     ThreadExecutor& executor) {
  std::optional<AnyModel> twin;
  if (!mark.twin.empty()) {
    Result<AnyModel> loaded = load_model(mark.twin);
    if (!loaded) return loaded.error();
    twin = std::move(*loaded);
  }
  MarkMeasurement found;
  Decoder::Context context;
  double between = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Camera<double> camera = views.camera(i);
    const Result<RenderedView> render = model.render(camera, views.lens(i), executor);
    if (!render) return render.error();
    round_to_8bit<float>(render->image, render->image);
    Result<ViewLogits> read = read_logits(mark.decoder, ImageView<const float>(render->image),
                                          views.dataset->views[views.index[i]].name, context, executor);
    if (!read) return read.error();
    read->sha256 = pixels_sha256(render->image);
    found.report.views.push_back(std::move(*read));
    if (twin) {
      const Result<RenderedView> unmarked = twin->render(camera, views.lens(i), executor);
      if (!unmarked) return unmarked.error();
      round_to_8bit<float>(unmarked->image, unmarked->image);
      between += psnr(ImageView<const float>(render->image), ImageView<const float>(unmarked->image));
    }
  }
  Result<Verification> verification = verify_message(mark.message, found.report.views, VerifySettings{});
  if (!verification) return verification.error();
  found.report.verification = std::move(*verification);
  found.report.sources = mark.sources;
  if (twin) {
    found.psnr_marked_vs_unmarked = between / static_cast<double>(views.size());
    const Result<Evaluation> evaluation = evaluate_views(*twin, views, evaluation_settings(), executor);
    if (!evaluation) return evaluation.error();
    found.unmarked_psnr = evaluation->mean([](const ViewResult& view) { return view.psnr; });
  }
  return found;
}

WatermarkMetrics watermark_metrics(const Verification& verification) {
  const BitAccuracy accuracy = bit_accuracy(verification);
  WatermarkMetrics metrics;
  metrics.mean = accuracy.mean;
  metrics.min = accuracy.min;
  metrics.views = static_cast<int>(accuracy.views);
  metrics.p_value = verification.evidence.p_value;
  metrics.largest_view_p_value = accuracy.largest_p;
  return metrics;
}

}  // namespace tool
