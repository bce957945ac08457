// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Rate-distortion curves of codecs over lambda. A point is a training and its compressed file, measured from the file;
// codecs that code the same training (HAC-plus that of HAC) share it.
// Codecs are compared by the Bjontegaard delta (compmark/metric/bd_rate.hpp) of their best points: a point is left out
// if another of the same codec has no more bytes and no less quality. That happens soon with photographs of changing
// brightness.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../compmark/plain_page.hpp"
#include "cell.hpp"
#include "compmark/app/recipe_names.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/metric/bd_rate.hpp"

namespace fidelity {

/// A scene, a codec and a lambda, which is that of the settings.
[[nodiscard]] inline std::string curve_name(const Cell& cell, const Settings& settings) {
  return cell.scene.name + "_" + cell.codec + "_" + number_text(settings.rate_lambda);
}
/// The training whose model a point's file has: HAC-plus codes what was trained for HAC.
[[nodiscard]] inline Cell training_of(const Cell& cell) { return {cell.scene, compmark::trained_codec(cell.codec)}; }
[[nodiscard]] inline nlohmann::ordered_json curve_settings_json(const Cell& cell, const Settings& settings) {
  nlohmann::ordered_json json = settings_json(cell, settings);
  json["schema"] = "compmark.rate-distortion-cell.1";
  for (const char* of_the_mark : {"bits", "steps", "regions"}) json.erase(of_the_mark);
  return json;
}

/// A finished training of one lambda, as its results.json has it.
struct CurvePoint {
  Scene scene;
  std::string codec;
  double lambda = 0;
  double trained_psnr = 0;      ///< of the model before it was compressed, mean over the test views
  double psnr = 0, ssim = 0;    ///< of the file
  std::optional<double> lpips;  ///< AlexNet
  double bytes = 0;             ///< all of them: networks, settings and the test views' cameras too
  double seconds = 0;           ///< of the training
  std::optional<double> encode_seconds, decode_seconds;  ///< of the file, as they were when it was made
  std::size_t anchors = 0, views = 0;
};

[[nodiscard]] inline Result<CurvePoint> read_curve_point(const Cell& cell, const Settings& settings,
                                                         const fs::path& folder) {
  const fs::path file = folder / "results.json";
  const Result<nlohmann::json> json = compmark::read_json(file);
  if (!json) return json.error();
  CurvePoint point;
  point.scene = cell.scene;
  point.codec = cell.codec;
  point.lambda = settings.rate_lambda;
  try {
    const nlohmann::json &coded = json->at("compressed"), &test = coded.at("test");
    point.trained_psnr = json->at("test").at("psnr").get<double>();
    point.psnr = test.at("psnr").get<double>();
    point.ssim = test.at("ssim").get<double>();
    if (const auto lpips = test.find("lpips_alex"); lpips != test.end() && lpips->is_number())
      point.lpips = lpips->get<double>();
    point.bytes = coded.at("bytes").get<double>();
    point.anchors = coded.at("anchors").get<std::size_t>();
    point.views = test.at("views").get<std::size_t>();
    point.seconds = json->at("train_seconds").get<double>();
    const auto timed = [&](const char* name, std::optional<double>& seconds) {
      if (coded.contains(name)) seconds = coded.at(name).get<double>();
    };
    timed("encode_seconds", point.encode_seconds);
    timed("decode_seconds", point.decode_seconds);
  } catch (const nlohmann::json::exception& problem) {
    return Error{ErrorKind::malformed,
                 file.string(),
                 {},
                 std::string("does not say what it should: ") + problem.what(),
                 "remove the folder to train again"};
  }
  return point;
}

/// A codec against another on one scene: BD-rate at equal PSNR and at equal SSIM, BD-PSNR at equal bytes.
struct CurveDelta {
  std::string scene, reference, tested;
  std::optional<compmark::BdDelta> rate_psnr, psnr, rate_ssim;
  std::vector<std::string> beaten;  ///< points that were left out, with the quality and by which lambda they are beaten
  std::string problem;              ///< why the first of them that is not there is not
};

/// The points of a codec on a scene, by rising bytes.
[[nodiscard]] inline std::vector<const CurvePoint*> points_of(const std::vector<CurvePoint>& points,
                                                              const std::string& scene, const std::string& codec) {
  std::vector<const CurvePoint*> own;
  for (const CurvePoint& point : points) {
    if (point.scene.name == scene && point.codec == codec) own.push_back(&point);
  }
  std::stable_sort(own.begin(), own.end(),
                   [](const CurvePoint* a, const CurvePoint* b) { return a->bytes < b->bytes; });
  return own;
}

/// The curve of a codec on a scene, with the quality that `quality` says of a point, by rising bytes. Points that
/// another one beats, with no more bytes and no less quality, are told to `beaten` (point, by which) instead.
template <class Quality, class Beaten>
[[nodiscard]] std::vector<compmark::RatePoint> front_of(const std::vector<CurvePoint>& points, const std::string& scene,
                                                        const std::string& codec, Quality&& quality, Beaten&& beaten) {
  std::vector<const CurvePoint*> own = points_of(points, scene, codec);
  std::stable_sort(own.begin(), own.end(), [&](const CurvePoint* a, const CurvePoint* b) {
    return a->bytes != b->bytes ? a->bytes < b->bytes : quality(*a) > quality(*b);
  });
  std::vector<compmark::RatePoint> front;
  const CurvePoint* best = nullptr;
  for (const CurvePoint* point : own) {
    if (best != nullptr && !(quality(*point) > quality(*best))) {
      beaten(*point, *best);
      continue;
    }
    front.push_back({point->bytes, quality(*point)});
    best = point;
  }
  return front;
}

/// In the order of the points.
[[nodiscard]] inline std::vector<std::string> scene_names(const std::vector<CurvePoint>& points) {
  std::vector<std::string> names;
  for (const CurvePoint& point : points) {
    if (std::find(names.begin(), names.end(), point.scene.name) == names.end()) names.push_back(point.scene.name);
  }
  return names;
}

/// `tested` against `reference` on a scene, by what no other point of theirs beats.
[[nodiscard]] inline CurveDelta curve_delta(const std::vector<CurvePoint>& points, const std::string& scene,
                                            const std::string& reference, const std::string& tested) {
  const auto psnr = [](const CurvePoint& point) { return point.psnr; };
  const auto ssim = [](const CurvePoint& point) { return point.ssim; };
  CurveDelta delta{scene, reference, tested, {}, {}, {}, {}, {}};
  const auto keep = [&](const char* name, Result<compmark::BdDelta> found, std::optional<compmark::BdDelta>& to) {
    if (found)
      to = *found;
    else if (delta.problem.empty())
      delta.problem = std::string(name) + ": " + found.error().line();
  };
  const auto front = [&](const std::string& codec, const char* name, auto&& quality) {
    return front_of(points, scene, codec, quality, [&](const CurvePoint& point, const CurvePoint& better) {
      delta.beaten.push_back(tool::format_text("%s %g by %g (%s)", codec.c_str(), point.lambda, better.lambda, name));
    });
  };
  const auto of_reference = front(reference, "PSNR", psnr), of_tested = front(tested, "PSNR", psnr);
  keep("BD-rate (PSNR)", compmark::bd_rate(of_reference, of_tested), delta.rate_psnr);
  keep("BD-PSNR", compmark::bd_quality(of_reference, of_tested), delta.psnr);
  const auto by_ssim = front(reference, "SSIM", ssim), tested_by_ssim = front(tested, "SSIM", ssim);
  keep("BD-rate (SSIM)", compmark::bd_rate(by_ssim, tested_by_ssim), delta.rate_ssim);
  return delta;
}
/// Every codec against each one before it in `codecs`, whichever points are there, scene by scene, by what no other
/// point of theirs beats: all against the first, then those that follow the second against that, and so on.
[[nodiscard]] inline std::vector<CurveDelta> curve_deltas(const std::vector<CurvePoint>& points,
                                                          const std::vector<std::string>& codecs) {
  std::vector<CurveDelta> deltas;
  for (const std::string& scene : scene_names(points)) {
    for (std::size_t r = 0; r < codecs.size(); ++r) {
      for (std::size_t c = r + 1; c < codecs.size(); ++c)
        deltas.push_back(curve_delta(points, scene, codecs[r], codecs[c]));
    }
  }
  return deltas;
}

[[nodiscard]] inline tool::Table curve_table(const std::vector<CurvePoint>& points) {
  tool::Table table;
  table.columns = {"scene, codec",   "lambda",  "PSNR, dB", "SSIM",    "LPIPS-Alex", "bytes",
                   "as trained, dB", "anchors", "views",    "minutes", "encode, s",  "decode, s"};
  const auto seconds = [](const std::optional<double>& value) {
    return value ? tool::format_text("%.2f", *value) : std::string("–");
  };
  for (const CurvePoint& point : points) {
    table.rows.push_back({point.scene.name + ", " + point.codec, tool::format_text("%g", point.lambda),
                          tool::format_text("%.2f", point.psnr), tool::format_text("%.4f", point.ssim),
                          point.lpips ? tool::format_text("%.4f", *point.lpips) : std::string("–"),
                          tool::format_text("%.0f", point.bytes), tool::format_text("%.2f", point.trained_psnr),
                          std::to_string(point.anchors), std::to_string(point.views),
                          tool::format_text("%.1f", point.seconds / 60), seconds(point.encode_seconds),
                          seconds(point.decode_seconds)});
  }
  return table;
}

[[nodiscard]] inline tool::Table delta_table(const std::vector<CurveDelta>& deltas) {
  tool::Table table;
  table.columns = {"scene",    "BD-rate (PSNR)", "over, dB",         "BD-PSNR",
                   "over, kB", "BD-rate (SSIM)", "beaten, left out", "not there"};
  const auto words = [](const std::vector<std::string>& list) {
    std::string text;
    for (const std::string& word : list) text += (text.empty() ? "" : ", ") + word;
    return text;
  };
  const auto percent = [](const std::optional<compmark::BdDelta>& delta) {
    return delta ? tool::format_text("%+.1f %%", 100 * delta->delta) : std::string("–");
  };
  for (const CurveDelta& delta : deltas) {
    const std::optional<compmark::BdDelta>&rate = delta.rate_psnr, &psnr = delta.psnr;
    table.rows.push_back({delta.scene + ": " + delta.tested + " against " + delta.reference, percent(rate),
                          rate ? tool::format_text("%.2f to %.2f", rate->from, rate->to) : std::string("–"),
                          psnr ? tool::format_text("%+.2f dB", psnr->delta) : std::string("–"),
                          psnr ? tool::format_text("%.0f to %.0f", psnr->from / 1e3, psnr->to / 1e3) : std::string("–"),
                          percent(delta.rate_ssim), words(delta.beaten), delta.problem});
  }
  return table;
}

/// PSNR and SSIM over bytes, a plot a scene.
[[nodiscard]] inline std::vector<tool::Plot> curve_plots(const std::vector<CurvePoint>& points,
                                                         const std::vector<std::string>& codecs) {
  std::vector<tool::Plot> plots;
  for (const std::string& scene : scene_names(points)) {
    const auto plot = [&](const char* title, const char* label, auto&& quality) {
      tool::Plot made{
          .title = scene + ": " + title, .x_label = "kB of the file", .y_label = label, .series = {}, .log_x = true};
      for (std::size_t c = 0; c < codecs.size(); ++c) {
        const std::string& codec = codecs[c];
        tool::PlotSeries series{.label = codec, .points = {}, .names = {}, .color = static_cast<int>(c), .dots = true};
        for (const CurvePoint* point : points_of(points, scene, codec)) {
          series.points.push_back({point->bytes / 1e3, quality(*point)});
          series.names.push_back(tool::format_text("%g", point->lambda));
        }
        if (!series.points.empty()) made.series.push_back(std::move(series));
      }
      plots.push_back(std::move(made));
    };
    plot("PSNR of the file, by lambda", "dB", [](const CurvePoint& point) { return point.psnr; });
    plot("SSIM of the file, by lambda", "SSIM", [](const CurvePoint& point) { return point.ssim; });
  }
  return plots;
}

[[nodiscard]] inline nlohmann::ordered_json curve_json(const Settings& settings, const std::vector<CurvePoint>& points,
                                                       const std::vector<std::string>& codecs) {
  nlohmann::ordered_json json = {{"schema", "compmark.rate-distortion.1"},
                                 {"iterations", settings.iterations},
                                 {"train", words_that_count(settings.extra)},
                                 {"points", nlohmann::ordered_json::array()},
                                 {"bd", nlohmann::ordered_json::array()}};
  for (const CurvePoint& point : points) {
    json["points"].push_back({{"scene", point.scene.name},
                              {"downscale", point.scene.downscale},
                              {"codec", point.codec},
                              {"lambda", point.lambda},
                              {"psnr", point.psnr},
                              {"ssim", point.ssim},
                              {"bytes", point.bytes},
                              {"psnr_as_trained", point.trained_psnr},
                              {"anchors", point.anchors},
                              {"views", point.views},
                              {"train_seconds", point.seconds}});
    nlohmann::ordered_json& one = json["points"].back();
    if (point.lpips) one["lpips_alex"] = *point.lpips;
    if (point.encode_seconds) one["encode_seconds"] = *point.encode_seconds;
    if (point.decode_seconds) one["decode_seconds"] = *point.decode_seconds;
  }
  for (const CurveDelta& delta : curve_deltas(points, codecs)) {
    nlohmann::ordered_json one = {{"scene", delta.scene}, {"reference", delta.reference}, {"tested", delta.tested}};
    const auto add = [&](const char* name, const std::optional<compmark::BdDelta>& found) {
      if (found) one[name] = {{"delta", found->delta}, {"from", found->from}, {"to", found->to}};
    };
    add("bd_rate_psnr", delta.rate_psnr);
    add("bd_psnr", delta.psnr);
    add("bd_rate_ssim", delta.rate_ssim);
    if (!delta.beaten.empty()) one["beaten"] = delta.beaten;
    if (!delta.problem.empty()) one["problem"] = delta.problem;
    json["bd"].push_back(std::move(one));
  }
  return json;
}

}  // namespace fidelity
