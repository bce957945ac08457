// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a page holds of its splats. That a browser draws it as the library does is tests/browser/viewer.sh.
#include "compmark/io/splat/viewer_page.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>

#include "compmark/io/read_file.hpp"
#include "io/splat_writers.hpp"
#include "support/damage.hpp"
#include "support/tool.hpp"

using namespace compmark;

namespace viewer_page_test {

/// What stands in the element of this id.
std::string element(const std::string& page, const std::string& id) {
  const std::size_t at = page.find('>', page.find("id=\"" + id + "\"")) + 1;
  return page.substr(at, page.find("</script>", at) - at);
}
std::vector<std::byte> decoded(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<std::byte> bytes;
  unsigned bits = 0;
  int held = 0;
  for (const char c : text) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<unsigned>(digits.find(c));
    held += 6;
    if (held >= 8) bytes.push_back(static_cast<std::byte>(bits >> (held -= 8) & 0xFFu));
  }
  return bytes;
}

TEST_CASE("io/viewer_page: a page holds every splat, to 16 bits of the harmonics, and its cameras") {
  const testing::ScratchFolder folder("compmark-viewer-page");
  for (const int degree : {0, 1, 3}) {
    CAPTURE(degree);
    const SplatTable table = testing::splats::random_splats(50, degree);
    ViewerPage page;
    page.title = "</script><b>\"mine\"";
    page.up = {0, 0, 1};
    page.cameras = cameras_around(splat_bulk(table));
    const std::filesystem::path path = folder.path / "page.html";
    REQUIRE(write_viewer_page(path, table, page).ok());
    const Result<std::vector<std::byte>> file = read_file(path);
    REQUIRE(file.ok());
    const std::string text(reinterpret_cast<const char*>(file->data()), file->size());
    const nlohmann::json scene = nlohmann::json::parse(element(text, "scene"));
    CHECK(scene["title"] == page.title);
    CHECK(scene["count"] == 50);
    CHECK(scene["up"] == nlohmann::json({0, 0, 1}));
    REQUIRE(scene["cameras"].size() == 16);
    CHECK(scene["cameras"][2]["eye"][1] == page.cameras[2].center_world[1]);
    CHECK(scene["cameras"][2]["turn"].size() == 9);

    const std::size_t coefficients = table.coefficients();
    CHECK(scene["coefficients"] == coefficients);
    const std::vector<std::byte> bytes = decoded(element(text, "splats"));
    REQUIRE(bytes.size() == 50 * (44 + 6 * coefficients));
    double wrong = 0, coarse = 0;
    for (std::size_t i = 0; i < 50; ++i) {
      std::array<float, 11> numbers{};
      std::memcpy(numbers.data(), bytes.data() + 44 * i, 44);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        CHECK(numbers[axis] == table.mean[axis][i]);
        wrong = std::max(wrong, std::abs(std::log(static_cast<double>(numbers[3 + axis])) -
                                         static_cast<double>(table.log_scale[axis][i])));
      }
      const double opacity = static_cast<double>(numbers[10]);
      wrong = std::max(wrong, std::abs(opacity - 1 / (1 + std::exp(-static_cast<double>(table.opacity[i])))));
      for (std::size_t k = 0; k < coefficients; ++k) {
        const double low = scene["low"][k], high = scene["high"][k];
        for (std::size_t c = 0; c < 3; ++c) {
          const std::size_t at = 50 * 44 + 2 * ((i * coefficients + k) * 3 + c);
          const double part = (std::to_integer<int>(bytes[at]) + 256 * std::to_integer<int>(bytes[at + 1])) / 65535.0;
          const double error = std::abs(low + (high - low) * part - static_cast<double>(table.color(c, k)[i]));
          coarse = std::max(coarse, error / (high - low));
        }
      }
    }
    CHECK(wrong < 1e-6);
    CHECK(coarse < 0.5 / 65535 + 1e-7);
  }
}

TEST_CASE("io/viewer_page: more splats than a texture holds are refused") {
  SplatTable table;
  table.degree = 3;
  table.count = viewer_limit(16) + 1;  // the columns are not looked at
  table.sh.resize(48);
  const Result<Done> refused = write_viewer_page("nowhere/page.html", table);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().kind == ErrorKind::exhausted);
  CHECK(refused.error().remedy.find("--sh-degree") != std::string::npos);
}

}  // namespace viewer_page_test
