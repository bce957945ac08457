// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/run/run_results.hpp>
#include <compmark/io/json_file.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "support/tool.hpp"

TEST_CASE("app/run/run_results: results.json comes back as it was written; another schema is refused") {
  using namespace compmark;
  const testing::ScratchFolder folder("compmark-run-results");
  const std::filesystem::path path = folder.path / "results.json";
  RunResults results;
  results.dataset = "lego";
  results.recipe = "hac";
  results.profile = "hac";
  results.iterations = 12;
  results.seed = 3;
  results.threads = 2;
  results.anchors = 1000;
  results.gaussians_per_view = 1.5;
  results.test = TestMetrics{30.25, 0.9, 0.125, 4, 31.0};
  results.model_sha256 = "ab";
  results.rate_lambda = 0.002;
  results.effects = {"masks"};
  results.watermark = WatermarkMetrics{0.99, 0.95, 4, 1e-9, 1e-4, 0.25, 45.0};
  results.method = "waterf";
  CompressedMetrics& coded = results.compressed.emplace();
  coded.codec = "hac";
  coded.bytes = 77;
  coded.anchors = 900;
  coded.encode_seconds = 1.5;
  coded.decode_seconds = 0.25;
  coded.test = TestMetrics{29.5, 0.8, 0.25, 4, {}};
  coded.watermark = WatermarkMetrics{0.98, 0.9, 4, 1e-8, 1e-3, {}, 44.0};
  coded.sections = {{"networks", 50}, {"streams", 27}};
  results.identity = R"({"settings":{"seed":3}})";
  REQUIRE(write_results(path, results).ok());
  const Result<RunResults> read = read_results(path);
  REQUIRE(read.ok());
  CHECK(read->dataset == "lego");
  CHECK(read->test->psnr == 30.25);
  CHECK(read->test->lpips_alex == 0.125);
  CHECK(read->test->psnr_colour_fitted == 31.0);
  CHECK(read->rate_lambda == 0.002);
  CHECK(read->effects == results.effects);
  CHECK(read->watermark->p_value == 1e-9);
  CHECK(read->watermark->psnr_marked_vs_unmarked == 45.0);
  REQUIRE(read->compressed.has_value());
  CHECK(read->compressed->codec == "hac");
  CHECK(read->compressed->bytes == 77);
  CHECK(read->compressed->anchors == 900);
  CHECK(read->compressed->encode_seconds == 1.5);
  CHECK(read->compressed->decode_seconds == 0.25);
  CHECK(read->compressed->test.psnr == 29.5);
  CHECK(read->compressed->test.lpips_alex == 0.25);
  CHECK(!read->compressed->test.psnr_colour_fitted);
  REQUIRE(read->compressed->watermark.has_value());
  CHECK(read->compressed->watermark->min == 0.9);
  CHECK(!read->compressed->watermark->psnr_cost_vs_unmarked);
  CHECK(read->compressed->watermark->psnr_marked_vs_unmarked == 44.0);
  CHECK(read->compressed->sections == coded.sections);
  CHECK(read->method == "waterf");
  CHECK(nlohmann::json::parse(read->identity) == nlohmann::json::parse(results.identity));

  // Where there are no test views, none of the two has figures of a test.
  RunResults without = results;
  without.test.reset();
  const std::filesystem::path other = folder.path / "without.json";
  REQUIRE(write_results(other, without).ok());
  const auto null = *read_json<nlohmann::json>(other);
  CHECK(null["test"].is_null());
  CHECK(null["compressed"]["test"].is_null());
  REQUIRE(read_results(other).ok());

  auto json = *read_json<nlohmann::ordered_json>(path);
  json["compressed"]["sections"]["networks"] = "many";
  REQUIRE(write_json(path, json).ok());
  CHECK(read_results(path).error().field == "compressed.sections.networks");
  json["compressed"]["sections"]["networks"] = 50;
  json["schema"] = 2;
  REQUIRE(write_json(path, json).ok());
  CHECK(read_results(path).error().field == "schema");
  json["schema"] = 1;
  json.erase("anchors");
  REQUIRE(write_json(path, json).ok());
  CHECK(read_results(path).error().field.find("anchors") != std::string::npos);
  CHECK_FALSE(read_results(folder.path / "none.json").ok());
}
