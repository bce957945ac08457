// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What runs need to hide a message: the message of the key, its decoder, and the numbers of the mark.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "compmark/app/any_model.hpp"
#include "compmark/app/files.hpp"
#include "compmark/app/reading.hpp"
#include "compmark/app/run/mark_record.hpp"
#include "compmark/app/run/owner_keys.hpp"
#include "compmark/app/run/run_observer.hpp"
#include "compmark/app/run/run_settings.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/version.hpp"
#include "compmark/watermark/edit/edit_chain.hpp"
#include "compmark/watermark/proof/key.hpp"
#include "compmark/watermark/proof/message.hpp"

namespace compmark::detail {

/// Whether a decoder was fitted to a scene: its cover interference is low there, and a mark costs less.
[[nodiscard]] inline bool fitted_decoder(const std::filesystem::path& path) {
  const Result<SafetensorsFile> file = read_safetensors(path, FileKind::decoder);
  return file && file->metadata.contains("centres");
}

/// What reads the renders of a run that hides a message: the decoder, before which renders are edited. A recipe's
/// MessageDecoder is this one or another that is made of the decoder of the file and the edits.
using MarkingDecoder = EditedDecoder<FileDecoder, CommonEdits>;
template <class Decoder = MarkingDecoder>
[[nodiscard]] Decoder marking_decoder(const RunMark& mark, const MessageSettings& settings) {
  CommonEdits::Settings edits;
  edits.none = 1 - settings.edited_share;
  return {mark.decoder, edits};
}

/// Whether a decoder was trained for every scene, and reads the subject of a picture. What its marks are learned with
/// was measured (docs/watermark.md).
[[nodiscard]] inline bool universal_decoder(const std::filesystem::path& path) {
  const Result<SafetensorsFile> file = read_safetensors(path, FileKind::decoder);
  return file && file->metadata.contains("reads") && file->metadata.at("reads") == "subject";
}
/// Takes the decoder for every scene where none is named. One that is fitted has to be asked for then.
inline void take_universal(MarkSettings& mark) {
  if (mark.decoder.empty()) mark.decoder = mark.universal;
}

/// The key of a mark, with the recipient of the copy if it has recipients; its message must have the length of `bits`, if that is given.
[[nodiscard]] inline Result<OwnerKey> key_of(const MarkSettings& options, const SentenceSink& warn) {
  Result<OwnerKey> key = open_private_key(options.key, warn);
  if (key) key = for_recipient(*key, options.key, options.recipient);
  if (key && options.bits != 0 && options.bits != key->bits) {
    return Error{ErrorKind::invalid, options.key.string(), "bits",
                 "is " + std::to_string(key->bits) + ", and --bits is " + std::to_string(options.bits),
                 "leave out --bits, or make a key of that length with compmark keygen"};
  }
  return key;
}

/// An error if numbers for fitting a decoder are given together with a finished decoder.
[[nodiscard]] inline Result<Done> check_to_fit(const MarkSettings& options) {
  for (const auto& [number, name] : {std::pair(options.period, "--period"), std::pair(options.tone, "--tone")}) {
    if (!number) continue;
    if (options.decoder.empty()) continue;
    return Error{ErrorKind::unsupported,
                 {},
                 name,
                 "belongs to a decoder that this command fits, but a finished one is used",
                 "leave the option out, or give --decoder fit"};
  }
  if (!options.decoder.empty() || options.key.empty()) return Done{};
  const Result<OwnerKey> key = key_of(options, {});  // better now than after the training
  if (!key) return key.error();
  if (key->decoder.empty()) return Done{};
  return Error{ErrorKind::invalid, options.key.string(), "--decoder",
               "is to be fitted, and this key is bound to a decoder that is there",
               "give the decoder that the key was made for, or a key that is bound to none"};
}

/// An error if numbers of post-hoc embedding are given with a `fidelity` of 0.
[[nodiscard]] inline Result<Done> check_held(const MarkSettings& options, double fidelity) {
  for (const auto& [number, name] :
       {std::pair(options.fall, "--fidelity-fall"), std::pair(options.by_cost, "--sample-by-loss"),
        std::pair(options.orbit, "--orbit"), std::pair(options.photographs, "--photographs")}) {
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

/// An error if a number of the published distortion layer is given to a run without it.
[[nodiscard]] inline Result<Done> check_step_rate(const MarkSettings& options, bool has_layer) {
  if (!options.step_rate || has_layer) return Done{};
  return Error{ErrorKind::unsupported,
               {},
               "--step-rate",
               "belongs to the published distortion layer, which this run does not have",
               "leave it out, or train with --profile official or paper and without --codec"};
}

/// Reads key and decoder, which must agree on the length, and sets the numbers of the mark in the settings of the run.
[[nodiscard]] inline Result<RunMark> load_mark(const MarkSettings& options, TrainSettings& settings,
                                               ThreadExecutor& executor, const SentenceSink& warn) {
  const auto missing = [](const char* option, const char* remedy) {
    return Error{ErrorKind::invalid, {}, option, "is missing", remedy};
  };
  if (options.key.empty()) return missing("--key", "make one with compmark keygen");
  if (options.decoder.empty())
    return missing("--decoder",
                   "give a decoder of compmark fit or of weights/; only embed, and train without --unmarked "
                   "and --for-compression, can fit one");
  const Result<OwnerKey> key = key_of(options, warn);
  if (!key) return key.error();
  Result<FileDecoder> decoder = open_decoder(options.decoder, &*key);
  if (!decoder) return decoder.error();
  RunMark input;
  if (!options.unmarked.empty()) {  // better now than after the training
    const Result<AnyModel> counterpart = AnyModel::open(options.unmarked, executor);
    if (!counterpart) return counterpart.error();
    input.unmarked_unit = counterpart->info().unit;
    input.unmarked_origin = counterpart->info().origin;
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
  input.unmarked = options.unmarked;
  input.for_compression = options.for_compression;

  MarkNumbers& mark = settings.mark;
  if (options.fidelity && (*options.fidelity > 0) != (mark.posthoc.fidelity > 0)) {
    mark = *options.fidelity > 0 ? posthoc_mark() : mark_in_the_photographs();
  }
  if (mark.posthoc.fidelity > 0 && (fitted_decoder(options.decoder) || universal_decoder(options.decoder)))
    mark.message.hinge_power = 2;
  if (!mark.message.own_scale) mark.message.logit_scale = decoder->logit_scale();
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
  if (options.step_rate) mark.distortion.rate_weight = *options.step_rate;
  if (options.rate) mark.residual.learning_rate = *options.rate;
  if (options.fidelity) mark.posthoc.fidelity = *options.fidelity;
  if (Result<Done> held = check_held(options, mark.posthoc.fidelity); !held) return held.error();
  if (options.by_cost) mark.posthoc.draw_by_cost = *options.by_cost;
  if (options.orbit) mark.posthoc.orbit_share = *options.orbit;
  if (options.photographs) mark.posthoc.photograph_share = *options.photographs;
  if (options.edits) mark.message.edited_share = *options.edits;
  if (options.lost_anchors) mark.posthoc.lost_anchors = *options.lost_anchors;
  if (options.calibrate_steps) mark.posthoc.calibrate_steps_every = *options.calibrate_steps;
  if (options.fall) mark.posthoc.fidelity_fall = *options.fall;
  mark.message.every = options.message_every;
  if (mark.message.novel_view_every != 0) mark.message.novel_view_every = options.message_every;
  // A run is resumed with the same key, decoder and stages alone. The commitment says nothing of the message.
  mark.identity = key->commitment().substr(0, 16) + digest->substr(0, 16) + (options.for_compression ? "c" : "");
  if (key->recipient != 0) mark.identity += "recipient " + std::to_string(key->recipient);
  input.decoder = std::move(*decoder);
  return input;
}

}  // namespace compmark::detail
