// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The decoder of a mark that was given none: it is fitted to the scene, or is that of the run which is resumed.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "compmark/app/files.hpp"
#include "compmark/app/run/detail/fit_record.hpp"
#include "compmark/app/run/detail/run_mark.hpp"
#include "compmark/app/run/detail/run_plan.hpp"
#include "compmark/app/run/detail/told.hpp"
#include "compmark/app/run/fit_decoder.hpp"
#include "compmark/app/run/run_folder.hpp"
#include "compmark/io/file_exists.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/io/safetensors.hpp"

namespace compmark::detail {

/// A resumed run keeps the decoder that it began with, and is not given another.
[[nodiscard]] inline Result<Done> fitted_alike(const MarkSettings& mark, const FitRecord& record,
                                               const std::filesystem::path& decoder) {
  const bool other_period = mark.period && *mark.period != record.period;
  const bool other_tone = mark.tone && *mark.tone != record.tone;
  if (!other_period && !other_tone) return Done{};
  return Error{ErrorKind::invalid, decoder.string(), other_period ? "--period" : "--tone",
               "names another decoder than this run began with",
               "give the first decoder, or leave the option out, or choose another --out"};
}

/// The seed of a fit, from key and model: another owner who marks the same scene gets other waves, and the note of the
/// decoder names it. It says nothing of the message, which has a label of its own. Quick keys fit with the default.
[[nodiscard]] inline std::optional<std::uint64_t> fit_seed(const OwnerKey& key, const std::string& model_sha256) {
  if (key.hardness == 0) return std::nullopt;
  std::array<std::byte, 6> bytes{};  // a whole number that every reader of JSON keeps
  key.derive("compmark/fit seed/v2 " + model_sha256, bytes);
  std::uint64_t seed = 0;
  for (const std::byte byte : bytes) seed = seed << 8 | std::to_integer<std::uint64_t>(byte);
  return seed;
}

/// Fits a decoder for the scene, of the key's length, into the run's folder; a run that is resumed has one.
[[nodiscard]] inline Result<Done> make_decoder(RunPlan& plan) {
  if (plan.mark.key.empty()) return Done{};  // load_mark says so
  const Result<OwnerKey> key = key_of(plan.mark, warnings_of(*plan.observer));
  if (!key) return key.error();
  DecoderFileSettings fit;
  fit.model = plan.model;  // of a codec: as its file says it
  fit.data = plan.data;
  fit.out = plan.out / "decoder.safetensors";
  plan.mark.decoder = fit.out;
  if (Result<Done> held = hold_run(plan); !held) return held;  // or what is there may be of a run that is not done
  if (plan.force && !plan.resume) {
    if (Result<Done> moved = move_decoder_aside(fit.out, notes_of(*plan.observer)); !moved) return moved;
  }
  if (detail::file_exists(fit.out)) {
    const Result<SafetensorsFile> file = read_safetensors(fit.out);
    if (!file) return file.error();
    const Result<std::string> model = file_sha256(plan.model);
    if (!model) return model.error();
    const auto note = file->metadata.find("note");
    const std::optional<FitRecord> record = note != file->metadata.end() ? read_fit_record(note->second) : std::nullopt;
    const bool of_this = record && record->model_sha256 == *model;
    if (plan.resume && of_this) {
      Result<Done> alike = fitted_alike(plan.mark, *record, fit.out);
      if (alike || !plan.force) return alike;
    }
    if (!plan.force) {
      return Error{ErrorKind::invalid, fit.out.string(), "--decoder",
                   of_this ? "is missing, and a decoder of an earlier run is in this folder"
                           : "is missing, and a decoder of another model is in this folder",
                   "to keep it, choose another --out or name it with --decoder; to continue with a "
                   "decoder of this model, give --resume; to move it aside, give --force"};
    }
    if (Result<Done> moved = move_decoder_aside(fit.out, notes_of(*plan.observer)); !moved) return moved;
  }
  if (detail::file_exists(plan.out / "checkpoint.safetensors")) {
    return Error{ErrorKind::invalid,
                 (plan.out / "checkpoint.safetensors").string(),
                 {},
                 "an unfinished run with another decoder is in this folder",
                 "continue it with its --decoder and --resume, or remove the file to start over"};
  }
  fit.fit.bits = static_cast<int>(key->bits);
  const Result<std::string> digest = file_sha256(plan.model);
  if (!digest) return digest.error();
  fit.fit.seed = plan.seed ? *plan.seed : fit_seed(*key, *digest).value_or(fit.fit.seed);
  if (plan.mark.period) fit.fit.period = *plan.mark.period;
  if (plan.mark.tone) fit.fit.tone = *plan.mark.tone;
  fit.downscale = plan.downscale;
  fit.splat_up = plan.splat_up;
  const Result<FittedDecoder> made = fit_decoder_file(fit, *plan.executor, *plan.observer);
  if (!made) return made.error();
  plan.observer->on_note("decoder " + fit.out.string() + ", fitted in " + std::to_string(std::llround(made->seconds)) +
                         " s");
  return Done{};
}

}  // namespace compmark::detail
