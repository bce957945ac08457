// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// From finished trainings to the paper's tables: means over scenes and seeds with their spread, what is lost against
// the unmarked counterpart of the same scene and seed, and whether a row differs from the method in the direction that
// the paper says. Differences are of pairs of the same scene and seed, so that what scenes differ by does not count; a
// mean below twice its standard error says nothing, and is called so. Cost: none.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "ablations/record.hpp"
#include "ablations/rows.hpp"

namespace ablation {

/// Mean and standard deviation of a sample.
struct Spread {
  double mean = std::numeric_limits<double>::quiet_NaN(), deviation = 0;
  std::size_t count = 0;
  [[nodiscard]] double standard_error() const {
    return count > 1 ? deviation / std::sqrt(static_cast<double>(count)) : std::numeric_limits<double>::infinity();
  }
};
[[nodiscard]] inline Spread spread_of(const std::vector<double>& values) {
  Spread spread;
  spread.count = values.size();
  if (values.empty()) return spread;
  double sum = 0, squares = 0;
  for (const double v : values) sum += v;
  spread.mean = sum / static_cast<double>(values.size());
  for (const double v : values) squares += (v - spread.mean) * (v - spread.mean);
  if (values.size() > 1) spread.deviation = std::sqrt(squares / static_cast<double>(values.size() - 1));
  return spread;
}

enum class Direction { no_paper, not_run, too_close, agrees, disagrees };
[[nodiscard]] inline std::string_view direction_name(Direction direction) {
  switch (direction) {
    case Direction::no_paper:
      return "";
    case Direction::not_run:
      return "not run";
    case Direction::too_close:
      return "too close";
    case Direction::agrees:
      return "agrees";
    case Direction::disagrees:
      break;
  }
  return "DISAGREES";
}

/// `paper`: row minus reference as published. `measured`: the same, a value a pair.
[[nodiscard]] inline Direction direction_of(std::optional<double> paper, const std::vector<double>& measured) {
  if (!paper || *paper == 0) return Direction::no_paper;
  if (measured.empty()) return Direction::not_run;
  const Spread difference = spread_of(measured);
  // One pair has no error to compare with, and no difference at all is none.
  if (difference.mean == 0 || (difference.count > 1 && std::abs(difference.mean) < 2 * difference.standard_error()))
    return Direction::too_close;
  return (difference.mean > 0) == (*paper > 0) ? Direction::agrees : Direction::disagrees;
}

/// A line of a table, filled.
struct FilledLine {
  Line line;
  bool reference = false;
  Spread accuracy_before, accuracy_after, psnr_before, psnr_after, ssim_before, ssim_after;
  Spread lost_before, lost_after;  ///< PSNR of the counterpart minus that of the row
  Spread bytes, anchors;
  double worst_before = 1, worst_after = 1;     ///< the worst view of all runs
  Spread accuracy_difference, psnr_difference;  ///< from the reference, where the paper measures
  Direction accuracy_direction = Direction::no_paper, psnr_direction = Direction::no_paper;
};
struct FilledTable {
  TableOfPaper table;
  std::vector<FilledLine> lines;
};

namespace detail {
[[nodiscard]] inline const Record* partner(const std::vector<Record>& records, const Record& of, std::string_view row) {
  const auto found = std::find_if(records.begin(), records.end(), [&](const Record& r) {
    return r.row == row && r.scene == of.scene && r.seed == of.seed;
  });
  return found == records.end() ? nullptr : &*found;
}
}  // namespace detail

[[nodiscard]] inline FilledTable fill(const TableOfPaper& table, const std::vector<Record>& records) {
  FilledTable filled{table, {}};
  const auto reference = std::find_if(table.lines.begin(), table.lines.end(),
                                      [&](const Line& line) { return line.row == table.reference; });
  for (const Line& line : table.lines) {
    FilledLine out;
    out.line = line;
    out.reference = line.row == table.reference;
    std::vector<double> lost_before, lost_after, accuracy_difference, psnr_difference;
    std::vector<const Record*> own;
    for (const Record& record : records) {
      if (record.row != line.row) continue;
      own.push_back(&record);
      out.worst_before = std::min(out.worst_before, record.before.worst);
      out.worst_after = std::min(out.worst_after, record.after.worst);
      if (const Record* const counterpart = detail::partner(records, record, unmarked_name)) {
        lost_before.push_back(counterpart->before.psnr - record.before.psnr);
        lost_after.push_back(counterpart->after.psnr - record.after.psnr);
      }
      if (const Record* const other = detail::partner(records, record, table.reference); other && !out.reference) {
        const Measured& a = table.after_compression ? record.after : record.before;
        const Measured& b = table.after_compression ? other->after : other->before;
        accuracy_difference.push_back(100 * (a.accuracy - b.accuracy));
        psnr_difference.push_back(a.psnr - b.psnr);
      }
    }
    const auto over = [&](const std::function<double(const Record&)>& value) {
      std::vector<double> values;
      for (const Record* const record : own) values.push_back(value(*record));
      return spread_of(values);
    };
    out.accuracy_before = over([](const Record& r) { return r.before.accuracy; });
    out.accuracy_after = over([](const Record& r) { return r.after.accuracy; });
    out.psnr_before = over([](const Record& r) { return r.before.psnr; });
    out.psnr_after = over([](const Record& r) { return r.after.psnr; });
    out.ssim_before = over([](const Record& r) { return r.before.ssim; });
    out.ssim_after = over([](const Record& r) { return r.after.ssim; });
    out.bytes = over([](const Record& r) { return static_cast<double>(r.file_bytes); });
    out.anchors = over([](const Record& r) { return static_cast<double>(r.anchors); });
    out.lost_before = spread_of(lost_before);
    out.lost_after = spread_of(lost_after);
    out.accuracy_difference = spread_of(accuracy_difference);
    out.psnr_difference = spread_of(psnr_difference);
    if (!out.reference && reference != table.lines.end()) {
      out.accuracy_direction = direction_of(line.paper.accuracy - reference->paper.accuracy, accuracy_difference);
      std::optional<double> paper;
      if (line.paper.psnr && reference->paper.psnr) paper = *line.paper.psnr - *reference->paper.psnr;
      out.psnr_direction = direction_of(paper, psnr_difference);
    }
    filled.lines.push_back(std::move(out));
  }
  return filled;
}

}  // namespace ablation
