// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/cover_interference.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/watermark/pretrain/whitening.hpp"
#include "support/scene_files.hpp"

namespace cover_interference_test {
namespace {

using namespace compmark;

/// A subject of soft stripes on white, `size` pixels a side, seen from `angle`.
struct StripedPicture {
  int size;
  std::vector<float> planes;
  StripedPicture(int pixels, double angle, double gain = 1) : size(pixels) {
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < size; ++y) {
        for (int x = 0; x < size; ++x) {
          const double u = (x + 0.5) / size - 0.5, v = (y + 0.5) / size - 0.5;
          const double stripes = 0.4 + 0.3 * std::sin(9 * (u * std::cos(angle) + v * std::sin(angle)) + c);
          planes.push_back(static_cast<float>(u * u + v * v < 0.12 ? gain * stripes : 1.0));
        }
      }
    }
  }
  [[nodiscard]] ImageView<const float> view() const { return {planes.data(), 3, size, size}; }
};

std::vector<float> sketch_of(ImageView<const float> image) {
  SerialExecutor executor;
  PictureSketch<float> sketch;
  const std::span<const float> found = sketch.of(image, executor);
  return {found.begin(), found.end()};
}
double distance(const std::vector<float>& a, const std::vector<float>& b) {
  double square = 0;
  for (std::size_t k = 0; k < a.size(); ++k) square += std::pow(static_cast<double>(a[k] - b[k]), 2);
  return std::sqrt(square);
}

CoverInterference drawn_interference(std::size_t views, std::size_t outputs) {
  CoverInterference drawn;
  const Random random(4, 0, random_stage("test/cover interference"));
  std::size_t n = 0;
  const auto fill = [&](std::vector<float>& values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) values.push_back(static_cast<float>(0.3 * random.normal(n++)));
  };
  fill(drawn.mean, outputs);
  fill(drawn.sketch, views * PictureSketch<float>::values);
  fill(drawn.coefficient, views * outputs);
  drawn.decoder_sha256 = std::string(64, 'a');
  return drawn;
}

}  // namespace

TEST_CASE("decoder/cover_interference: a sketch knows a picture again in another light and size, and no other view") {
  const std::vector<float> sketch = sketch_of(StripedPicture(96, 0.3).view());
  REQUIRE(sketch.size() == PictureSketch<float>::values);
  double square = 0, sum = 0;
  for (const float value : sketch) {
    square += static_cast<double>(value) * static_cast<double>(value);
    sum += static_cast<double>(value);
  }
  CHECK(std::sqrt(square) == doctest::Approx(1 / PictureSketch<float>::width).epsilon(1e-4));
  CHECK(std::abs(sum) < 1e-4);
  CHECK(distance(sketch, sketch_of(StripedPicture(96, 0.3, 0.8).view())) < 0.4);
  CHECK(distance(sketch, sketch_of(StripedPicture(64, 0.3).view())) < 0.3);
  CHECK(distance(sketch, sketch_of(StripedPicture(96, 0.32).view())) < 0.3);
  CHECK(distance(sketch, sketch_of(StripedPicture(96, 1.8).view())) > 1);  // the control

  std::vector<float> framed(3 * 120 * 120, 0.1f);  // a frame goes with the background
  const StripedPicture plain(96, 0.3);
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t y = 0; y < 96; ++y) {
      for (std::size_t x = 0; x < 96; ++x)
        framed[(c * 120 + y + 12) * 120 + x + 12] = plain.planes[(c * 96 + y) * 96 + x];
    }
  }
  CHECK(distance(sketch, sketch_of({framed.data(), 3, 120, 120})) < 0.4);
}

TEST_CASE("decoder/cover_interference: what has no sketch has zero: flat, tiny, and what is no number") {
  const std::vector<float> none(PictureSketch<float>::values, 0.0f);
  std::vector<float> flat(3 * 40 * 40, 0.5f);
  CHECK(sketch_of({flat.data(), 3, 40, 40}) == none);
  CHECK(sketch_of({flat.data(), 3, 7, 40}) == none);
  const StripedPicture seen(40, 0);
  flat = seen.planes;
  flat[50] = std::numeric_limits<float>::quiet_NaN();
  CHECK(sketch_of({flat.data(), 3, 40, 40}) == none);
  CHECK(sketch_of(seen.view()) != none);
}

TEST_CASE("decoder/cover_interference: subtracts its formula, along carriers as before them, and far away the mean") {
  const CoverInterference drawn = drawn_interference(5, 6);
  std::vector<float> picture(drawn.sketch.begin(), drawn.sketch.begin() + 64);
  for (std::size_t k = 0; k < picture.size(); ++k) picture[k] += k % 2 == 0 ? 0.1f : -0.05f;
  std::vector<double> expected, outputs(6, 2.0);
  for (std::size_t d = 0; d < 6; ++d) {
    double said = static_cast<double>(drawn.mean[d]);
    for (std::size_t i = 0; i < 5; ++i) {
      double square = 0;
      for (std::size_t k = 0; k < 64; ++k)
        square += std::pow(static_cast<double>(picture[k]) - static_cast<double>(drawn.sketch[64 * i + k]), 2);
      said += std::exp(-square / 2) * static_cast<double>(drawn.coefficient[6 * i + d]);
    }
    expected.push_back(2 - CoverInterference::share * said);
  }
  drawn.subtract(picture, outputs);
  for (std::size_t d = 0; d < 6; ++d) CHECK(outputs[d] == doctest::Approx(expected[d]).epsilon(1e-12));
  CHECK(std::abs(outputs[0] - 2 + CoverInterference::share * static_cast<double>(drawn.mean[0])) > 1e-3);

  const std::vector<double> carriers = orthonormal_rows(4, 6, Random(5, 0, random_stage("test/carriers")));
  const CoverInterference key = drawn.along(carriers);
  CHECK(key.outputs() == 4);
  CHECK(key.views() == 5);
  std::vector<double> logits(4, 0.0);
  key.subtract(picture, logits);
  for (std::size_t b = 0; b < 4; ++b) {
    double projected = 0;
    for (std::size_t d = 0; d < 6; ++d) projected += carriers[6 * b + d] * (expected[d] - 2);
    CHECK(logits[b] == doctest::Approx(projected).epsilon(1e-5));
  }

  const std::vector<float> far(64, 5.0f);
  outputs.assign(6, 0.0);
  drawn.subtract(far, outputs);
  for (std::size_t d = 0; d < 6; ++d)
    CHECK(outputs[d] == doctest::Approx(-CoverInterference::share * static_cast<double>(drawn.mean[d])));
}

TEST_CASE("decoder/cover_interference: a file gives it back, and one that is damaged is one line") {
  const testing::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "interference.safetensors";
  const CoverInterference drawn = drawn_interference(3, 4);
  const auto written = [&](const CoverInterference& interference) {
    REQUIRE(write_cover_interference<SafetensorsWriter>(interference, "a test", path).ok());
    Result<SafetensorsFile> file = read_safetensors(path, FileKind::interference);
    REQUIRE(file.ok());
    return std::move(*file);
  };
  const Result<CoverInterference> read = read_cover_interference(written(drawn));
  REQUIRE(read.ok());
  CHECK(read->mean == drawn.mean);
  CHECK(read->sketch == drawn.sketch);
  CHECK(read->coefficient == drawn.coefficient);
  CHECK(read->decoder_sha256 == drawn.decoder_sha256);

  const auto refused = [&](SafetensorsFile file, const char* field) {
    const Result<CoverInterference> result = read_cover_interference(file);
    REQUIRE_FALSE(result.ok());
    CHECK(result.error().field.find(field) != std::string::npos);
    CHECK(result.error().line().find('\n') == std::string::npos);
    CHECK(result.error().remedy.find("decoder file") == std::string::npos);  // that is what other files are
  };
  CoverInterference bad = drawn;
  bad.coefficient[2] = std::numeric_limits<float>::quiet_NaN();
  refused(written(bad), "coefficient");
  bad = drawn;
  bad.decoder_sha256 = "short";
  refused(written(bad), "decoder_sha256");
  for (const auto& [key, value] : {std::pair("format_version", "2"), std::pair("outputs", "5"), std::pair("views", "0"),
                                   std::pair("outputs", "four"), std::pair("format", "compmark decoder")}) {
    SafetensorsFile file = written(drawn);
    file.metadata[key] = value;
    refused(std::move(file), std::string(key) == "outputs" && std::string(value) == "5" ? "mean" : key);
  }
  SafetensorsFile file = written(drawn);
  file.metadata.erase("views");
  refused(std::move(file), "views");
  (void)written(drawn);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 8);
  CHECK_FALSE(read_safetensors(path, FileKind::interference).ok());
}

}  // namespace cover_interference_test
