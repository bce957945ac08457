// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/foreign.hpp"

#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>

#include <string>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

TEST_CASE("scene/foreign: captures of other programs are named, with the way to one that is read") {
  const struct {
    const char *file, *text, *what, *remedy;
  } captures[] = {
      {"keyframes/cameras/1.json", "{}", "Polycam", "ns-process-data polycam"},
      {"metadata.json", R"({"w": 10, "K": [1], "poses": [[0]]})", "Record3D", "ns-process-data record3d"},
      {"Cameras.XML", "<?xml version=\"1.0\"?>\n<document version=\"2\">\n<chunk label=\"1\">", "Metashape", "COLMAP"},
      {"registration.csv", "#name,x,y,alt,heading,pitch,roll,f\na.jpg,0,0,0,0,0,0,1\n", "RealityCapture", "COLMAP"},
      {"a.xmp", "<x:xmpmeta><rdf:Description xcr:Version=\"3\">", "RealityCapture", "COLMAP"},
      {"database.db", "SQLite format 3\n", "COLMAP without a model", "mapper"},
      {"splat.ply", "ply\n", "splat", "photographs"},
      {"capture.mp4", "x", "video", "examples/capture.sh --video"},
      {"capture.zip", "PK", "packed", "unpack"},
      {"images/a.png", "x", "no cameras", "COLMAP"},
      {"inner/transforms.json", "{}", "inner", "inner"},
      {"inner/sparse/0/images.txt", "", "inner", "inner"},
  };
  for (const auto& capture : captures) {
    CAPTURE(capture.file);
    const TemporaryFolder folder;
    put(folder.path() / capture.file, capture.text);
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(!dataset.ok());
    CHECK(names(dataset.error(), folder.path().string(), "", capture.remedy));
    CHECK((dataset.error().problem.find(capture.what) != std::string::npos));
  }
  // By what they hold where a name is anybody's, and when they are named themselves.
  const TemporaryFolder folder;
  put(folder.path() / "notes.xml", "<notes/>");
  CHECK(open_dataset(folder.path(), {}).error().remedy.find("contains one of them") != std::string::npos);
  put(folder.path() / "cameras.xml", "<document><chunk>");
  CHECK(open_dataset(folder.path() / "cameras.xml", {}).error().problem.find("Metashape") != std::string::npos);
}

TEST_CASE("scene/open: folders of photographs that other programs make, and captures without test photographs") {
  const ColmapModel model = small_colmap_model();
  for (const char* place : {"Images", "input", "RGB", "image", "photos", ".", "day 1/left"}) {
    CAPTURE(place);
    const TemporaryFolder folder;
    const bool beside = std::string(place) == ".";
    put_colmap_text(beside ? folder.path() : folder.path() / "sparse/0", model);
    put_colmap_images(folder.path() / place, model);
    if (!beside) std::filesystem::create_directory(folder.path() / "images");  // an empty one is no reason to stop
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    CHECK(dataset->views.size() == 9);
    CHECK(dataset->warnings.empty() == (std::string(place) != "day 1/left"));  // found by the ends of their names
  }
  const TemporaryFolder folder;
  put_blender(folder.path());
  std::filesystem::remove_all(folder.path() / "test");
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  CHECK(dataset->indices(Split::train).size() == 2);
  CHECK(dataset->indices(Split::test).empty());
  REQUIRE(dataset->warnings.size() == 1);
  CHECK(dataset->warnings[0].find("none of its 1 images is there (the first is \"./test/a\")") != std::string::npos);
}
