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
  results.compressed.emplace().bytes = 77;
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
  CHECK(read->compressed->bytes == 77);
  CHECK(read->method == "waterf");
  CHECK(nlohmann::json::parse(read->identity) == nlohmann::json::parse(results.identity));

  auto json = *read_json<nlohmann::ordered_json>(path);
  json["schema"] = 2;
  REQUIRE(write_json(path, json).ok());
  CHECK(read_results(path).error().field == "schema");
  json["schema"] = 1;
  json.erase("anchors");
  REQUIRE(write_json(path, json).ok());
  CHECK(read_results(path).error().field.find("anchors") != std::string::npos);
  CHECK_FALSE(read_results(folder.path / "none.json").ok());
}
