// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark pretrain: trains a message decoder on photographs or on procedural images, and writes it with a JSON of its
// measurements. Ctrl-C writes a checkpoint; --resume continues from it to the same bits as an uninterrupted run. How
// and why: docs/decoder_training.md.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <compmark/app/files.hpp>
#include <compmark/app/run/differences.hpp>
#include <compmark/app/run/jpeg_codec.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/splat/optim/adam.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <compmark/watermark/pretrain/decoder_measure.hpp>
#include <compmark/watermark/pretrain/lattice_network.hpp>
#include <compmark/watermark/pretrain/trainer.hpp>
#include <compmark/watermark/pretrain/training_file.hpp>
#include <compmark/watermark/proof/message.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include <unistd.h>

#include "commands.hpp"
#include "common.hpp"
#include "pretrain_images.hpp"
#include "progress.hpp"
#include "run_folder.hpp"

namespace tool {
namespace {

using namespace compmark;
using Clock = std::chrono::steady_clock;
using Network = LatticeNetwork<float>;
using Lattice = LatticeDecoder<float>;

struct PretrainOptions {
  std::filesystem::path images, out, json;
  std::string held_out = "0.2";
  int bits = 48;
  std::string fourier = "contrast";
  int features = 0;  ///< 0: 256 of contrast, or one a bit of colour
  std::int64_t steps = 12000;
  std::uint64_t seed = 1;
  std::size_t threads = 0;
  std::size_t memory_budget_mb = 1400;  ///< of one photograph
  std::int64_t checkpoint_every = 1000;
  int crop = 224;
  int measured = 32;
  int measure_steps = 200;
  bool resume = false;
  bool force = false;
};

AugmentationSettings distortions() {
  AugmentationSettings settings;
  settings.weight = {1, 2, 3, 1, 1, 2, 1, 1.5};  // crops and resizes are what needs learning most
  settings.noise_deviation = {0.01, 0.12};
  return settings;
}

PretrainSettings training_settings(const PretrainOptions& options) {
  PretrainSettings settings;
  settings.steps = options.steps;
  settings.batch = 6;
  settings.side = options.crop;
  settings.life = 40;
  settings.first_psnr = 34;
  settings.psnr = 38;
  settings.augmentation = distortions();
  settings.seed = options.seed;
  return settings;
}

/// A bar on a terminal, a line every ten seconds elsewhere.
class Lines {
 public:
  explicit Lines(std::int64_t from) : from_(from) {}
  void show(std::int64_t iteration, std::int64_t total, const PretrainReport& report) {
    loss_ += report.loss;
    ++count_;
    for (std::size_t kind = 0; kind < augmentation_count; ++kind) {
      right_ += report.correct[kind];
      read_ += report.read[kind];
    }
    const double since = seconds(last_);
    if (iteration != total && since < (terminal_ ? 0.2 : 10)) return;
    last_ = Clock::now();
    const double rate = static_cast<double>(iteration - from_) / std::max(1e-6, seconds(start_));
    std::fprintf(stderr, "%spretrain %lld/%lld  %.1f it/s  ETA %s  loss %.4f  bits %.1f %%  at %.1f dB%s",
                 terminal_ ? "\r" : "", static_cast<long long>(iteration), static_cast<long long>(total), rate,
                 format_duration(static_cast<double>(total - iteration) / rate).c_str(), loss_ / count_,
                 read_ > 0 ? 100 * right_ / read_ : 0.0, report.psnr, terminal_ ? "\x1b[K" : "\n");
    loss_ = count_ = right_ = read_ = 0;
  }
  void finish() const {
    if (terminal_) std::fputc('\n', stderr);
  }
  [[nodiscard]] double seconds() const { return seconds(start_); }

 private:
  [[nodiscard]] static double seconds(Clock::time_point since) {
    return std::chrono::duration<double>(Clock::now() - since).count();
  }
  bool terminal_ = isatty(STDERR_FILENO) == 1;
  std::int64_t from_;
  Clock::time_point start_ = Clock::now(), last_ = start_;
  double loss_ = 0, count_ = 0, right_ = 0, read_ = 0;
};

/// Square `again` of `count` images, spread over all there are, in turn; what `read` makes of each is appended to the
/// result.
template <class Read>
std::vector<double> over_squares(const PretrainImages& images, std::size_t count, int side, const Read& read) {
  std::vector<double> result;
  std::vector<float> pixels(3 * static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
  const ImageView<float> view{pixels.data(), 3, side, side};
  const std::size_t different = std::min(count, images.size());
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t place = i % different;
    images.read_square(images.procedural() ? place : place * images.size() / different, i / different, view);
    const auto& values = read(ImageView<const float>(view));
    result.insert(result.end(), values.begin(), values.end());
  }
  return result;
}

template <class E>
std::vector<double> logits_of(const Lattice& decoder, const PretrainImages& images, std::size_t count, int side,
                              E& executor) {
  Lattice::Context context;
  std::vector<float> logits(static_cast<std::size_t>(decoder.bits()));
  return over_squares(images, count, side, [&](ImageView<const float> view) -> const std::vector<float>& {
    decoder.forward(view, std::span<float>(logits), context, executor);
    return logits;
  });
}

/// The logits of unmarked images: for a decoder that can be trusted, no evidence.
nlohmann::ordered_json unmarked_json(const Lattice& decoder, const std::vector<double>& logits) {
  const auto bits = static_cast<std::size_t>(decoder.bits());
  const std::size_t count = logits.size() / bits;
  const TriangularWhitening moments = triangular_whitening(logits, bits, 0);
  double offset = 0, deviation = 0, correlation = 0, ones = 0;
  for (std::size_t i = 0; i < bits; ++i) {
    offset += std::abs(moments.mean[i]) / static_cast<double>(bits);
    deviation += moments.deviation[i] / static_cast<double>(bits);
    for (std::size_t j = 0; j < i; ++j) {
      double sum = 0;
      for (std::size_t n = 0; n < count; ++n)
        sum += (logits[n * bits + i] - moments.mean[i]) * (logits[n * bits + j] - moments.mean[j]);
      correlation += std::abs(sum / static_cast<double>(count) / (moments.deviation[i] * moments.deviation[j]));
    }
  }
  for (const double z : logits) ones += z > 0 ? 1 : 0;
  const double pairs = static_cast<double>(bits) * static_cast<double>(bits - 1) / 2;
  return {{"images", count},
          {"mean_absolute_offset", offset},
          {"deviation", deviation},
          {"mean_absolute_correlation", bits > 1 ? correlation / pairs : 0},
          {"correlation_by_chance", std::sqrt(2 / 3.14159265358979 / static_cast<double>(count))},
          {"share_of_ones", ones / static_cast<double>(logits.size())}};
}

Result<Done> check(const PretrainOptions& o) {
  const auto wrong = [](const char* option, std::string problem, std::string remedy) {
    return Error{ErrorKind::invalid, {}, option, std::move(problem), std::move(remedy)};
  };
  if (o.features < o.bits || o.features > 4096)
    return wrong("--features", "is " + std::to_string(o.features),
                 "give from " + std::to_string(o.bits) + " (one a bit) to 4096");
  for (const std::filesystem::path& path : {o.out, o.json}) {  // known now, not after the training
    const Result<AtomicFile> writable = AtomicFile::create(path);
    if (!writable) return writable.error();
  }
  return Done{};
}

/// Training images and those that are kept out of it.
Result<std::pair<PretrainImages, PretrainImages>> open_images(const PretrainOptions& o, int square) {
  char* end = nullptr;
  const double share = std::strtod(o.held_out.c_str(), &end);
  const bool is_number = end != o.held_out.c_str() && *end == '\0';
  PretrainImages train(o.seed), held(o.seed + 1000003);
  if (!o.images.empty()) {
    Result<PretrainImages> opened =
        PretrainImages::folder(o.images, "--images", square, 2 * square, o.memory_budget_mb);
    if (!opened) return opened.error();
    train = std::move(*opened);
    if (is_number) {
      held = train.take_share(share);
      if (train.procedural()) {
        return Error{ErrorKind::invalid, o.images.string(), "--held-out",
                     "leaves no photograph to train on; photographs whose names differ only in a final "
                     "_number stay together",
                     "give more photographs, or measure on another folder"};
      }
    }
  }
  if (!is_number) {
    Result<PretrainImages> opened =
        PretrainImages::folder(o.held_out, "--held-out", square, 2 * square, o.memory_budget_mb);
    if (!opened) return opened.error();
    held = std::move(*opened);
  }
  return std::pair<PretrainImages, PretrainImages>(std::move(train), std::move(held));
}

std::string described(const PretrainImages& images) {
  return images.procedural() ? "procedural images" : std::to_string(images.size()) + " photographs";
}

LatticeSettings shape_of(const PretrainOptions& options) {
  LatticeSettings shape;
  shape.bits = options.bits;
  shape.features = options.features;
  shape.gate = 0.15;
  if (options.fourier == "colour") {
    shape.measure = LatticeMeasure::colour;
    shape.sigma = {0.5};
    shape.stride = 1;
    shape.gate = 0.02;
    shape.floor = 1e-4;
  }
  return shape;
}
/// In the units of what is read: logarithms, or colours between 0 and 1 (12 levels of 255).
std::vector<double> periods_of(const LatticeSettings& shape) {
  return std::vector<double>(shape.dimensions() / 3, shape.measure == LatticeMeasure::colour ? 0.047 : 0.1);
}

/// Spread of the features' periods in octaves, either way: there are few colours, and features of one period respond
/// alike to them.
double spread_of(const LatticeSettings& shape) { return shape.measure == LatticeMeasure::colour ? 0.7 : 0; }

/// Images that are measured.
std::size_t measured_of(const PretrainOptions& options, const PretrainImages& held) {
  return std::min(static_cast<std::size_t>(options.measured), held.size());
}
std::string digest_of(const PretrainImages& train) { return train.procedural() ? "" : train.digest(); }

/// Whether the decoder that is there was trained with these options, as its measurements say. An error names those that
/// are others; with --force there is none.
Result<bool> is_finished(const PretrainOptions& options, const PretrainImages& train, const PretrainImages& held) {
  const Result<nlohmann::json> found = read_json<nlohmann::json>(options.json);
  const Result<std::string> decoder = file_sha256(options.out);
  if (!found || !found->is_object() || !decoder || found->value("decoder_sha256", nlohmann::json()) != *decoder)
    return false;
  Differences differences;
  for (const auto& [field, option, now] :
       {std::tuple<const char*, const char*, nlohmann::json>("waves", "--fourier", options.fourier),
        {"bits", "--bits", options.bits},
        {"features", "--features", options.features},
        {"steps", "--steps", options.steps},
        {"seed", "--seed", options.seed},
        {"crop", "--crop", options.crop},
        {"images", "--measure", measured_of(options, held)},
        {"embedding_steps", "--measure-steps", options.measure_steps}})
    differences.values(option, found->value(field, nlohmann::json()), now);
  if (found->value("training_images_sha256", nlohmann::json()) != digest_of(train))
    differences.add("--images, or --held-out,", "differ");
  if (differences.none()) return true;
  if (options.force) return false;
  return Error{ErrorKind::invalid, options.out.string(), "--resume",
               "the decoder is finished, and " + differences.text(),
               "leave out --resume and choose another --out, or give --force to move it aside"};
}

int run(PretrainOptions& options) {
  if (options.features == 0) options.features = options.fourier == "colour" ? options.bits : 256;
  if (options.json.empty()) options.json = std::filesystem::path(options.out).replace_extension(".json");
  if (Result<Done> good = check(options); !good) return fail(good.error());
  const Result<std::shared_ptr<const void>> alone = hold_file(options.out);
  if (!alone) return fail(alone.error());
  const int square = options.crop * 8 / 7;  // of the images that are measured: 256 for crops of 224
  auto opened = open_images(options, square);
  if (!opened) return fail(opened.error());
  const PretrainImages& train = opened->first;
  const PretrainImages& held = opened->second;
  const std::filesystem::path checkpoint = std::filesystem::path(options.out) += ".checkpoint";
  const bool resuming = options.resume && std::filesystem::exists(checkpoint);
  if (options.resume && !resuming) {
    const Result<bool> finished = is_finished(options, train, held);
    if (!finished) return fail(finished.error());
    if (*finished) {
      std::fprintf(stderr, "compmark: %s is finished, with these options: nothing is left to do\n",
                   options.out.string().c_str());
      return success;
    }
  }
  if (Result<Done> free = check_no_decoder(options.out, options.force || resuming); !free) return fail(free.error());
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  const PretrainSettings settings = training_settings(options);

  const LatticeSettings shape = shape_of(options);
  const std::string digest = train.procedural() ? "dead leaves" : train.digest();
  const std::string identity = (options.fourier == "contrast" ? "lattice" : "lattice of " + options.fourier) +
                               ", bits " + std::to_string(options.bits) + ", features " +
                               std::to_string(options.features) + ", steps " + std::to_string(options.steps) +
                               ", seed " + std::to_string(options.seed) + ", crop " + std::to_string(options.crop) +
                               ", images " + digest.substr(0, 16);
  if (!options.resume && std::filesystem::exists(checkpoint)) {
    return fail({ErrorKind::invalid,
                 checkpoint.string(),
                 {},
                 "an unfinished run is in this file",
                 "continue it with --resume, or remove the file to start over"});
  }

  Lattice decoder(shape, random_lattice<float>(shape, periods_of(shape), options.seed, spread_of(shape)));
  if (!resuming) {
    Lattice::Context context;
    const std::size_t count = std::max<std::size_t>(400, 2 * static_cast<std::size_t>(options.features));
    const std::vector<double> features =
        over_squares(train, count, square, [&](ImageView<const float> view) -> const std::vector<float>& {
          decoder.pool(view, context, executor);
          return context.pooled;
        });
    lattice_head(decoder, features, options.seed);
  }
  ParameterArena<float> arena;
  Network network(std::move(decoder), arena);
  const Adam<float> adam;
  AdamState<float> moments;
  adam.prepare(arena.layout(), moments);
  const Pretrainer<Network> trainer(settings);
  PretrainState<float> state;
  trainer.prepare(train, options.bits, state);
  if (resuming) {
    const Result<SafetensorsFile> file = read_safetensors(checkpoint, FileKind::decoder_training);
    if (!file) return fail(file.error());
    if (Result<Done> read = read_pretrain_state(*file, identity, arena, moments, state); !read)
      return fail(read.error());
    std::fprintf(stderr, "compmark: resuming after step %lld\n", static_cast<long long>(state.iteration));
  }
  std::fprintf(stderr, "compmark: %d bits, training on %s, measuring on %s\n", options.bits, described(train).c_str(),
               described(held).c_str());

  std::optional<InterruptWatch> watch(std::in_place);
  Pretrainer<Network>::Context context;
  Lines lines(state.iteration);
  while (state.iteration < settings.steps) {
    const PretrainReport report =
        trainer.step(train, network, arena, adam, moments, state, context, JpegCodec{}, executor);
    lines.show(state.iteration, settings.steps, report);
    const bool stop = interrupted() && state.iteration < settings.steps;
    if (!stop && (state.iteration % options.checkpoint_every != 0 || state.iteration == settings.steps)) continue;
    Result<Done> written = write_pretrain_state<SafetensorsWriter>(arena, moments, state, identity, checkpoint);
    if (!written) return fail(written.error());
    if (!stop) continue;
    lines.finish();
    std::fprintf(stderr, "compmark: interrupted after step %lld; continue with --resume\n",
                 static_cast<long long>(state.iteration));
    return interrupted_exit;
  }
  watch.reset();
  lines.finish();
  const double seconds = lines.seconds();

  // Logits of unmarked images: no offset, unit variance, no correlation. Squares of several kinds, because photographs
  // are few.
  network.load(arena);
  const Lattice& trained = network.decoder();
  const std::size_t samples = std::max<std::size_t>(1200, 24 * static_cast<std::size_t>(options.bits));
  const std::vector<double> logits = logits_of(trained, train, samples, square, executor);
  LatticeWeights<float>& weights = network.decoder().weights();
  whiten_head(triangular_whitening(logits, static_cast<std::size_t>(options.bits), 1e-3),
              std::span<float>(weights.head), std::span<float>(weights.bias));

  const std::size_t measured = measured_of(options, held);
  std::fprintf(stderr, "compmark: measuring %zu images\n", measured);
  PixelEmbeddingSettings embedding;
  embedding.steps = options.measure_steps;
  embedding.temperature = shape.logit_scale;
  embedding.augmentation = distortions();
  const auto image = [&](std::size_t i, std::vector<float>& pixels) {
    pixels.resize(3 * static_cast<std::size_t>(square) * static_cast<std::size_t>(square));
    const ImageView<float> view{pixels.data(), 3, square, square};
    held.read_square(held.procedural() ? i : i * held.size() / measured, 0, view);
    return ImageView<const float>(view);
  };
  const DecoderMeasurement result =
      measure_decoder(trained, measured, image, embedding, options.seed + 5, JpegCodec{}, executor);
  const std::size_t null_images = std::min<std::size_t>(400, held.size());
  const nlohmann::ordered_json unmarked =
      unmarked_json(trained, logits_of(trained, held, null_images, square, executor));

  const std::string note = "trained on " + described(train) + ", " + std::to_string(options.steps) + " steps, seed " +
                           std::to_string(options.seed);
  if (Result<Done> moved = options.force ? move_decoder_aside(options.out, print_note) : Done{}; !moved)
    return fail(moved.error());
  if (Result<Done> written = write_lattice<SafetensorsWriter>(trained, note, options.out); !written)
    return fail(written.error());
  const Result<std::string> sha = file_sha256(options.out);
  if (!sha) return fail(sha.error());
  nlohmann::ordered_json accuracy = nlohmann::ordered_json::object();
  const std::vector<MeasuredDistortion> kinds = measured_distortions();
  for (std::size_t d = 0; d < kinds.size(); ++d)
    accuracy[std::string(kinds[d].name)] = {
        {"mean", result.accuracy[d]}, {"standard_error", result.error[d]}, {"worst_image", result.worst[d]}};
  const nlohmann::ordered_json json{{"schema", 1},
                                    {"kind", "lattice"},
                                    {"waves", options.fourier},
                                    {"bits", options.bits},
                                    {"features", options.features},
                                    {"steps", options.steps},
                                    {"seed", options.seed},
                                    {"crop", options.crop},
                                    {"training_images", described(train)},
                                    {"training_images_sha256", digest_of(train)},
                                    {"seconds", seconds},
                                    {"threads", executor.concurrency()},
                                    {"measured_images", described(held)},
                                    {"images", measured},
                                    {"bits_a_figure", measured * static_cast<std::size_t>(options.bits)},
                                    {"embedding_steps", embedding.steps},
                                    {"logit_scale", embedding.temperature},
                                    {"psnr", result.psnr},
                                    {"bit_accuracy", accuracy},
                                    {"unmarked", unmarked},
                                    {"decoder_sha256", *sha}};
  if (Result<Done> written = write_json(options.json, json); !written) return fail(written.error());
  std::error_code ignored;
  std::filesystem::remove(checkpoint, ignored);
  std::printf("%d bits, %lld steps in %.0f s; %zu images at %.1f dB:\n", options.bits,
              static_cast<long long>(options.steps), seconds, measured, result.psnr);
  for (std::size_t d = 0; d < kinds.size(); ++d)
    std::printf("  %-18s %.4f  (worst image %.3f)\n", std::string(kinds[d].name).c_str(), result.accuracy[d],
                result.worst[d]);
  std::printf("decoder %s\nsha256 %s\nmeasurements %s\n", options.out.string().c_str(), sha->c_str(),
              options.json.string().c_str());
  return success;
}

}  // namespace

Command add_pretrain(Options& app) {
  auto options = std::make_shared<PretrainOptions>();
  app.reads("--images", options->images, InputKind::images,
            "folder of photographs to train on (default: procedural images)");
  app.number("--bits", options->bits, WholeRange{1, message_bits_limit}, "length of the message")
      ->capture_default_str();
  app.writes("--out", options->out, OutputKind::decoder, "decoder file to write (safetensors)")->required();
  app.number("--steps", options->steps, any_count, "iterations of the run")->capture_default_str();
  app.number("--seed", options->seed, any_seed, "seed of every random number")->capture_default_str();
  app.number("--threads", options->threads, thread_range, "0: all; the result is the same for any number")
      ->capture_default_str();
  app.word("--fourier", options->fourier,
           "Fourier features of contrast (survive changes of brightness, noise, JPEG and "
           "scaling) or of colour (carry more bits in a scene, but survive little)")
      ->capture_default_str()
      ->check(CLI::IsMember({"contrast", "colour"}));
  app.number("--features", options->features, WholeRange{0, 4096},
             "number of Fourier features; more of them give more bit accuracy and take longer "
             "(default: 256 of contrast, one for each bit of colour)");
  app.number("--crop", options->crop, WholeRange{32, 1024}, "side of the training crops, pixels")
      ->capture_default_str();
  app.number("--memory-budget", options->memory_budget_mb, WholeRange{1, 1 << 24},
             "MiB of memory for reading one photograph; larger ones are refused before they are "
             "decoded")
      ->capture_default_str();
  app.flag("--resume", options->resume, "continue the run of --out from its checkpoint");
  app.number("--checkpoint-every", options->checkpoint_every, run_length, "iterations between checkpoints")
      ->capture_default_str();
  app.share_or_folder("--held-out", options->held_out,
                      "images to measure on: a share of the photographs, which is then not trained on, or "
                      "another folder")
      ->capture_default_str();
  app.number("--measure", options->measured, WholeRange{1, 100000},
             "images that are marked and read for the measurement at the end")
      ->capture_default_str();
  app.number("--measure-steps", options->measure_steps, WholeRange{1, 1000000},
             "iterations of embedding into each of these images")
      ->capture_default_str();
  app.flag("--force", options->force, "move an existing file of --out to OUT.<beginning of its SHA-256>.old");
  app.writes("--json", options->json, OutputKind::words,
             "write the measurements to this file (default: --out with the ending .json)");
  app.also([options](FileUse& use) {
    if (options->json.empty())
      use.write(std::filesystem::path(options->out).replace_extension(".json"), "--json", OutputKind::words);
    use.write(std::filesystem::path(options->out) += ".checkpoint", "--out (its checkpoint)");
  });
  return [options]() -> int { return run(*options); };
}

}  // namespace tool
