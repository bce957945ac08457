// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/reading.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/detail/files.hpp"
#include "compmark/app/detail/less_interference.hpp"
#include "compmark/app/detail/picture.hpp"
#include "compmark/app/detail/render_reading.hpp"
#include "compmark/app/reading.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/io/sha256.hpp"
#include "compmark/math/mirror.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/scene/image.hpp"
#include "compmark/scene/turn.hpp"
#include "compmark/version.hpp"
#include "compmark/watermark/decoder/page_box.hpp"
#include "compmark/watermark/proof/key.hpp"

namespace compmark {
namespace detail {

/// What every report says of its decoder and its key (none: nullptr).
inline ReportSources sources_of(const std::filesystem::path& decoder, const std::string& decoder_sha256,
                                const OwnerKey* key) {
  ReportSources sources;
  sources.program = std::string("compmark ") + version;
  sources.decoder = decoder.filename().string();
  sources.decoder_sha256 = decoder_sha256;
  if (key != nullptr) {
    sources.key_id = key->id();
    sources.key_commitment = key->commitment();
    sources.key_created = key->created;
  }
  return sources;
}

inline Result<Done> read_images(const ReadingSettings& settings, const FileDecoder& decoder,
                                const CoverInterference* interference, ThreadExecutor& executor,
                                const WorkObserver& observer, Reading& reading) {
  Result<std::vector<std::filesystem::path>> files = std::vector<std::filesystem::path>();
  if (!settings.images.empty()) files = image_files(settings.images);
  if (!files) return files.error();
  keep_evenly(*files, settings.views);
  FileDecoder::Context context;
  for (std::size_t i = 0; i < files->size() + settings.pictures.size(); ++i) {
    const bool given = i >= files->size();
    const std::string path = given ? settings.pictures[i - files->size()].name : (*files)[i].string();
    const Result<OpenPicture> picture =
        given ? open_picture(settings.pictures[i - files->size()], settings) : open_picture((*files)[i], settings);
    if (!picture) return picture.error();
    Result<ViewLogits> view = read_less(decoder, interference, picture->image(), path, context, executor);
    if (!view) return view.error();
    view->name = given ? path : (*files)[i].filename().string();
    view->sha256 = picture->sha256;
    view->part = picture->part;
    reading.views.push_back(std::move(*view));
    if (Result<Done> on = tell(observer, reading.views.size(), files->size() + settings.pictures.size()); !on)
      return on;
  }
  return Done{};
}

}  // namespace detail

COMPMARK_APP_INLINE Result<ViewLogits> read_render(AnyModel& model, const StoredView& view, const FileDecoder& decoder,
                                                   FileDecoder::Context& context, ThreadExecutor& executor,
                                                   const CoverInterference* interference) {
  const Result<RenderedView> render = model.render(view, executor);
  if (!render) return render.error();
  round_to_8bit<float>(render->image, render->image);
  Result<ViewLogits> logits =
      detail::read_less(decoder, interference, ImageView<const float>(render->image), view.name, context, executor);
  if (logits) logits->sha256 = pixels_sha256(render->image);
  return logits;
}

COMPMARK_APP_INLINE Result<OwnerKey> open_key(const std::filesystem::path& path) {
  Result<OwnerKey> key = read_key(path);
  if (!key) return key;
  const Result<Done> fits = key->recipients == 0 ? check_payload(*key) : check_recipients(key->bits, key->recipients);
  if (!fits) {
    Error error = fits.error();
    error.file = path.string();
    return error;
  }
  return key;
}

COMPMARK_APP_INLINE Result<OwnerKey> for_recipient(OwnerKey key, const std::filesystem::path& path,
                                                   std::size_t recipient) {
  if (key.recipients == 0 && recipient == 0) return key;
  const std::string count = std::to_string(key.recipients);
  const auto wrong = [&](std::string problem, std::string remedy) {
    return Error{ErrorKind::invalid, path.string(), "--recipient", std::move(problem), std::move(remedy)};
  };
  if (key.recipients == 0) {
    return wrong("is " + std::to_string(recipient) + ", and this key has no recipients",
                 "leave it out, or make a key with compmark keygen --recipients N");
  }
  if (recipient == 0) {
    return wrong("is missing or 0: this key has messages for the copies of " + count + " recipients",
                 "give the recipient of this copy, --recipient 1 to " + count);
  }
  if (recipient > key.recipients) {
    return wrong("is " + std::to_string(recipient) + ", and this key has " + count + " recipients",
                 "give 1 to " + count + ", or make a key of more recipients with compmark keygen --from");
  }
  key.recipient = recipient;
  return key;
}

COMPMARK_APP_INLINE Result<FileDecoder> open_decoder(const std::filesystem::path& path, const OwnerKey* key,
                                                     std::string* sha256) {
  const Result<SafetensorsFile> file = read_safetensors(path, FileKind::decoder);
  if (!file) return file.error();
  if (key == nullptr && detail::carrier_dimension(*file) != 0) {
    return Error{ErrorKind::invalid, path.string(), "--key",
                 "is missing, and this decoder reads along carriers that follow from the owner's key",
                 "give --key, or a decoder that is fitted to the scene"};
  }
  const bool bound = key != nullptr && !key->decoder.empty();
  if (bound || sha256 != nullptr) {
    const std::string digest = file->sha256();
    if (sha256 != nullptr) *sha256 = digest;
    if (bound && digest != key->decoder) {
      return Error{ErrorKind::invalid, path.string(), "", "is not the decoder that this key is bound to",
                   "give the decoder whose SHA-256 begins with " + key->decoder.substr(0, 16) + ", or another key"};
    }
  }
  std::optional<DecoderKey> secret;
  if (key != nullptr) secret = decoder_key(*key);
  Result<FileDecoder> decoder = FileDecoder::read(*file, secret);
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

COMPMARK_APP_INLINE Result<CoverInterference> open_interference(const std::filesystem::path& path,
                                                                const std::filesystem::path& decoder,
                                                                const OwnerKey* key, std::string* sha256) {
  const Result<SafetensorsFile> file = read_safetensors(path, FileKind::interference);
  if (!file) return file.error();
  if (sha256 != nullptr) *sha256 = file->sha256();
  Result<CoverInterference> interference = read_cover_interference(*file);
  if (!interference) return interference;
  const Result<SafetensorsFile> reader = read_safetensors(decoder, FileKind::decoder);
  if (!reader) return reader.error();
  const std::size_t dimension = detail::carrier_dimension(*reader);
  if (interference->decoder_sha256 != reader->sha256() || (dimension != 0 && interference->outputs() != dimension)) {
    return Error{ErrorKind::invalid, path.string(), "--interference",
                 "was measured for another decoder than " + decoder.filename().string(),
                 "give the decoder that it was measured for, or measure it again with `compmark interference`"};
  }
  if (dimension == 0 || key == nullptr) return interference;
  const DecoderKey secret = decoder_key(*key);
  return interference->along(make_carriers(secret.seed, secret.bits, static_cast<int>(dimension)));
}

COMPMARK_APP_INLINE Result<Reading> read_messages(const ReadingSettings& settings, const std::optional<OwnerKey>& key,
                                                  ThreadExecutor& executor, const WorkObserver& observer) {
  if (!settings.unmarked.empty() && settings.model.empty()) {
    return Error{ErrorKind::invalid, settings.unmarked.string(), "--unmarked",
                 "is for a model here, and these are images", "find their cameras with compmark verify --unmarked"};
  }
  if (!settings.model.empty() && (!settings.images.empty() || !settings.pictures.empty())) {
    return Error{ErrorKind::invalid, settings.model.string(), "--model, --images", "are both given",
                 "read a model, or images"};
  }
  if (settings.restored && (settings.model.empty() || settings.unmarked.empty())) {
    return Error{ErrorKind::invalid,
                 {},
                 "--restored",
                 "is for a model with the unmarked one",
                 "give --model and --unmarked, or leave it out"};
  }
  if (settings.model.empty() && settings.missing_share != 0) {
    return Error{ErrorKind::invalid, {}, "--pruned", "is for a model, and these are images", "leave it out"};
  }
  if (settings.model.empty() && settings.images.empty() && settings.pictures.empty()) {
    return Error{ErrorKind::invalid, {}, "--model, --images", "are both missing", "give a model or images"};
  }
  std::string decoder_sha256;
  Result<FileDecoder> decoder = open_decoder(settings.decoder, key ? &*key : nullptr, &decoder_sha256);
  if (!decoder) return decoder.error();
  if (!settings.interference.empty() && !settings.unmarked.empty()) {
    return Error{ErrorKind::invalid,
                 {},
                 "--interference, --unmarked",
                 "do not go together",
                 "give one: both subtract what the unmarked model says"};
  }
  std::optional<CoverInterference> interference;
  Reading reading;
  reading.sources = detail::sources_of(settings.decoder, decoder_sha256, key ? &*key : nullptr);
  if (!settings.interference.empty()) {
    std::string said;
    Result<CoverInterference> opened =
        open_interference(settings.interference, settings.decoder, key ? &*key : nullptr, &said);
    if (!opened) return opened.error();
    interference = std::move(*opened);
    if (interference->outputs() != static_cast<std::size_t>(decoder->bits())) {
      return Error{
          ErrorKind::invalid, settings.interference.string(), "outputs",
          std::to_string(interference->outputs()) + " are not the decoder's " + std::to_string(decoder->bits()),
          "measure it again with `compmark interference`"};
    }
    reading.sources.interference = settings.interference.filename().string();
    reading.sources.interference_sha256 = std::move(said);
  }
  reading.bits = static_cast<std::size_t>(decoder->bits());
  const CoverInterference* const less = interference ? &*interference : nullptr;
  const Result<Done> read = settings.model.empty()
                                ? detail::read_images(settings, *decoder, less, executor, observer, reading)
                                : detail::read_renders(settings, *decoder, less, executor, observer, reading);
  if (!read) return read.error();
  return reading;
}

}  // namespace compmark
