// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "reading.hpp"

#include <algorithm>
#include <array>
#include <compmark/io/image_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/io/sha256.hpp>
#include <compmark/mark/carrier_stream.hpp>
#include <compmark/mark/key.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/scene/image.hpp>
#include <compmark/scene/turn.hpp>
#include <compmark/version.hpp>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include "common.hpp"
#include "model_files.hpp"

namespace tool {
namespace {

using namespace compmark;
namespace fs = std::filesystem;

/// The views a user asked for, evenly spaced: the same ones for everybody.
template <class T>
void keep_evenly(std::vector<T>& items, std::size_t count) {
  if (count == 0 || count >= items.size()) return;
  std::vector<T> kept;
  for (std::size_t i = 0; i < count; ++i) kept.push_back(std::move(items[i * items.size() / count]));
  items = std::move(kept);
}

/// Of an image while it is read, at most: its floats, their blurs and what is read at each position.
constexpr std::uint64_t bytes_a_pixel = 56;

/// An image as floats in [0, 1], and the name of its file. A large image is never held in two forms longer than needed:
/// the file, its pixels, their planes and the floats are 20 bytes a pixel together, and the floats alone are 12.
struct ReadImage {
  std::vector<float> planes;  ///< [3, height, width]
  int width = 0, height = 0;
  std::string sha256;  ///< of the file
};
Result<Done> read_planes(const fs::path& path, const ReadingOptions& options, ReadImage& read) {
  const std::string& background = options.background;
  read.planes = {};  // of the image before
  std::vector<std::uint8_t> planes;
  {
    Result<std::vector<std::byte>> bytes = read_image_bytes(path);
    if (!bytes) return bytes.error();
    const Result<ImageInfo> info = decode_image_info(*bytes, path.string());
    if (!info) return info.error();
    if (Result<Done> fits = check_image_memory(*info, path, bytes_a_pixel, options.memory_budget_mb); !fits)
      return fits;
    read.sha256 = Sha256{}.update(*bytes).hex();
    Result<ImageBytes> image = decode_image(*bytes, path.string());
    if (!image) return image.error();
    *bytes = {};
    *image = turned(std::move(*image), info->orientation);
    const std::size_t channels = static_cast<std::size_t>(image->channels);
    if (background.empty() && (channels == 2 || channels == 4)) {
      for (std::size_t i = channels - 1; i < image->pixels.size(); i += channels) {
        if (image->pixels[i] == 255) continue;
        return Error{ErrorKind::invalid, path.string(), "alpha", "has transparent pixels",
                     "choose the colour behind them with --background white or black"};
      }
    }
    read.width = image->width;
    read.height = image->height;
    planes.resize(3 * static_cast<std::size_t>(read.width) * static_cast<std::size_t>(read.height));
    const float behind = background == "white" ? 1.0f : 0.0f;
    composite(image->pixels, image->channels, {behind, behind, behind}, AlphaRounding::nearest, planes);
  }
  read.planes.resize(planes.size());
  for (std::size_t i = 0; i < planes.size(); ++i) read.planes[i] = static_cast<float>(planes[i]) / 255.0f;
  return Done{};
}

Result<Done> read_images(const ReadingOptions& options, const Decoder& decoder, ThreadExecutor& executor,
                         Reading& reading) {
  Result<std::vector<fs::path>> files = image_files(options.images);
  if (!files) return files.error();
  keep_evenly(*files, options.views);
  Decoder::Context context;
  ReadImage image;
  for (const fs::path& path : *files) {
    if (Result<Done> done = read_planes(path, options, image); !done) return done;
    Result<ViewLogits> view =
        read_logits(decoder, ImageView<const float>{image.planes.data(), 3, image.height, image.width}, path.string(),
                    context, executor);
    if (!view) return view.error();
    view->name = path.filename().string();
    view->sha256 = image.sha256;
    reading.views.push_back(std::move(*view));
  }
  return Done{};
}

/// The unmarked model of the scene of `marked`. Both must have the same unit and origin, or a camera of one sees
/// nothing of the other.
Result<AnyModel> load_unmarked(const fs::path& path, const ModelInfo& marked, Reading& reading) {
  Result<AnyModel> model = load_model(path);
  if (!model) return model;
  if (model->info().unit != marked.unit || model->info().origin != marked.origin) {
    return Error{ErrorKind::invalid, path.string(), "--unmarked",
                 "has another unit of length or another origin than the model",
                 "give the unmarked model that this one was made from"};
  }
  const Result<std::string> digest = file_sha256(path);
  if (!digest) return digest.error();
  reading.sources.unmarked = path.filename().string();
  reading.sources.unmarked_sha256 = *digest;
  return model;
}

Result<Done> read_renders(const ReadingOptions& options, const Decoder& decoder, ThreadExecutor& executor,
                          Reading& reading) {
  Result<AnyModel> model = load_model(options.model, options.threads);
  if (!model) return model.error();
  const Result<std::string> digest = file_sha256(options.model);
  if (!digest) return digest.error();
  reading.sources.model = options.model.filename().string();
  reading.sources.model_sha256 = *digest;
  std::vector<StoredView> views = model->info().views;
  const bool any_test = std::any_of(views.begin(), views.end(), [](const StoredView& view) { return view.test; });
  if (options.split != "all") {
    const bool test = options.split == "test" && any_test;
    std::erase_if(views, [&](const StoredView& view) { return view.test != test; });
  }
  if (views.empty()) {
    return Error{ErrorKind::invalid, options.model.string(), "--split", "the model stores no such camera",
                 "render images of it and give them with --images"};
  }
  keep_evenly(views, options.views);
  std::optional<AnyModel> unmarked;
  if (!options.unmarked.empty()) {
    Result<AnyModel> loaded = load_unmarked(options.unmarked, model->info(), reading);
    if (!loaded) return loaded.error();
    unmarked = std::move(*loaded);
  }
  Decoder::Context context;
  const auto read_render = [&](AnyModel& of, const StoredView& view) -> Result<ViewLogits> {
    const Result<RenderedView> render = of.render(view.camera, view.lens, executor);
    if (!render) return render.error();
    round_to_8bit<float>(render->image, render->image);
    Result<ViewLogits> logits =
        read_logits(decoder, ImageView<const float>(render->image), view.name, context, executor);
    if (logits) logits->sha256 = pixels_sha256(render->image);
    return logits;
  };
  for (const StoredView& view : views) {
    Result<ViewLogits> read = read_render(*model, view);
    if (!read) return read.error();
    if (unmarked) {
      const Result<ViewLogits> said = read_render(*unmarked, view);
      if (!said) return said.error();
      for (std::size_t bit = 0; bit < read->logits.size(); ++bit) read->logits[bit] -= said->logits[bit];
    }
    reading.views.push_back(std::move(*read));
  }
  return Done{};
}

std::string_view outcome_name(PayloadCode::Outcome outcome) {
  return outcome == PayloadCode::Outcome::read         ? "read"
         : outcome == PayloadCode::Outcome::crc_failed ? "crc_failed"
                                                       : "too_many_errors";
}

}  // namespace

PayloadText payload_text(const OwnerKey& key, const Message& read) {
  const PayloadCode::Reading reading = read_payload(key, read);
  const bool whole = reading.outcome == PayloadCode::Outcome::read;
  // The probability that random bits pass BCH and the CRC: a payload alone is no evidence.
  const double chance = payload_code(key)->code.random_decode_rate() / 256;
  PayloadText text;
  text.json = {{"outcome", std::string(outcome_name(reading.outcome))},
               {"hex", whole ? nlohmann::ordered_json(reading.data.hex()) : nlohmann::ordered_json(nullptr)},
               {"corrected", whole ? nlohmann::ordered_json(reading.corrected) : nlohmann::ordered_json(nullptr)},
               {"chance", chance}};
  std::array<char, 160> line{};
  if (whole) {
    std::snprintf(line.data(), line.size(),
                  "payload     %s, %zu bit%s corrected, CRC right; bits of chance pass with probability %.1g\n",
                  reading.data.hex().c_str(), reading.corrected, reading.corrected == 1 ? "" : "s", chance);
  } else {
    std::snprintf(line.data(), line.size(), "payload     cannot be read (%s)\n",
                  reading.outcome == PayloadCode::Outcome::crc_failed ? "the CRC is wrong" : "too many wrong bits");
  }
  text.line = line.data();
  return text;
}

std::string pixels_sha256(ImageView<const float> image) {
  const ImageBytes bytes = to_bytes(image);
  return Sha256{}.update(std::as_bytes(std::span<const std::uint8_t>(bytes.pixels))).hex();
}

Result<OwnerKey> load_key(const fs::path& path) {
  Result<OwnerKey> key = read_key(path);
  if (!key) return key;
  if (Result<Done> fits = check_payload(*key); !fits) {
    Error error = fits.error();
    error.file = path.string();
    return error;
  }
  if (!key_file_is_private(path)) {
    std::fprintf(stderr, "compmark: warning: %s: others may read this key; run chmod 600 on it\n",
                 path.string().c_str());
  }
  return key;
}

Result<Decoder> load_decoder(const fs::path& path, const OwnerKey* key) {
  const Result<SafetensorsFile> file = read_safetensors(path, FileKind::decoder);
  if (!file) return file.error();
  std::vector<double> carriers;
  const auto kind = file->metadata.find("kind");
  if (key != nullptr && kind != file->metadata.end() && kind->second == "carrier") {
    const Result<DecoderWeights> weights = read_decoder(*file);
    if (!weights) return weights.error();
    if (Result<Done> fits = require_bits(*weights, static_cast<int>(key->bits), path.string()); !fits)
      return fits.error();
    carriers = make_carriers(carrier_seed(*key), static_cast<int>(key->bits), weights->dimension());
  }
  Result<Decoder> decoder = Decoder::read(*file, carriers);
  if (!decoder) return decoder.error();
  const int bits = decoder->bits();
  if (key != nullptr && bits != static_cast<int>(key->bits)) {
    return Error{
        ErrorKind::invalid, path.string(), "bits",
        "the decoder reads " + std::to_string(bits) + " bits, the key is for messages of " + std::to_string(key->bits),
        "use a key and a decoder of the same message length"};
  }
  if (bits > static_cast<int>(message_bits_limit)) {
    return Error{ErrorKind::unsupported, path.string(), "bits", "the decoder reads " + std::to_string(bits) + " bits",
                 "messages have at most " + std::to_string(message_bits_limit)};
  }
  return decoder;
}

void add_reading_options(Options& app, ReadingOptions& options) {
  app.reads("--decoder", options.decoder, InputKind::decoder, "decoder file (safetensors)")->required();
  CLI::Option* model = app.reads("--model", options.model, InputKind::model,
                                 "model.safetensors of a run or a .cmk; its renders are read");
  CLI::Option* images =
      app.reads("--images", options.images, InputKind::images, "image files, or folders of them (PNG, JPEG)");
  app.reads("--unmarked", options.unmarked, InputKind::model,
            "the unmarked model; its reading at the same cameras is subtracted (informed reading)")
      ->needs(model);
  images->excludes(model);
  model->excludes(images);
  app.word("--split", options.split, "cameras of the model: test, train or all")
      ->capture_default_str()
      ->check(CLI::IsMember({"test", "train", "all"}));
  app.number("--views", options.views, any_count, "largest number of views that are read, evenly spaced; 0: all")
      ->capture_default_str();
  app.word("--background", options.background, "colour behind transparent pixels of images: white or black")
      ->check(CLI::IsMember({"white", "black"}));
  app.number("--memory-budget", options.memory_budget_mb, WholeRange{1, 1 << 24},
             "MiB of memory for reading one image; larger ones are refused before they are decoded")
      ->capture_default_str();
  app.number("--threads", options.threads, thread_range, "0: all")->capture_default_str();
}

Result<std::vector<fs::path>> image_files(const std::vector<fs::path>& paths) {
  std::vector<fs::path> files;
  for (const fs::path& path : paths) {
    std::error_code status;
    if (!fs::is_directory(path, status)) {
      if (!fs::exists(path, status))
        return Error{ErrorKind::not_found, path.string(), "--images", "no such file or folder", "check the path"};
      files.push_back(path);
      continue;
    }
    std::vector<fs::path> found;
    for (fs::directory_iterator i(path, status), end; !status && i != end; i.increment(status)) {
      std::string extension = i->path().extension().string();
      for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
      const bool image = extension == ".png" || extension == ".jpg" || extension == ".jpeg";
      if (image && i->path().filename().string().front() != '.') found.push_back(i->path());
    }
    if (status) {
      return Error{ErrorKind::unreadable, path.string(), "--images", "cannot be listed: " + status.message(),
                   "check its permissions"};
    }
    if (found.empty()) {
      return Error{ErrorKind::not_found, path.string(), "--images", "holds no PNG or JPEG file",
                   "give a folder of images, or the files themselves"};
    }
    std::sort(found.begin(), found.end());
    files.insert(files.end(), found.begin(), found.end());
  }
  return files;
}

Result<Reading> read_all(const ReadingOptions& options, const std::optional<OwnerKey>& key) {
  if (options.model.empty() && options.images.empty()) {
    return Error{ErrorKind::invalid, {}, "--model, --images", "are both missing", "give a model or images"};
  }
  Result<Decoder> decoder = load_decoder(options.decoder, key ? &*key : nullptr);
  if (!decoder) return decoder.error();
  const Result<std::string> digest = file_sha256(options.decoder);
  if (!digest) return digest.error();
  Reading reading;
  reading.bits = static_cast<std::size_t>(decoder->bits());
  reading.sources.program = std::string("compmark ") + version;
  reading.sources.decoder = options.decoder.filename().string();
  reading.sources.decoder_sha256 = *digest;
  if (key) {
    reading.sources.key_id = key->id();
    reading.sources.key_commitment = key->commitment();
    reading.sources.key_created = key->created;
  }
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  const Result<Done> read = options.model.empty() ? read_images(options, *decoder, executor, reading)
                                                  : read_renders(options, *decoder, executor, reading);
  if (!read) return read.error();
  return reading;
}

}  // namespace tool
