// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/run/run_results.hpp.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "compmark/app/run/run_results.hpp"
#include "compmark/io/json_file.hpp"

namespace compmark {
namespace detail {

inline constexpr int results_schema = 1;

}  // namespace detail

COMPMARK_APP_INLINE Result<Done> write_results(const std::filesystem::path& path, const RunResults& results) {
  const auto test_json = [](const TestMetrics& t) {
    nlohmann::ordered_json test{{"psnr", t.psnr}, {"ssim", t.ssim}};
    test["lpips_alex"] = t.lpips_alex ? nlohmann::ordered_json(*t.lpips_alex) : nlohmann::ordered_json(nullptr);
    test["views"] = t.views;
    if (t.psnr_colour_fitted) test["psnr_colour_fitted"] = *t.psnr_colour_fitted;
    return test;
  };
  nlohmann::ordered_json test = nullptr;
  if (results.test) test = test_json(*results.test);
  nlohmann::ordered_json json{{"schema", detail::results_schema},
                              {"dataset", results.dataset},
                              {"recipe", results.recipe},
                              {"profile", results.profile},
                              {"iterations", results.iterations},
                              {"seed", results.seed},
                              {"threads", results.threads},
                              {"anchors", results.anchors},
                              {"gaussians_per_view", results.gaussians_per_view},
                              {"train_seconds", results.train_seconds},
                              {"peak_memory_mb", results.peak_memory_mb},
                              {"test", std::move(test)},
                              {"model_sha256", results.model_sha256},
                              {"effects", results.effects}};
  const auto add_mark = [](nlohmann::ordered_json& target, const WatermarkMetrics& m) {
    const auto or_null = [](const std::optional<double>& value) {
      return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
    };
    target["bit_accuracy"] = {{"mean", m.mean}, {"min", m.min}, {"views", m.views}};
    target["p_value"] = m.p_value;
    target["largest_view_p_value"] = m.largest_view_p_value;
    target["psnr_cost_vs_unmarked"] = or_null(m.psnr_cost_vs_unmarked);
    target["psnr_marked_vs_unmarked"] = or_null(m.psnr_marked_vs_unmarked);
  };
  if (results.revivals != 0) json["revivals"] = results.revivals;
  if (const std::optional<StepSummary>& step = results.distortion_step)
    json["distortion_step"] = {{"mean", step->mean}, {"median", step->median}};
  if (results.rate_lambda) json["rate_lambda"] = *results.rate_lambda;
  if (!results.method.empty()) json["method"] = results.method;
  if (results.watermark) add_mark(json, *results.watermark);
  if (results.compressed) {
    const CompressedMetrics& c = *results.compressed;
    nlohmann::ordered_json sections;
    for (const auto& [name, bytes] : c.sections) sections[name] = bytes;
    nlohmann::ordered_json metrics = nullptr;  // as above: training views are no test
    if (results.test) metrics = test_json(c.test);
    json["compressed"] = {{"codec", c.codec},
                          {"bytes", c.bytes},
                          {"anchors", c.anchors},
                          {"encode_seconds", c.encode_seconds},
                          {"decode_seconds", c.decode_seconds},
                          {"test", std::move(metrics)},
                          {"sections", std::move(sections)}};
    if (c.watermark) add_mark(json["compressed"], *c.watermark);
  }
  if (!results.identity.empty()) json["run"] = nlohmann::ordered_json::parse(results.identity, nullptr, false);
  return write_json(path, json);
}

COMPMARK_APP_INLINE Result<RunResults> read_results(const std::filesystem::path& path) {
  const Result<nlohmann::json> json = read_json(path);
  if (!json) return json.error();
  RunResults results;
  std::optional<Error> failure;
  const auto read = [&](const nlohmann::json& object, const char* key, auto& value, const std::string& where) {
    if (failure) return;
    auto field = json_field<std::remove_reference_t<decltype(value)>>(object, key, path.string(), where);
    if (field) {
      value = std::move(*field);
    } else {
      failure = field.error();
    }
  };
  int schema = 0;
  read(*json, "schema", schema, "");
  if (!failure && schema != detail::results_schema) {
    return Error{ErrorKind::unsupported, path.string(), "schema",
                 "is " + std::to_string(schema) + ", this program reads " + std::to_string(detail::results_schema),
                 "use the program that wrote it"};
  }
  read(*json, "dataset", results.dataset, "");
  read(*json, "recipe", results.recipe, "");
  read(*json, "profile", results.profile, "");
  read(*json, "iterations", results.iterations, "");
  read(*json, "seed", results.seed, "");
  read(*json, "threads", results.threads, "");
  read(*json, "anchors", results.anchors, "");
  read(*json, "gaussians_per_view", results.gaussians_per_view, "");
  read(*json, "train_seconds", results.train_seconds, "");
  read(*json, "peak_memory_mb", results.peak_memory_mb, "");
  read(*json, "model_sha256", results.model_sha256, "");
  if (failure) return *failure;
  const auto read_optional = [&](const nlohmann::json& object, const char* key, std::optional<double>& value,
                                 const std::string& where) {
    if (failure || !object.contains(key) || object[key].is_null()) return;
    read(object, key, value.emplace(), where);
  };
  const auto read_test = [&](const nlohmann::json& object, const std::string& where) {
    TestMetrics test;
    read(object, "psnr", test.psnr, where);
    read(object, "ssim", test.ssim, where);
    read(object, "views", test.views, where);
    read_optional(object, "lpips_alex", test.lpips_alex, where);
    read_optional(object, "psnr_colour_fitted", test.psnr_colour_fitted, where);
    return test;
  };
  const auto read_mark = [&](const nlohmann::json& object, const std::string& where) {
    WatermarkMetrics m;
    const nlohmann::json& accuracy = object["bit_accuracy"];
    const std::string at = where.empty() ? "bit_accuracy" : where + ".bit_accuracy";
    read(accuracy, "mean", m.mean, at);
    read(accuracy, "min", m.min, at);
    read(accuracy, "views", m.views, at);
    read(object, "p_value", m.p_value, where);
    read(object, "largest_view_p_value", m.largest_view_p_value, where);
    read_optional(object, "psnr_cost_vs_unmarked", m.psnr_cost_vs_unmarked, where);
    read_optional(object, "psnr_marked_vs_unmarked", m.psnr_marked_vs_unmarked, where);
    return m;
  };
  if (json->contains("test") && !(*json)["test"].is_null()) results.test = read_test((*json)["test"], "test");
  if (json->contains("effects") && (*json)["effects"].is_array()) {
    for (const nlohmann::json& effect : (*json)["effects"]) {
      if (effect.is_string()) results.effects.push_back(effect.get<std::string>());
    }
  }
  if (json->contains("revivals")) read(*json, "revivals", results.revivals, "");
  if (json->contains("distortion_step")) {
    StepSummary step;
    read((*json)["distortion_step"], "mean", step.mean, "distortion_step");
    read((*json)["distortion_step"], "median", step.median, "distortion_step");
    results.distortion_step = step;
  }
  if (json->contains("rate_lambda")) {
    double lambda = 0;
    read(*json, "rate_lambda", lambda, "");
    results.rate_lambda = lambda;
  }
  if (json->contains("method")) read(*json, "method", results.method, "");
  if (json->contains("bit_accuracy")) results.watermark = read_mark(*json, "");
  if (json->contains("compressed") && (*json)["compressed"].is_object()) {
    const nlohmann::json& object = (*json)["compressed"];
    CompressedMetrics compressed;
    read(object, "codec", compressed.codec, "compressed");
    read(object, "bytes", compressed.bytes, "compressed");
    read(object, "anchors", compressed.anchors, "compressed");
    read(object, "encode_seconds", compressed.encode_seconds, "compressed");
    read(object, "decode_seconds", compressed.decode_seconds, "compressed");
    if (object.contains("test") && !object["test"].is_null())
      compressed.test = read_test(object["test"], "compressed.test");
    if (object.contains("sections") && object["sections"].is_object()) {
      for (const auto& [name, bytes] : object["sections"].items())
        read(object["sections"], name.c_str(), compressed.sections.emplace_back(name, 0).second, "compressed.sections");
    }
    if (object.contains("bit_accuracy")) compressed.watermark = read_mark(object, "compressed");
    results.compressed = std::move(compressed);
  }
  if (json->contains("run")) results.identity = (*json)["run"].dump();
  if (failure) return *failure;
  return results;
}

}  // namespace compmark
