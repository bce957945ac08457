// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs the points of the page "accuracy against time, whole" (points.hpp) one after the other. Points that differ in
// the mark alone share the unmarked model and the decoder.
#pragma once

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "../compmark/plain_page.hpp"
#include "command_line.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/json_file.hpp"
#include "points.hpp"
#include "run_cell.hpp"
#include "steps.hpp"
#include "stopping.hpp"

namespace fidelity {

[[nodiscard]] inline Cell cell_of(const Scene& scene, const Point& point) {
  Cell cell{scene, point.codec};
  cell.scene.name = point.name;
  return cell;
}

[[nodiscard]] inline Settings settings_of(Settings settings, const Point& point) {
  settings.iterations = point.iterations;
  settings.rate_lambda = point.rate_lambda;
  settings.universal = !point.fits;
  settings.attacks = point_attacks();
  settings.extra.insert(settings.extra.begin(), point.words.begin(), point.words.end());
  return settings;
}

/// The files of a decoder that was fitted to a point's scene.
[[nodiscard]] inline std::vector<const char*> decoder_files(const Point& point) {
  if (!point.fits) return {};
  return {"decoder.safetensors", "decoder.json"};
}
/// Whether a point's training is over and its decoder, if it has one of its own, fitted.
[[nodiscard]] inline bool has_unmarked_model(const fs::path& folder, const Point& point) {
  const std::vector<const char*> files = decoder_files(point);
  return fs::exists(folder / "unmarked/results.json") && !fs::exists(folder / "unmarked/checkpoint.safetensors") &&
         std::all_of(files.begin(), files.end(), [&](const char* file) { return fs::exists(folder / file); });
}

/// The training and the decoder of a point with the same unmarked model, for one that has none: a training that is
/// resumed takes what is there.
[[nodiscard]] inline Result<Done> share_unmarked_model(const fs::path& from, const fs::path& to, const Point& point) {
  if (fs::exists(to / "unmarked")) return Done{};
  const HoldStop hold;
  std::error_code status;
  const fs::path partial = to / "unmarked.partial";
  fs::remove_all(partial, status);
  const auto failed = [&](const fs::path& path) {
    return Error{ErrorKind::unwritable, path.string(), {}, status.message(), "is there room on the disk?"};
  };
  fs::create_directories(to, status);
  fs::copy(from / "unmarked", partial, fs::copy_options::recursive, status);
  if (status) return failed(partial);
  for (const char* file : decoder_files(point)) {
    fs::copy_file(from / file, to / file, fs::copy_options::overwrite_existing, status);
    if (status) return failed(to / file);
  }
  fs::rename(partial, to / "unmarked", status);  // whole, or not there
  if (status) return failed(to / "unmarked");
  return Done{};
}

[[nodiscard]] inline Result<Done> write_prices(const Settings& settings, const Scene& scene,
                                               const std::vector<PricedPoint>& points) {
  const HoldStop hold;
  const tool::Table table = price_table(points);
  const std::vector<tool::Plot> plots = price_plots(points);
  const std::string head =
      scene.name + tool::format_text(
                       " at 1 / %g of its size: from photographs to a marked file, %d bits, test views read one by one "
                       "from the file. Seconds are those of the iterations and of the fit, on this machine.",
                       scene.downscale, settings.bits);
  const std::string note =
      "* No other point is as good in minutes, bytes, decibels, bits, bits after JPEG 50 and bits after the worst "
      "edit, "
      "and better in one of them.";
  if (Result<Done> r = compmark::write_json(settings.out / "tradeoff.json", price_json(scene, settings, points)); !r)
    return r;
  if (Result<Done> r =
          compmark::write_file(settings.out / "tradeoff.md", head + "\n\n" + table.markdown() + "\n" + note + "\n");
      !r)
    return r;
  return tool::write_pages(settings.out / "tradeoff.html", settings.out / "tradeoff.svg",
                           tool::html_page("Accuracy against time, whole", head, plots, note, table), plots);
}

/// Runs those of `chosen` labels (none: all) that are not finished, and writes the page after each: tradeoff.json, .md,
/// .html and .svg. Exit code 1 where a point failed, 2 where a page could not be written.
[[nodiscard]] inline RunEnd run_points(const char* program, const Settings& settings, const Scene& scene,
                                       const std::vector<std::string>& chosen, const Steps& steps) {
  const std::vector<Point> points = all_points();
  const auto folder = [&](const Point& point) { return cell_of(scene, point).folder(settings); };
  const auto same_run = [&](const Point& point) {  // what is there was made with these settings
    return is_of(cell_of(scene, point), settings_of(settings, point));
  };
  std::vector<PricedPoint> finished;
  bool failed = false, written = false;
  for (const Point& point : points) {  // of earlier commands, so that the page has them whatever becomes of this one
    const Cell cell = cell_of(scene, point);
    const Settings own = settings_of(settings, point);
    if (!is_finished(cell, own)) continue;
    if (Result<Row> row = read_row(cell, own); row) finished.push_back({point, std::move(*row)});
  }
  for (const Point& point : points) {
    if (!chosen.empty() && std::find(chosen.begin(), chosen.end(), point.label()) == chosen.end()) continue;
    const auto is_this = [&](const PricedPoint& other) { return other.point.label() == point.label(); };
    if (std::any_of(finished.begin(), finished.end(), is_this)) continue;
    const auto source = std::find_if(points.begin(), points.end(), [&](const Point& other) {
      return other.same_unmarked_model(point) && has_unmarked_model(folder(other), point) && same_run(other);
    });
    if (source != points.end()) {
      if (Result<Done> shared = share_unmarked_model(folder(*source), folder(point), point); !shared)
        return RunEnd{fail(program, shared.error()), {}};
    }
    Result<std::optional<Row>> row = finish_cell(program, cell_of(scene, point), settings_of(settings, point), steps);
    if (!row) {
      fail(program, row.error());  // the other points are worth having
      failed = true;
      continue;
    }
    if (!*row) {
      std::fprintf(stderr, "%s: stopped; the same command goes on\n", program);
      return {stopped_exit, {}};
    }
    finished.push_back({point, std::move(**row)});
    const auto place = [&](const PricedPoint& one) {
      return std::find_if(points.begin(), points.end(),
                          [&](const Point& other) { return other.label() == one.point.label(); });
    };
    std::sort(finished.begin(), finished.end(),
              [&](const PricedPoint& a, const PricedPoint& b) { return place(a) < place(b); });
    if (Result<Done> pages = write_prices(settings, scene, finished); !pages)
      return RunEnd{fail(program, pages.error()), {}};
    written = true;
  }
  RunEnd end;
  if (!finished.empty()) {
    if (!written && !failed) {  // nothing was left to run: as this version writes them
      if (Result<Done> pages = write_prices(settings, scene, finished); !pages)
        return RunEnd{fail(program, pages.error()), {}};
    }
    end.table = price_table(finished).markdown();
  }
  end.code = failed ? 1 : 0;
  return end;
}

}  // namespace fidelity
