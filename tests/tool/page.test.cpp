// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The page of a marked run with a file: it shows what the file says and not what the model was before, and it says what verify says of the file.
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/io/image_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "tool/running.hpp"

namespace page_test {
namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::done;
using testing::json_of;
using testing::text_of;

using Pixels = std::vector<std::uint8_t>;

std::vector<std::byte> from_base64(const std::string& text) {
  static const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<std::byte> bytes;
  unsigned held = 0;
  int bits = 0;
  for (const char c : text) {
    const std::size_t digit = digits.find(c);
    if (digit == std::string::npos) break;  // the padding
    held = (held << 6 | static_cast<unsigned>(digit)) & 0xffffu;
    if ((bits += 6) < 8) continue;
    bytes.push_back(static_cast<std::byte>(held >> (bits -= 8) & 0xffu));
  }
  return bytes;
}

Pixels pixels_of(std::span<const std::byte> file) {
  const Result<ImageBytes> image = decode_image(file, "a picture");
  REQUIRE(image.ok());
  REQUIRE(image->channels == 3);
  return image->pixels;
}

/// The pictures of a page, in its order.
std::vector<Pixels> pictures_of(const std::string& page) {
  const std::string begin = "src=\"data:image/png;base64,";
  std::vector<Pixels> pictures;
  for (std::size_t at = page.find(begin); at != std::string::npos; at = page.find(begin, at)) {
    at += begin.size();
    pictures.push_back(pixels_of(from_base64(page.substr(at, page.find('"', at) - at))));
  }
  return pictures;
}

}  // namespace

TEST_CASE(
    "tool: the page of a marked file shows what the file says, beside the unmarked one, and its verdict in words") {
  const testing::ScratchFolder scratch("compmark-page-test");
  const auto at = [&](const std::string& name) { return (scratch.path / name).string(); };
  const std::string key = at("owner.key"), decoder = "weights/lattice_48.safetensors", out = at("marked");
  REQUIRE(write_key(key, testing::fixed_key(1, 48)).ok());
  done("scene --out " + at("scene") + " --width 64 --height 64 --train 12 --test 3");
  done("train --codec hac --voxel-size 0.2 --effects none --iterations 200 --data " + at("scene") + " --out " +
       at("plain"));
  done("embed --iterations 60 --model " + at("plain/model.safetensors") + " --data " + at("scene") + " --key " + key +
       " --decoder " + decoder + " --out " + out);
  const std::string page = text_of(out + "/report.html");

  // Of each view: ground truth, the file, what tells them apart, the unmarked file, and what tells the files apart.
  const std::vector<Pixels> pictures = pictures_of(page);
  REQUIRE(pictures.size() == 15);
  const auto renders = [&](const std::string& model) {
    const std::string folder = at("renders-of-" + fs::path(model).filename().string());
    done("render --model " + model + " --out " + folder);
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    std::vector<Pixels> images;
    for (const fs::path& file : files) images.push_back(pixels_of(testing::file_bytes(file)));
    REQUIRE(images.size() == 3);
    return images;
  };
  const std::vector<Pixels> of_file = renders(out + "/model.cmk"), of_model = renders(out + "/model.safetensors"),
                            unmarked = renders(out + "/unmarked.cmk");
  for (std::size_t view = 0; view < 3; ++view) {
    CAPTURE(view);
    CHECK(pictures[5 * view + 1] == of_file[view]);
    CHECK(pictures[5 * view + 1] != of_model[view]);  // the control: before the codec it is another picture
    CHECK(pictures[5 * view + 3] == unmarked[view]);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < of_file[view].size(); ++i) {
      const int between = std::abs(int{of_file[view][i]} - int{unmarked[view][i]});
      if (pictures[5 * view + 4][i] != std::min(255, 5 * between)) ++wrong;
    }
    CHECK(wrong == 0);
  }

  // Line by line what verify says of the file, from the number of matches to the verdict.
  const std::string said = testing::tool("verify --model " + out + "/model.cmk --key " + key + " --decoder " + decoder +
                                         testing::claimed(key, decoder))
                               .text;
  REQUIRE(said.find("\nmatches ") != std::string::npos);
  std::istringstream lines(said.substr(said.find("\nmatches ") + 1));
  std::size_t sentences = 0;
  for (std::string line; std::getline(lines, line); ++sentences) {
    CAPTURE(line);
    // What it proves beyond its p-value is no matter of a page that its owner makes.
    if (line.rfind("DETECTED, conditionally", 0) == 0) line.replace(0, 23, "DETECTED");
    if (line.rfind("standing", 0) == 0) continue;
    if (line.rfind("try ", 0) == 0) continue;  // what else could be read of it is none, either
    const bool labelled = line.compare(10, 2, "  ") == 0;
    CHECK(page.find(">" + (labelled ? line.substr(12) : line) + "<") != std::string::npos);
  }
  const auto has = [&](const char* label) { return said.find(label) == std::string::npos ? 0u : 1u; };
  CHECK(sentences == 5 + has("\nstanding ") + has("\ntry "));

  for (const char* part : {"<h2>Training of the unmarked model</h2>", "href=\"../plain/report.html\"",
                           "<h2>Hiding the message</h2>", "<h2>Bytes by section</h2>", ">unmarked.cmk<"}) {
    INFO(part);
    CHECK(page.find(part) != std::string::npos);
  }
  // The unmarked model's own page has one training, and no message.
  const std::string plain = text_of(at("plain/report.html"));
  CHECK(testing::times_in(plain, "<h2>Training</h2>") == 1);
  CHECK(plain.find("Is the message there?") == std::string::npos);
  CHECK(pictures_of(plain).size() == 9);

  // A log that is not that model's is not shown as its training.
  const std::string log = at("plain/log.jsonl");
  REQUIRE(write_file(log, text_of(log).substr(0, text_of(log).size() / 2)).ok());
  done("embed --iterations 1 --model " + at("plain/model.safetensors") + " --data " + at("scene") + " --key " + key +
       " --decoder " + decoder + " --out " + at("again"));
  CHECK(text_of(at("again/report.html")).find("<h2>Training of the unmarked model</h2>") == std::string::npos);
}

}  // namespace page_test
