// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Point clouds with a few points anywhere, given to the tool: the number that is left out is said, and the run is the one without them, in its
// first loss and in the size of its file. And clouds for which there is no memory: refused before it is taken, with a remedy that works.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "support/scene_files.hpp"
#include "tool/ring_capture.hpp"
#include "tool/running.hpp"

namespace outliers_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::Outcome;
using testing::plain;
using testing::tool;
using Points = std::vector<std::array<double, 3>>;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-outliers-test");
  return folder.path;
}
fs::path place() {
  static int count = 0;
  return scratch() / std::to_string(count++);
}

/// 300 points of a cube, no two of them equally far apart.
Points cube() {
  Points points;
  const Random random(4, 0, random_stage("test/tool outliers"));
  for (std::size_t i = 0; i < 300; ++i) {
    points.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) points.back()[c] = 2 * random.uniform(3 * i + c) - 1;
  }
  return points;
}
/// Binary, so that any number can be written.
fs::path capture(
    const Points& points, const std::function<void(ColmapModel&)>& change = [](ColmapModel&) {}) {
  const fs::path root = place();
  ColmapModel model = testing::ring_model(plain);
  model.points.clear();
  for (std::size_t i = 0; i < points.size(); ++i) model.points[i + 1] = {points[i], {100, 120, 140}};
  change(model);
  testing::put_colmap_binary(root / "sparse/0", model);
  for (std::size_t i = 0; i < testing::photographs; ++i) testing::put_photograph(root / "images" / plain(i), i);
  return root;
}

struct Run {
  Outcome outcome;
  double first_loss = std::numeric_limits<double>::quiet_NaN(), psnr = 0;
  std::uintmax_t bytes = 0;  ///< of the compressed file
  fs::path out;
};
Run run(const fs::path& data, const std::string& more, const std::string& before = {}) {
  Run result;
  result.out = place();
  result.outcome =
      tool("train --threads 1 --data " + data.string() + " --out " + result.out.string() + " " + more, before);
  if (result.outcome.code != 0) return result;
  const std::string log = testing::text_of(result.out / "log.jsonl");
  const nlohmann::json first = nlohmann::json::parse(log.substr(0, log.find('\n')));
  if (first["loss"].is_number()) result.first_loss = first["loss"].get<double>();
  result.psnr = testing::json_of(result.out / "results.json")["test"]["psnr"].get<double>();
  if (fs::exists(result.out / "model.cmk")) result.bytes = fs::file_size(result.out / "model.cmk");
  return result;
}
bool has(const Run& run, const std::string& words) { return run.outcome.text.find(words) != std::string::npos; }

}  // namespace

TEST_CASE("tool/outliers: points anywhere are left out with their number, and the run is the one without them") {
  const std::string options = "--codec hac --iterations 40";
  const Run clean = run(capture(cube()), options);
  REQUIRE(clean.outcome.code == 0);
  REQUIRE(clean.bytes > 0);
  CHECK(std::isfinite(clean.first_loss));
  CHECK_FALSE(has(clean, "warning"));
  constexpr double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  struct Far {
    double value;
    std::size_t count;
    const char* words;
  };
  for (const Far& far :
       {Far{1e5, 1, "1 of 301 points lies"}, Far{-1e5, 3, "3 of 303 points lie"}, Far{1e30, 2, "2 of 302 points lie"},
        Far{inf, 2, "2 points that are not finite"}, Far{nan, 30, "30 points that are not finite"},
        Far{1e300, 1, "1 points that are not finite"}}) {
    CAPTURE(far.words);
    Points points = cube();
    for (std::size_t i = 0; i < far.count; ++i)
      points.insert(points.begin() + static_cast<std::ptrdiff_t>(7 * i), {far.value, far.value / 2, 0});
    const Run with = run(capture(points), options);
    INFO(with.outcome.text);
    REQUIRE(with.outcome.code == 0);
    CHECK(has(with, far.words));
    CHECK(has(with, "left out"));
    CHECK(with.first_loss == clean.first_loss);
    CHECK(with.bytes == clean.bytes);
    CHECK(with.psnr == clean.psnr);
  }
  // A far camera does not count for the scene's size; its photograph still does.
  const Run camera =
      run(capture(cube(), [](ColmapModel& model) { model.images.rbegin()->second.translation[2] += 1e5; }), options);
  INFO(camera.outcome.text);
  REQUIRE(camera.outcome.code == 0);
  CHECK(has(camera, "the camera of \"v11.png\" stands"));
  CHECK_FALSE(has(camera, "far_field"));  // nor does it choose the recipe
  CHECK(camera.first_loss == doctest::Approx(clean.first_loss).epsilon(0.05));
  CHECK(static_cast<double>(camera.bytes) == doctest::Approx(static_cast<double>(clean.bytes)).epsilon(0.03));
  // The control: twice the cloud is another run.
  Points twice = cube();
  for (const auto& p : cube()) twice.push_back({p[0] + 0.001, p[1] + 0.013, p[2]});
  const Run other = run(capture(twice), options);
  CHECK(static_cast<double>(other.bytes) > 1.1 * static_cast<double>(clean.bytes));
}

TEST_CASE("tool/outliers: clouds that say nothing are said, in any format") {
  const auto said = [](const Points& points, const std::string& words) {
    const Run result = run(capture(points), "--iterations 2");
    INFO(result.outcome.text);
    CHECK(result.outcome.code == 0);
    CHECK(has(result, words));
    CHECK(std::isfinite(result.first_loss));
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  said({}, "there are no points to start from, random ones are used");
  said(Points(40, {0.3, 0.3, 0.3}), "all 40 points are in one place");
  said(Points(40, {1e-30, 0, 0}), "all 40 points are in one place");
  said(Points(40, {nan, 0, 0}), "there are no usable points to start from");
  Points behind = cube();
  for (auto& p : behind) p[2] += 100;
  said(behind, "12 of 12 cameras see none of the points");
  CHECK(run(capture({{0, 0, 0}, {0.5, 0, 0.5}}), "--iterations 2").outcome.code == 0);

  const fs::path root = place();
  for (std::size_t i = 0; i < testing::photographs; ++i) testing::put_photograph(root / "images" / plain(i), i);
  testing::put(root / "transforms.json",
               testing::cube_transforms(testing::ring(), R"("fl_x": 30, "w": 24, "h": 24, "ply_file_path": "p.ply")",
                                        [](std::size_t i) { return "images/" + plain(i); }));
  std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 303\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  for (const auto& p : cube())
    ply += testing::number_text(p[0]) + " " + testing::number_text(p[1]) + " " + testing::number_text(p[2]) + "\n";
  testing::put(root / "p.ply", ply + "nan 0 0\n0 inf 0\n1e6 0 0\n");
  const Run result = run(root, "--iterations 2");
  INFO(result.outcome.text);
  CHECK(result.outcome.code == 0);
  CHECK(has(result, "2 points that are not finite are left out"));
  CHECK(has(result, "1 of 301 points lies"));
}

TEST_CASE("tool/outliers: a cloud for which there is no memory is refused before it is taken, and the remedy works") {
  Points many;
  const Random random(5, 0, random_stage("test/tool many points"));
  for (std::size_t i = 0; i < 60000; ++i)
    many.push_back(
        {2 * random.uniform(3 * i) - 1, 2 * random.uniform(3 * i + 1) - 1, 2 * random.uniform(3 * i + 2) - 1});
  const fs::path data = capture(many);
  const std::string limit = "ulimit -v 200000; ";
  const Run refused = run(data, "--iterations 2", limit);
  testing::check_refused(refused.outcome,
                         {"memory", "anchors takes about", "MB are free", "--voxel-size", "--max-anchors"});
  CHECK_FALSE(fs::exists(refused.out / "model.safetensors"));
  const std::string most = "at most ";
  const std::size_t at = refused.outcome.text.find(most);
  REQUIRE(at != std::string::npos);
  const std::string anchors = std::to_string(std::stoll(refused.outcome.text.substr(at + most.size())));
  CHECK(std::stoll(anchors) < 60000);
  // By the words of the remedy; a sixth of the cube's side has at most 343 cells.
  const Run fits = run(data, "--iterations 2 --voxel-size 0.34 --max-anchors " + anchors, limit);
  INFO(fits.outcome.text);
  CHECK(fits.outcome.code == 0);
  // The limit alone is no way out, and says so.
  testing::check_refused(run(data, "--iterations 2 --max-anchors " + anchors, limit).outcome,
                         {"max_anchors", "voxel size"});
}

}  // namespace outliers_test
