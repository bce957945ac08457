// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Captures as other programs and other machines leave them, given to the tool: each is trained with the right data, or is an error or a warning
// that names the thing. Right is what is measured: some iterations on other photographs than the right ones have another PSNR, in every digit.
#include <doctest/doctest.h>

#include <array>
#include <compmark/io/image_file.hpp>
#include <compmark/scene/colmap_model.hpp>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "scene/cube_dialects.hpp"
#include "support/png_text.hpp"
#include "support/scene_files.hpp"
#include "tool/ring_capture.hpp"
#include "tool/running.hpp"

namespace captures_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::Outcome;
using testing::plain;
using testing::ring;
using testing::tool;
using testing::two_digits;

using testing::Names;
using testing::photographs;
using testing::put_photograph;
constexpr int width = testing::ring_side, height = testing::ring_side;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-captures-test");
  return folder.path;
}
/// A new folder.
fs::path place() {
  static int count = 0;
  return scratch() / std::to_string(count++);
}

/// A COLMAP capture whose model has these names, and whose photographs have those; "" is none.
fs::path colmap(const Names& name = plain, const Names& file = plain, const std::string& folder = "images",
                const std::string& sparse = "sparse/0") {
  const fs::path root = place();
  testing::put_colmap_text(root / sparse, testing::ring_model(name));
  for (std::size_t i = 0; i < photographs; ++i) {
    if (const std::string path = file(i); !path.empty()) put_photograph(root / folder / path, i);
  }
  return root;
}
/// A transforms file with these fields before its frames.
std::string transforms(const std::string& head, const Names& path) {
  return testing::cube_transforms(ring(), head, path);
}
const std::string pixels = R"("fl_x": 30, "fl_y": 30, "cx": 12, "cy": 12, "w": 24, "h": 24)";
std::string in_images(std::size_t i) { return "images/" + plain(i); }
fs::path transforms_capture(const std::string& text) {
  const fs::path root = place();
  for (std::size_t i = 0; i < photographs; ++i) put_photograph(root / in_images(i), i);
  testing::put(root / "transforms.json", text);
  return root;
}

struct Trained {
  Outcome outcome;
  double psnr = -1;  ///< of the test views; -1: no training
};
Trained trained(const fs::path& data, const std::string& more = {}) {
  const fs::path out = place();
  Trained result{
      tool("train --iterations 24 --threads 1 --data \"" + data.string() + "\" --out " + out.string() + " " + more)};
  if (result.outcome.code == 0) {
    const nlohmann::json results = testing::json_of(out / "results.json");
    if (results["test"].value("views", 0) > 0) result.psnr = results["test"]["psnr"].get<double>();
  }
  return result;
}
bool has(const Outcome& outcome, const std::string& words) { return outcome.text.find(words) != std::string::npos; }
std::size_t warnings(const Outcome& outcome) { return testing::times_in(outcome.text, "warning: "); }

/// What was said of a capture, without training.
Outcome probed(const fs::path& data) { return tool("probe --data \"" + data.string() + "\""); }
std::string views(std::size_t train, std::size_t test) {
  return std::to_string(train) + " training and " + std::to_string(test) + " test views";
}

}  // namespace

TEST_CASE("tool/captures: photographs under other names are trained with their own cameras") {
  const Trained right = trained(colmap());
  REQUIRE(right.outcome.code == 0);
  CHECK(warnings(right.outcome) == 0);
  const auto without = [](std::size_t i) { return i == 5 ? std::string() : plain(i); };
  const double right_without = trained(colmap(plain, without)).psnr;
  // The controls: a photograph less, and neighbours exchanged, are other figures.
  CHECK(right_without != right.psnr);
  CHECK(trained(colmap([](std::size_t i) { return plain(i == 3 || i == 4 ? 7 - i : i); })).psnr != right.psnr);

  struct Renaming {
    const char* what;
    Names name, file;
  };
  const std::vector<Renaming> renamings{
      {"a folder before", [](std::size_t i) { return "scan 7/images/" + plain(i); }, plain},
      {"a drive and backslashes", [](std::size_t i) { return "D:\\scan\\in\\" + plain(i); }, plain},
      {"an address", [](std::size_t i) { return "file:///srv/x/" + plain(i); }, plain},
      {"another extension", [](std::size_t i) { return "v" + two_digits(i) + ".tiff"; }, plain},
      {"an appended extension", [](std::size_t i) { return "v" + two_digits(i) + ".jpg"; },
       [](std::size_t i) { return "v" + two_digits(i) + ".jpg.png"; }},
      {"capitals", [](std::size_t i) { return "V" + two_digits(i) + ".PNG"; }, plain},
      {"quotes", [](std::size_t i) { return "\"" + plain(i) + "\""; }, plain},
      {"times as names", [](std::size_t i) { return "1000." + two_digits(i) + ".jpg"; },
       [](std::size_t i) { return "1000." + two_digits(i) + ".png"; }},
      {"blanks and percents", [](std::size_t i) { return "a b" + two_digits(i) + ".png"; },
       [](std::size_t i) { return "a%20b" + two_digits(i) + ".png"; }},
      {"two cameras of a rig", [](std::size_t i) { return "cam" + std::to_string(i / 6) + "\\" + plain(i % 6); },
       [](std::size_t i) { return "cam" + std::to_string(i / 6) + "/" + plain(i % 6); }}};
  for (const Renaming& r : renamings) {
    CAPTURE(r.what);
    // Sorted as the names are, which decides what tests.
    const Trained renamed = trained(colmap(r.name, r.file));
    INFO(renamed.outcome.text);
    CHECK(renamed.outcome.code == 0);
    if (std::string(r.what).find("rig") == std::string::npos) CHECK(renamed.psnr == right.psnr);
    CHECK(warnings(renamed.outcome) == 1);
    // One missing and one too many never shift the others.
    const fs::path damaged = colmap(r.name, [&](std::size_t i) { return i == 5 ? std::string() : r.file(i); });
    std::string extra = r.file(11);
    extra.replace(extra.find("1"), 1, "7");  // a name of nobody
    put_photograph(damaged / "images" / extra, 40);
    const Trained lost = trained(damaged);
    INFO(lost.outcome.text);
    CHECK(lost.outcome.code == 0);
    if (std::string(r.what).find("rig") == std::string::npos) CHECK(lost.psnr == right_without);
    CHECK(has(lost.outcome, "1 of 12 images are missing"));
  }
}

TEST_CASE("tool/captures: the order of names counts where no name agrees, is said, and never shifts") {
  const double right = trained(colmap()).psnr;
  const auto undistorted = [](std::size_t i) { return "v" + two_digits(i) + "_undistorted.png"; };
  const auto letter = [](std::size_t i) { return std::string("shot_") + static_cast<char>('b' + i) + ".png"; };
  for (const Names& name : {Names(undistorted), Names([](std::size_t i) { return std::to_string(500 + i) + ".png"; }),
                            Names([](std::size_t i) { return "frame" + two_digits(i + 1) + ".png"; })}) {
    const Trained renamed = trained(colmap(name));
    INFO(renamed.outcome.text);
    CHECK(renamed.psnr == right);
    CHECK(has(renamed.outcome, "the i-th name in sorted order is taken (" + name(0) + " is v00.png)"));
  }
  // One is missing and another one too many, whatever the two series of names are.
  for (const auto& [name, file] : std::vector<std::pair<Names, Names>>{
           {undistorted, plain},
           {letter, [](std::size_t i) { return std::string("p_") + static_cast<char>('b' + i) + ".png"; }}}) {
    const fs::path damaged = colmap(name, [&file = file](std::size_t i) { return i == 5 ? std::string() : file(i); });
    put_photograph(damaged / "images" / file(12), 40);
    const Trained lost = trained(damaged);
    INFO(lost.outcome.text);
    CHECK(lost.outcome.code == 2);
    CHECK(has(lost.outcome, name(0)));
  }
  const fs::path fewer = colmap(undistorted);
  fs::remove(fewer / "images/v03.png");
  CHECK(trained(fewer).outcome.code == 2);
}

TEST_CASE("tool/captures: folders and models of other programs") {
  const double right = trained(colmap()).psnr;
  for (const char* folder :
       {"input", "Images", "images_2", "images_8", "RGB", "photos", "JPEGImages", "day 1/left", "."}) {
    CAPTURE(folder);
    const Trained found = trained(colmap(plain, plain, folder));
    INFO(found.outcome.text);
    CHECK(found.psnr == right);
  }
  for (const char* sparse : {"sparse", "sparse/1", "."})
    CHECK(trained(colmap(plain, plain, "images", sparse)).psnr == right);
  for (const char* inner : {"dense/0/sparse", "undistorted/sparse/0", "Sparse/0", "hloc/sfm"}) {
    CAPTURE(inner);
    const Outcome refused = probed(colmap(plain, plain, "images", inner));
    testing::check_refused(refused, {"holds no capture itself", "sparse/0"});
  }
  const fs::path deep = place();
  fs::create_directories(deep);
  fs::rename(colmap(), deep / "scan");
  testing::check_refused(probed(deep), {"give " + (deep / "scan").string()});
  for (const std::array<std::string, 3>& known : std::vector<std::array<std::string, 3>>{
           {"scan.psx", "", "Metashape"},
           {"cameras.xml", "<?xml version=\"1.0\"?><document><chunk label=\"1\">", "Metashape"},
           {"registration.csv", "#name,x,y,alt,heading,pitch,roll,f\n", "RealityCapture"},
           {"scan.rcproj", "", "RealityCapture"},
           {"metadata.json", R"({"w": 24, "poses": [[0,0,0,1,0,0,0]]})", "Record3D"},
           {"mesh_info.json", "{}", "Polycam"},
           {"reconstruction.json", "[]", "OpenSfM"}}) {
    CAPTURE(known[0]);
    const fs::path foreign = place();
    put_photograph(foreign / "images/v00.png", 0);
    testing::put(foreign / known[0], known[1]);
    testing::check_refused(probed(foreign), {known[2]});
  }
}

TEST_CASE("tool/captures: marks and line ends of any editor change nothing, UTF-16 is named") {
  const double right = trained(colmap()).psnr;
  const auto edited = [](const std::function<std::string(std::string)>& edit) {
    const fs::path root = colmap();
    for (const char* file : {"cameras.txt", "images.txt", "points3D.txt"})
      testing::put(root / "sparse/0" / file, edit(testing::text_of(root / "sparse/0" / file)));
    return root;
  };
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
      text.replace(at, from.size(), to);
    return text;
  };
  CHECK(trained(edited([](const std::string& text) { return "\xEF\xBB\xBF" + text; })).psnr == right);
  CHECK(trained(edited([&](const std::string& text) {
          return replaced(replaced(text, "\r\n", "\n"), "\n", "\r\n");
        })).psnr == right);
  CHECK(trained(edited([&](const std::string& text) {
          return replaced(replaced(text, "\r\n", "\n"), "\n", "\r");
        })).psnr == right);
  // A writer that leaves out the second line of each image.
  CHECK(trained(edited([&](const std::string& text) { return replaced(text, "\r\n\n", "\n"); })).psnr == right);
  const auto wide = [](const std::string& text) {
    std::string result = "\xFF\xFE";
    for (const char c : text) (result += c) += '\0';
    return result;
  };
  testing::check_refused(probed(edited(wide)), {"cameras.txt", "UTF-16", "save it as UTF-8"});
  const std::string json = transforms(pixels, in_images);
  CHECK(has(probed(transforms_capture("\xEF\xBB\xBF" + json)), views(10, 2)));
  testing::check_refused(probed(transforms_capture(wide(json))), {"transforms.json", "UTF-16"});
}

TEST_CASE("tool/captures: what a reader does not use is an error or a warning that names it") {
  const std::string json = transforms(pixels, in_images);
  const auto with = [&](const std::string& fields) {
    return transforms_capture(transforms(pixels + ", " + fields, in_images));
  };
  const auto said = [](const fs::path& data, const std::string& figures, const std::string& words) {
    const Outcome outcome = probed(data);
    INFO(outcome.text);
    CHECK(outcome.code == 0);
    CHECK(has(outcome, figures));
    CHECK(has(outcome, words));
  };
  const auto refused = [](const fs::path& data, const std::vector<std::string>& words) {
    testing::check_refused(probed(data), words);
  };
  {
    INFO("lists of names");
    said(with(R"("train_filename": ["images/v00.png"], "test_file_names": [])"), views(10, 2),
         "\"test_file_names\", \"train_filename\" are fields");
    said(with(R"("train_filenames": ["images/v00.png", "images/v01.png"], "test_filenames": ["images/v02.png"])"),
         views(2, 1), "9 images are in neither train_filenames nor test_filenames");
    said(
        with(
            R"("train_filenames": ["images/v00.png", "images/v01.png"], "test_filenames": ["images/v01.png", "images/v02.png"])"),
        views(2, 1), "1 images are in two lists");
  }
  {
    INFO("poses");
    const auto changed = [&](const std::string& from, const std::string& to) {
      std::string text = json;
      for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
        text.replace(at, from.size(), to);
      REQUIRE(text != json);
      return transforms_capture(text);
    };
    refused(changed("[0,0,0,1]]", "[0,0,0,2]]"), {"frames[0].transform_matrix", "last row"});
    nlohmann::json columns = nlohmann::json::parse(json);
    nlohmann::json& matrix = columns["frames"][7]["transform_matrix"];
    const nlohmann::json rows = matrix;
    for (std::size_t r = 0; r < 4; ++r)
      for (std::size_t c = 0; c < 4; ++c) matrix[r][c] = rows[c][r];
    refused(transforms_capture(columns.dump()), {"frames[7].transform_matrix", "stored by columns"});
    nlohmann::json same = nlohmann::json::parse(json);
    for (nlohmann::json& frame : same["frames"]) frame["transform_matrix"] = rows;
    said(transforms_capture(same.dump()), views(10, 2), "all 12 photographs have the same pose");
    refused(transforms_capture(json.substr(0, json.size() - 1) + ", \"frames\": []}"), {"frames", "twice"});
  }
  {
    INFO("intrinsics");
    const fs::path one_side = transforms_capture(transforms(R"("fl_x": 60, "cx": 24, "cy": 24, "w": 48)", in_images));
    said(one_side, views(10, 2), "taken to be for 48 x 48");
    CHECK(trained(one_side).psnr == trained(transforms_capture(json)).psnr);
    said(transforms_capture(transforms(R"("fl_x": 60, "cx": 24, "cy": 24)", in_images)), views(10, 2),
         "principal point 24, 24 for 24 x 24");
    said(transforms_capture(transforms(R"("fl_x": 1.25, "cx": 0.5, "cy": 0.5, "w": 24, "h": 24)", in_images)),
         views(10, 2), "focal lengths 1.25");
    refused(transforms_capture(transforms(R"("camera_angle_x": 43.6)", in_images)), {"camera_angle_x", "radians"});
    const fs::path more = colmap();
    testing::put(more / "sparse/0/cameras.txt", "1 PINHOLE 24 24 30 30 12 12 0.1 -0.2\n");
    refused(more, {"cameras.txt: line 1", "PINHOLE has 4 parameters"});
  }
  {
    INFO("photographs");
    nlohmann::json twice = nlohmann::json::parse(json);
    twice["frames"].push_back(twice["frames"][3]);
    twice["frames"].back()["file_path"] = "./images/../images/v03.png";
    said(transforms_capture(twice.dump()), views(10, 2), "1 frames have the photograph of another frame");
    twice["frames"].back()["transform_matrix"] = twice["frames"][4]["transform_matrix"];
    refused(transforms_capture(twice.dump()), {"v03.png", "with another pose"});
    const fs::path copy = transforms_capture(json);
    fs::copy_file(copy / "images/v00.png", copy / "images/v01.png", fs::copy_options::overwrite_existing);
    said(copy, views(10, 2), "1 test photographs are training photographs under another name");
    const fs::path format =
        colmap(plain, [](std::size_t i) { return i == 3 ? std::string("other/v40.png") : plain(i); });
    testing::put(format / "images/v03.webp", "RIFF....WEBP");
    said(format, views(9, 2), "v03.webp is there, but only PNG and JPEG are read");
    const fs::path formats = colmap(plain, [](std::size_t) { return std::string(); });
    for (std::size_t i = 0; i < photographs; ++i)
      testing::put(formats / "images" / ("v" + two_digits(i) + ".heic"), "x");
    refused(formats, {"but v00.heic", "convert"});
  }
  {
    INFO("files of cameras");
    const fs::path root = colmap();
    testing::put(root / "poses_bounds.npy", testing::cube_poses_bounds(ring()));
    said(root, views(10, 2), "poses_bounds.npy: is not used, as there is a COLMAP model");
    testing::put(root / "transforms.json", transforms(pixels, in_images));
    said(root, views(10, 2), "transforms.json: is not used, as there is a COLMAP model");
    testing::put_colmap_binary(root / "sparse/0", testing::ring_model(plain));
    said(root, views(10, 2), "cameras.txt: is not used, as the model is there in binary files");
    testing::put(root / "sparse/0/images.bin", testing::text_of(root / "sparse/0/images.bin") + "more");
    refused(root, {"images.bin", "4 more bytes follow"});
    const fs::path named = transforms_capture(json);
    fs::rename(named / "transforms.json", named / "Transforms.JSON");
    refused(named, {"Transforms.JSON", "has poses"});
    CHECK(has(probed(named / "Transforms.JSON"), views(10, 2)));
  }
  {
    INFO("Blender");
    const auto blender = [&](const std::string& test) {
      const fs::path root = transforms_capture(json);
      fs::rename(root / "transforms.json", root / "transforms_train.json");
      if (!test.empty()) testing::put(root / "transforms_test.json", test);
      return root;
    };
    said(blender(transforms(pixels, [](std::size_t i) { return "test/r_" + std::to_string(i); })), views(12, 0),
         "none of its 12 images is there");
    said(blender(R"({"camera_angle_x": 0.7, "frames": []})"), views(12, 0), "its list of frames is empty");
    // Random points are no evidence of anything, and are not told as points of the capture.
    CHECK(has(probed(blender("")), "no points: training begins with random ones"));
    CHECK_FALSE(has(probed(colmap()), "random"));
    const fs::path val = blender("");
    testing::put(val / "transforms_val.json", json);
    said(val, views(12, 0), "transforms_val.json is not used");
  }
}

TEST_CASE(
    "tool/captures: masks count the same pixels however they are written, or are refused before the first iteration") {
  const auto inside = [](int x, int y) { return x > 3 && x < 20 && y > 3 && y < 20; };
  const auto mask = [&](int bits, int type, const std::function<std::vector<int>(bool)>& pixel,
                        const std::string& palette = "") {
    return testing::png_text(
        width, height, bits, type, [&](int x, int y) { return pixel(inside(x, y)); }, palette);
  };
  using Values = std::vector<int>;
  const std::string white = mask(8, 0, [](bool in) { return Values{in ? 255 : 0}; });
  const auto masked = [](
                          const std::string& file,
                          const Names& name = [](std::size_t i) { return "masks/" + plain(i); }) {
    const fs::path root = colmap();
    for (std::size_t i = 0; i < photographs; ++i) testing::put(root / name(i), file);
    return root;
  };
  const double right = trained(masked(white)).psnr;
  CHECK(right != trained(colmap()).psnr);  // the control
  const std::string green("\0\0\0\0\x80\0", 6);
  for (const std::string& file : {mask(8, 0, [](bool in) { return Values{in ? 1 : 0}; }),
                                  mask(16, 0, [](bool in) { return Values{in ? 65535 : 0}; }),
                                  mask(16, 0, [](bool in) { return Values{in ? 1 : 0}; }),
                                  mask(
                                      8, 3, [](bool in) { return Values{in ? 1 : 0}; }, green),
                                  mask(8, 6,
                                       [](bool in) {
                                         return Values{0, 0, 0, in ? 255 : 0};
                                       }),
                                  mask(8, 4, [](bool in) {
                                    return Values{255, in ? 255 : 0};
                                  })}) {
    const Trained read = trained(masked(file));
    INFO(read.outcome.text);
    CHECK(read.psnr == right);
  }
  const auto refused = [](const fs::path& data, const std::vector<std::string>& words) {
    const Trained nothing = trained(data);
    INFO(nothing.outcome.text);
    CHECK(nothing.outcome.code == 2);
    CHECK_FALSE(has(nothing.outcome, "train 1/"));
    for (const std::string& word : words) CHECK(has(nothing.outcome, word));
  };
  refused(masked(mask(8, 0, [](bool) { return Values{0}; })), {"masks/v00.png", "black everywhere"});
  refused(masked("<html>"), {"masks/v00.png", "HTML"});
  refused(masked(testing::png_text(12, 12, 8, 0, [](int, int) { return Values{255}; })), {"12 x 12", "24 x 24"});
  // Masks that belong to nobody, or to no format that is read, are said.
  for (const auto& [name, words] : std::vector<std::pair<Names, std::string>>{
           {[](std::size_t i) { return "masks/other" + two_digits(i) + ".png"; },
            "12 masks in masks belong to no image"},
           {[](std::size_t i) { return "masks/v" + two_digits(i) + ".npy"; }, "12 files that are neither PNG nor JPEG"},
           {[](std::size_t i) { return "binary_masks/" + plain(i); }, "images in binary_masks are not used"},
           {[](std::size_t i) { return "seg/" + plain(i); }, "images in seg are not used"},
           {[](std::size_t i) { return "images/v" + two_digits(i) + "_mask.png"; },
            "12 masks beside the images are not used"}}) {
    const Outcome outcome = probed(masked(white, name));
    INFO(outcome.text);
    CHECK(outcome.code == 0);
    CHECK(has(outcome, words));
  }
  // Nothing to learn from without any mask.
  const fs::path flat = colmap();
  for (std::size_t i = 0; i < photographs; ++i)
    testing::put(flat / "images" / plain(i), testing::png_text(width, height, 8, 2, [](int, int) {
                   return Values{0, 0, 0};
                 }));
  refused(flat, {"everywhere", "nothing to learn"});
  for (std::size_t i = 0; i < photographs; ++i)
    testing::put(flat / "images" / plain(i), testing::png_text(width, height, 8, 6, [](int x, int y) {
                   return Values{9 * x, 9 * y, 50, 0};
                 }));
  refused(flat, {"everywhere", "nothing to learn"});
}

}  // namespace captures_test
