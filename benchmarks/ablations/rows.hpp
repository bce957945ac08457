// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The rows of the paper's ablation tables (docs/spec/method.md, 6: T3 to T6) as configurations of one training, and
// what the paper measured for each. Rows that are the same configuration are one: "full" stands in every table. Cost:
// none.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/watermark/embed/residual.hpp"

namespace ablation {

/// One training. Everything is in by default, as the method has it.
struct Row {
  std::string name;
  compmark::AnchorAttribute target = compmark::AnchorAttribute::feature;
  int bits = 48;
  bool residual = true;  ///< f' trains; else the attribute alone carries the message
  bool growing = true;   ///< FAG: frequency loss, and growing where it says so
  bool noise =
      true;  ///< QDL: attributes carry the noise of the quantizer's learned step; else the rate is a loss all the same
  bool hsv = true;      ///< the loss of saturated colours
  bool message = true;  ///< false: the unmarked counterpart
};

/// Accuracy in percent and PSNR in dB as published.
struct Published {
  double accuracy = 0;
  std::optional<double> psnr;
};

/// A line of a table: which run, what it is called there, what the paper has.
struct Line {
  std::string row, title;
  Published paper;
};

struct TableOfPaper {
  std::string name, title, source;
  std::string reference;  ///< the run that the others are compared with
  bool after_compression = true;
  std::vector<Line> lines;
};

inline constexpr std::string_view unmarked_name = "unmarked";
inline constexpr std::string_view full_name = "full";

/// Every configuration once, the unmarked one first: what the others lose is told against it.
[[nodiscard]] inline std::vector<Row> all_rows() {
  using compmark::AnchorAttribute;
  Row unmarked{.name = std::string(unmarked_name)}, full{.name = std::string(full_name)};
  unmarked.message = false;
  std::vector<Row> rows{unmarked, full};
  const auto changed = [&](const char* name, auto&& change) {
    Row row = full;
    row.name = name;
    change(row);
    rows.push_back(row);
  };
  changed("position", [](Row& r) { r.target = AnchorAttribute::position; });
  changed("scaling", [](Row& r) { r.target = AnchorAttribute::scaling; });
  changed("offset", [](Row& r) { r.target = AnchorAttribute::offset; });
  changed("no_residual", [](Row& r) { r.residual = false; });
  changed("no_qdl", [](Row& r) { r.noise = false; });
  changed("no_fag", [](Row& r) { r.growing = false; });
  changed("no_hsv", [](Row& r) { r.hsv = false; });
  changed("no_component", [](Row& r) { r.noise = r.growing = r.hsv = false; });
  changed("bits_32", [](Row& r) { r.bits = 32; });
  changed("bits_64", [](Row& r) { r.bits = 64; });
  return rows;
}

/// Inside HAC where the paper has both codecs; T6 is of ContextGS and T3 the mean over both, as it has nothing
/// else.
[[nodiscard]] inline std::vector<TableOfPaper> tables_of_paper() {
  return {
      {"T4",
       "target attribute",
       "HAC, 48 bits, after compression",
       "full",
       true,
       {{"position", "position", {67.91, 12.05}},
        {"scaling", "scaling", {65.06, 19.35}},
        {"offset", "offsets", {94.88, 24.61}},
        {"full", "feature (the method)", {95.92, 27.65}}}},
      {"T5",
       "components",
       "HAC, 48 bits, after compression",
       "full",
       true,
       {{"no_component", "none of the three", {90.67, 26.44}},
        {"no_fag", "without FAG", {93.95, 27.54}},
        {"no_qdl", "without QDL", {90.75, 26.75}},
        {"no_hsv", "without HSV", {92.57, 27.49}},
        {"full", "all three (the method)", {95.92, 27.65}}}},
      {"T6",
       "the residual f'",
       "ContextGS, 48 bits, after compression",
       "full",
       true,
       {{"no_residual", "without f'", {92.94, 26.79}}, {"full", "with f' (the method)", {94.03, 27.55}}}},
      {"T3",
       "capacity",
       "mean over HAC and ContextGS, before compression; no PSNR is given",
       "full",
       false,
       {{"bits_32", "32 bits", {96.52, {}}}, {"full", "48 bits", {95.16, {}}}, {"bits_64", "64 bits", {91.29, {}}}}}};
}

}  // namespace ablation
