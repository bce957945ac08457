// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/text_bytes.hpp"

#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

std::string contents(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

std::string wide(const std::string& text, bool mark) {
  std::string result = mark ? "\xFF\xFE" : "";
  for (const char c : text) (result += c) += '\0';
  return result;
}

}  // namespace

TEST_CASE("scene/text_bytes: marks, line ends and zeros of any editor change nothing; UTF-16 is named") {
  const TemporaryFolder folder;
  const ColmapModel model = small_colmap_model();
  const std::filesystem::path sparse = folder.path() / "colmap/sparse/0";
  put_colmap_text(sparse, model);
  put_colmap_images(folder.path() / "colmap/images", model);
  put_blender(folder.path() / "blender");
  const std::filesystem::path files[] = {sparse / "cameras.txt", sparse / "images.txt", sparse / "points3D.txt",
                                         folder.path() / "blender/transforms_train.json",
                                         folder.path() / "blender/transforms_test.json"};
  const auto open = [&](const std::filesystem::path& file) {
    return open_dataset(folder.path() / (file.extension() == ".txt" ? "colmap" : "blender"), {});
  };
  for (const std::filesystem::path& file : files) {
    CAPTURE(file.string());
    const std::string text = contents(file);
    const Result<Dataset> plain = open(file);
    REQUIRE(plain.ok());
    const std::string unix_text = replaced(text, "\r\n", "\n");
    for (const std::string& changed : {"\xEF\xBB\xBF" + text, text + std::string(7, '\0'),
                                       replaced(unix_text, "\n", "\r\n"), replaced(unix_text, "\n", "\r")}) {
      put(file, changed);
      const Result<Dataset> dataset = open(file);
      REQUIRE(dataset.ok());
      REQUIRE(dataset->views.size() == plain->views.size());
      CHECK(dataset->warnings == plain->warnings);
      CHECK(dataset->points.position == plain->points.position);
      for (std::size_t i = 0; i < dataset->views.size(); ++i) {
        CHECK(dataset->views[i].name == plain->views[i].name);
        CHECK(dataset->views[i].camera.fx == plain->views[i].camera.fx);
        CHECK(dataset->views[i].camera.center_world == plain->views[i].camera.center_world);
      }
    }
    for (const bool mark : {true, false}) {
      put(file, wide(text, mark));
      const Result<Dataset> dataset = open(file);
      REQUIRE(!dataset.ok());
      CHECK(names(dataset.error(), file.filename().string(), "", "UTF-8"));
    }
    put(file, text);
  }
}

TEST_CASE("scene/text_bytes: a PLY file of any editor holds the same points") {
  const TemporaryFolder folder;
  const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
      "0 0.5 1\n1 -2 3\n";
  for (const std::string& written : {text, "\xEF\xBB\xBF" + text, replaced(text, "\n", "\r\n"),
                                     replaced(text, "\n", "\r"), "\xEF\xBB\xBF" + replaced(text, "\n", "\r")}) {
    put(folder.path() / "points.ply", written);
    const Result<PointCloud> points = read_point_file(folder.path() / "points.ply");
    REQUIRE(points.ok());
    CHECK(points->position == std::vector<std::array<float, 3>>{{0, 0.5f, 1}, {1, -2, 3}});
  }
}

TEST_CASE("scene/colmap_text: images without their second lines are all there; what is neither is named by its line") {
  const TemporaryFolder folder;
  ColmapModel model = small_colmap_model();
  put_colmap_text(folder.path(), model);
  const auto read = [&](const std::string& images) {
    put(folder.path() / "images.txt", images);
    return read_colmap_text(folder.path(), {true});
  };
  const std::string one = "1 1 0 0 0 0 0 4 3 a.png\n", two = "2 1 0 0 0 0 0 4 3 b 2.png\n",
                    points = "1.5 2 -1 3 4.5 11\n";
  for (const std::string& images :
       {one + two, one + "\n" + two, one + points + two, one + points + two + points, "# a\n" + one + "# b\n" + two,
        one + "\n\n" + two + "\n", one + "   \r\n" + two, one + two + points}) {
    CAPTURE(images);
    const Result<ColmapModel> found = read(images);
    REQUIRE(found.ok());
    REQUIRE(found->images.size() == 2);
    CHECK(found->images.at(2).name == "b 2.png");
    CHECK(detail::registered_images(folder.path()) == 2);
    CHECK(found->images.at(1).observations.size() == (images.find(one + points) == 0 ? 2 : 0));
  }
  // A name that is a number is no feature; nor does a camera's id make one of a line that describes an image.
  REQUIRE(read("1 1 0 0 0 0 0 4 3 000\n2 1 0 0 0 0 0 4 3 001\n").ok());
  CHECK(read_colmap_text(folder.path())->images.size() == 2);
  for (const char* bad : {"1.5 2\n", "1.5 2 x\n", "1.5 2 3.5\n", "words\n", "2 1 0 0 0 0 0 4 b.png\n"}) {
    CAPTURE(bad);
    const Result<ColmapModel> found = read(one + bad);
    REQUIRE(!found.ok());
    CHECK(names(found.error(), "images.txt", "line 2", "export"));
    CHECK(!read_colmap_text(folder.path()).ok());  // whether or not features are asked for
  }
}

TEST_CASE(
    "scene/text_bytes: a large file that does not begin as a text is refused at its beginning, a large text is read") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "transforms.json";
  const auto grown = [&](const std::string& begin) {
    put(path, begin);
    std::filesystem::resize_file(path, std::uintmax_t{300} << 20);  // zeros behind it
    return detail::read_text(path).error();
  };
  const std::size_t before = peak_memory();
  CHECK(grown("").problem.find("unknown kind, not a text") != std::string::npos);
  CHECK(grown("\x89PNG\r\n\x1a\n").problem.find("PNG image, not a text") != std::string::npos);
  CHECK(grown("\xFF\xFE{").problem.find("UTF-16") != std::string::npos);
  CHECK(peak_memory() < before + (std::size_t{16} << 20));
  put(path, "{\"frames\": 1}");  // zeros behind a text are those of a file system
  std::filesystem::resize_file(path, std::uintmax_t{1} << 20);
  CHECK(detail::read_text(path)->size() == 13);
  const std::string long_text(200000, 'a');
  put(path, "\xEF\xBB\xBF" + long_text);
  const auto read = detail::read_text(path);
  REQUIRE(read.ok());
  CHECK(read->size() == long_text.size());
}
