// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A scene that is louder than its mark: soft shapes that a camera goes round, and along every pattern that the decoder
// reads a texture that changes with the camera and is twice as strong as the message.
#include "compmark/watermark/fit/cover_interference_fit.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/metric/rounding.hpp"

namespace cover_interference_fit_test {
namespace {

using namespace compmark;

constexpr int size = 48;
constexpr std::size_t pixels = static_cast<std::size_t>(size) * size, bits = 16;

float sign_at(std::size_t bit, std::size_t pixel) {
  return Random(8, bit, random_stage("test/pattern")).bits(pixel) % 2 == 0 ? 1.0f : -1.0f;
}

/// Bit b is the mean of a picture's green along a pattern of signs, in hundredths.
struct PatternDecoder {
  static constexpr bool is_absent = false;
  using Scalar = float;
  struct Context {};
  [[nodiscard]] static int bits() { return static_cast<int>(cover_interference_fit_test::bits); }
  [[nodiscard]] static int minimum_size() { return size; }
  template <Executor E>
  void forward(ImageView<const float> image, std::span<float> logits, Context&, E&) const {
    for (std::size_t b = 0; b < logits.size(); ++b) {
      double sum = 0;
      for (std::size_t i = 0; i < pixels; ++i)
        sum += static_cast<double>(sign_at(b, i)) * static_cast<double>(image.plane(1)[i]);
      logits[b] = static_cast<float>(100 * sum / static_cast<double>(pixels));
    }
  }
  template <Executor E>
  void backward(std::span<const float>, ImageView<float>, Context&, E&) const {}
};

/// Sign of bit b of the message.
double bit_sign(std::size_t b) { return b % 3 == 0 ? 1 : -1; }

/// The scene of `seed` from camera `turn` in [0, 1), in 8 bits, with a mark of this strength.
std::vector<float> render(double turn, double mark, std::uint64_t seed) {
  std::vector<float> planes(3 * pixels);
  const double angle = 6.2831853 * turn, phase = 1.7 * static_cast<double>(seed);
  for (std::size_t i = 0; i < pixels; ++i) {
    const double x = static_cast<double>(i % size) / size - 0.5, y = static_cast<double>(i / size) / size - 0.5;
    const double shapes = 0.5 + 0.2 * std::sin(7 * x * std::cos(angle) + phase) * std::cos(5 * y + std::sin(angle)) +
                          0.1 * std::sin(6 * (x + y) + angle);
    double texture = 0;
    for (std::size_t b = 0; b < bits; ++b) {
      const double loud = 0.04 * std::cos(angle + 2.4 * static_cast<double>(b) + phase);
      texture += (loud + mark * bit_sign(b)) * static_cast<double>(sign_at(b, i));
    }
    for (std::size_t c = 0; c < 3; ++c) planes[c * pixels + i] = static_cast<float>(shapes + (c == 1 ? texture : 0));
  }
  round_to_8bit<float>(ImageView<const float>{planes.data(), 3, size, size},
                       ImageView<float>{planes.data(), 3, size, size});
  return planes;
}

template <Executor E>
Result<CoverInterferenceFit> fitted(std::size_t views, std::uint64_t seed, E& executor) {
  std::vector<float> kept;
  const auto picture = [&](std::size_t i) -> Result<ImageView<const float>> {
    kept = render((static_cast<double>(i) + 0.5) / static_cast<double>(views), 0, seed);
    return ImageView<const float>{kept.data(), 3, size, size};
  };
  return fit_cover_interference(PatternDecoder{}, views, picture, executor);
}

/// Share of the bits that are right in marked pictures from seven other cameras, less a part of the interference. These
/// marks know nothing of the scene, so that all of it is the right part.
double right(const CoverInterference* interference, double part = 1) {
  SerialExecutor executor;
  PictureSketch<float> sketch;
  double found = 0;
  for (int n = 0; n < 7; ++n) {
    const std::vector<float> planes = render(n / 7.0 + 0.013, 0.02, 1);
    const ImageView<const float> image{planes.data(), 3, size, size};
    std::vector<float> logits(bits);
    PatternDecoder::Context context;
    PatternDecoder{}.forward(image, std::span<float>(logits), context, executor);
    std::vector<double> less(logits.begin(), logits.end());
    if (interference != nullptr) interference->subtract(sketch.of(image, executor), less, part);
    for (std::size_t b = 0; b < bits; ++b) found += less[b] * bit_sign(b) > 0 ? 1.0 / (7 * bits) : 0.0;
  }
  return found;
}

}  // namespace

TEST_CASE("fit/cover_interference_fit: a scene that shouts down its mark blind is read with its interference") {
  ThreadExecutor executor(2);
  const Result<CoverInterferenceFit> fit = fitted(60, 1, executor);
  REQUIRE(fit.ok());
  const double blind = right(nullptr), informed = right(&fit->interference);
  CAPTURE(blind);
  CAPTURE(informed);
  CAPTURE(fit->told);
  CHECK(blind < 0.85);
  CHECK(informed > 0.99);
  CHECK(right(&fit->interference, CoverInterference::share) > blind + 0.1);  // half of it is half the way
  CHECK(fit->told > 0.9);
  CHECK(fit->deviation == doctest::Approx(100 * 0.04 / std::sqrt(2.0)).epsilon(0.2));
  // Negative controls: the mean alone, and the interference of another scene, leave it as it was.
  CoverInterference mean = fit->interference;
  for (float& value : mean.coefficient) value = 0;
  CHECK(right(&mean) < 0.85);
  const Result<CoverInterferenceFit> other = fitted(60, 2, executor);
  REQUIRE(other.ok());
  CHECK(right(&other->interference) < 0.9);
}

TEST_CASE("fit/cover_interference_fit: the same bits at any thread count; few views know of their ignorance") {
  ThreadExecutor one(1), three(3);
  const Result<CoverInterferenceFit> a = fitted(12, 1, one), b = fitted(12, 1, three), few = fitted(4, 1, one);
  REQUIRE((a.ok() && b.ok() && few.ok()));
  CHECK(a->interference.coefficient == b->interference.coefficient);
  CHECK(a->interference.sketch == b->interference.sketch);
  CHECK(a->interference.mean == b->interference.mean);
  CHECK(a->told == b->told);
  CHECK(few->told < a->told);
}

TEST_CASE("fit/cover_interference_fit: an error of a picture is passed on, and views that are all alike are one") {
  SerialExecutor executor;
  const auto broken = [](std::size_t i) -> Result<ImageView<const float>> {
    static const std::vector<float> grey(3 * pixels, 0.5f);
    if (i == 2) return Error{ErrorKind::cancelled, {}, {}, "was stopped", {}};
    return ImageView<const float>{grey.data(), 3, size, size};
  };
  CHECK(fit_cover_interference(PatternDecoder{}, 5, broken, executor).error().kind == ErrorKind::cancelled);
  const Result<CoverInterferenceFit> alike = fit_cover_interference(PatternDecoder{}, 2, broken, executor);
  REQUIRE_FALSE(alike.ok());
  CHECK(alike.error().problem == "says the same in every view");
}

}  // namespace cover_interference_fit_test
