// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the note of a fitted decoder file says of its fit, as numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include "compmark/io/json_file.hpp"
#include "compmark/watermark/fit/decoder_fit_settings.hpp"

namespace compmark::detail {

/// A fit: of which model, and with which numbers. Those that a note does not name are 0.
struct FitRecord {
  std::string model_sha256;
  std::uint64_t seed = 0;
  int statistics_views = 0, gradient_views = 0, features = 0, coordinates = 0, stride = 0;
  double period = 0, edit_weight = 0, tone = 0, region_limit = 0;

  friend bool operator==(const FitRecord&, const FitRecord&) = default;
};

[[nodiscard]] inline FitRecord fit_record(const std::string& model_sha256, const DecoderFitSettings& fit) {
  return {model_sha256,
          fit.seed,
          fit.statistics_views,
          fit.gradient_views,
          fit.features,
          fit.coordinates,
          fit.stride,
          fit.period,
          fit.edit_weight,
          fit.tone > 0 ? fit.tone : 0,
          fit.region_limit > 0 ? fit.region_limit : 0};
}

/// The words before the digest and behind it.
inline constexpr std::string_view fit_note_begin = "fitted to the unmarked model of sha256 ", fit_note_with = " with ";

/// The note of a decoder file.
[[nodiscard]] inline std::string fit_note(const FitRecord& fit) {
  const auto number = [](double value) { return nlohmann::json(value).dump(); };
  std::string note = std::string(fit_note_begin) + fit.model_sha256 + std::string(fit_note_with) + "seed " +
                     std::to_string(fit.seed) + ", views " + std::to_string(fit.statistics_views) +
                     ", gradient views " + std::to_string(fit.gradient_views) + ", waves " +
                     std::to_string(fit.features) + ", period " + number(fit.period) + ", coordinates " +
                     std::to_string(fit.coordinates) + ", stride " + std::to_string(fit.stride) + ", edit weight " +
                     number(fit.edit_weight);
  if (fit.tone > 0) note += ", tone " + number(fit.tone);
  if (fit.region_limit > 0) note += ", region limit " + number(fit.region_limit);
  return note;
}

/// The same back; nothing if the text is the note of no fit. Names that are not known are passed over.
[[nodiscard]] inline std::optional<FitRecord> read_fit_record(const std::string& note) {
  constexpr std::size_t digits = 64;
  const std::size_t head = fit_note_begin.size();
  if (note.compare(0, head, fit_note_begin) != 0 || note.size() < head + digits + fit_note_with.size() ||
      note.compare(head + digits, fit_note_with.size(), fit_note_with) != 0)
    return std::nullopt;
  FitRecord fit;
  fit.model_sha256 = note.substr(head, digits);
  for (std::size_t begin = head + digits + fit_note_with.size(); begin < note.size();) {
    const std::size_t end = std::min(note.find(", ", begin), note.size());
    const std::string part = note.substr(begin, end - begin);
    begin = end + 2;
    const std::size_t space = part.rfind(' ');
    if (space == std::string::npos) return std::nullopt;
    const nlohmann::json value = json_from<nlohmann::json>(part.substr(space + 1));
    if (!value.is_number()) return std::nullopt;
    const std::string name = part.substr(0, space);
    const auto whole = [&](const char* wanted, auto& field) {
      if (name == wanted && value.is_number_integer()) field = value.get<std::remove_reference_t<decltype(field)>>();
    };
    const auto real = [&](const char* wanted, double& field) {
      if (name == wanted) field = value.get<double>();
    };
    whole("seed", fit.seed);
    whole("views", fit.statistics_views);
    whole("gradient views", fit.gradient_views);
    whole("waves", fit.features);
    whole("coordinates", fit.coordinates);
    whole("stride", fit.stride);
    real("period", fit.period);
    real("edit weight", fit.edit_weight);
    real("tone", fit.tone);
    real("region limit", fit.region_limit);
  }
  return fit;
}

}  // namespace compmark::detail
