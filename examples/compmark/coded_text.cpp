// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "coded_text.hpp"

#include <cstdio>

namespace tool {

using namespace compmark;

namespace {

template <class... Values>
std::string formatted(const char* format, Values... values) {
  char text[160];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

}  // namespace

std::string coded_text(const CodecReport& report) {
  std::string text = formatted("%llu bytes, %llu anchors with %llu unmasked offsets", report.total_bytes + 0ull,
                               report.anchors + 0ull, report.unmasked_offsets + 0ull);
  if (report.dropped != 0) text += formatted(", %llu anchors without one are left out", report.dropped + 0ull);
  text += "\n";
  if (report.profile == ContainerProfile::context_gs) {
    text += formatted("  levels: %llu coarse anchors, %llu, %llu fine\n", report.level_anchors[2] + 0ull,
                      report.level_anchors[1] + 0ull, report.level_anchors[0] + 0ull);
  }
  for (const auto& [name, bytes] : coded_sections(report)) {
    text += formatted("  %-30s %10llu  %5.1f %%\n", name.c_str(), bytes + 0ull,
                      100.0 * static_cast<double>(bytes) / static_cast<double>(report.total_bytes));
  }
  static constexpr const char* groups[3] = {"feature", "scale", "offset"};
  for (std::size_t group = 0; group < 3; ++group) {
    if (report.clamped[group] != 0) {
      text += formatted("  warning: %llu values of %s were outside of the coded range and are clipped to it\n",
                        report.clamped[group] + 0ull, groups[group]);
    }
    if (report.symbols[group] == 0) continue;
    text += formatted("  %s: %.3f bits a scalar\n", groups[group],
                      report.ideal_bits[group] / static_cast<double>(report.symbols[group]));
  }
  if (report.hyperprior_symbols != 0) {
    text += formatted("  hyperprior: %.3f bits a scalar\n",
                      report.hyperprior_bits / static_cast<double>(report.hyperprior_symbols));
  }
  return text;
}

nlohmann::ordered_json coded_json(const CodecReport& report) {
  nlohmann::ordered_json sections;
  for (const auto& [name, bytes] : coded_sections(report)) sections[name] = bytes;
  nlohmann::ordered_json bits;
  static constexpr const char* groups[3] = {"feature", "extent", "offset"};
  for (std::size_t group = 0; group < 3; ++group) {
    if (report.symbols[group] != 0)
      bits[groups[group]] = report.ideal_bits[group] / static_cast<double>(report.symbols[group]);
  }
  if (report.hyperprior_symbols != 0)
    bits["hyperprior"] = report.hyperprior_bits / static_cast<double>(report.hyperprior_symbols);
  return {{"codec", codec_name(report.profile)},
          {"bytes", report.total_bytes},
          {"estimated_bytes", report.estimated_bytes()},
          {"anchors", report.anchors},
          {"dropped_anchors", report.dropped},
          {"live_offsets", report.unmasked_offsets},
          {"bits_per_scalar", std::move(bits)},
          {"clamped", report.clamped},
          {"sections", std::move(sections)}};
}

}  // namespace tool
