// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/attack/pgd.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/watermark/decoder/hidden_decoder.hpp"
#include "support/decoder.hpp"

namespace pgd_test {
namespace {

using namespace compmark;

struct Known {
  HiddenDecoder<> decoder = *HiddenDecoder<>::create(testing::small_decoder(12, 16, 2));
  HiddenDecoder<>::Context context;
  SerialExecutor executor;
  std::vector<float> pixels = testing::random_image<float>(24, 32);
  ImageView<const float> image{pixels.data(), 3, 24, 32};

  /// Mean over the bits of how far a picture is from saying `bits`, in logits: negative where all are said.
  double missing(ImageView<const float> picture, const std::vector<std::uint8_t>& bits) {
    std::vector<float> logits(bits.size());
    decoder.forward(picture, std::span<float>(logits), context, executor);
    double sum = 0;
    for (std::size_t b = 0; b < bits.size(); ++b)
      sum += (bits[b] != 0 ? -1 : 1) * static_cast<double>(logits[b]) / static_cast<double>(bits.size());
    return sum;
  }
};

}  // namespace

TEST_CASE("attack/pgd: a picture says what it is made to say, within epsilon, the same for the same seed") {
  Known known;
  const std::vector<std::uint8_t> aim = opposite_bits(known.image, known.decoder, known.context, known.executor);
  PgdSettings settings;
  double before = known.missing(known.image, aim);
  CHECK(before > 0);
  for (const double epsilon : {0.005, 0.02, 0.1}) {
    CAPTURE(epsilon);
    settings.epsilon = epsilon;
    const AttackedPicture moved = pgd_picture(known.image, known.decoder, known.context,
                                              std::span<const std::uint8_t>(aim), settings, known.executor);
    for (std::size_t i = 0; i < known.pixels.size(); ++i) {
      CHECK(std::abs(moved.planes[i] - known.pixels[i]) <= static_cast<float>(epsilon) + 1e-7f);
      CHECK((moved.planes[i] >= 0 && moved.planes[i] <= 1));
    }
    CHECK(pgd_picture(known.image, known.decoder, known.context, std::span<const std::uint8_t>(aim), settings,
                      known.executor)
              .planes == moved.planes);
    const double after = known.missing(moved.view(), aim);
    CHECK(after < before);  // with every epsilon further
    before = after;
  }
  settings.seed = 1;
  settings.epsilon = 0.02;
  const auto picture = [&](bool start, std::uint64_t seed) {
    PgdSettings other = settings;
    other.random_start = start;
    other.seed = seed;
    return pgd_picture(known.image, known.decoder, known.context, std::span<const std::uint8_t>(aim), other,
                       known.executor)
        .planes;
  };
  CHECK(picture(true, 1) != picture(true, 2));
  CHECK(picture(false, 1) == picture(false, 2));
}

TEST_CASE("attack/pgd: a render beyond 0 and 1 is attacked as the file that it would be") {
  Known known;
  const std::vector<std::uint8_t> aim = opposite_bits(known.image, known.decoder, known.context, known.executor);
  PgdSettings settings;
  settings.epsilon = 0.02;
  std::vector<float> beyond = known.pixels, inside = known.pixels;
  for (std::size_t i = 0; i < beyond.size(); i += 3) {
    beyond[i] = i % 2 == 0 ? 1.5f : -0.5f;
    inside[i] = i % 2 == 0 ? 1.0f : 0.0f;
  }
  const auto attacked = [&](const std::vector<float>& pixels) {
    return pgd_picture(ImageView<const float>{pixels.data(), 3, 24, 32}, known.decoder, known.context,
                       std::span<const std::uint8_t>(aim), settings, known.executor)
        .planes;
  };
  CHECK(attacked(beyond) == attacked(inside));
}

TEST_CASE("attack/pgd: epsilon 0 changes nothing, and as much noise without a gradient does not do it") {
  Known known;
  const std::vector<std::uint8_t> aim = opposite_bits(known.image, known.decoder, known.context, known.executor);
  PgdSettings settings;
  settings.epsilon = 0;
  CHECK(pgd_picture(known.image, known.decoder, known.context, std::span<const std::uint8_t>(aim), settings,
                    known.executor)
            .planes == known.pixels);
  settings.epsilon = 0.1;
  settings.steps = 0;  // the control: the random start alone
  const AttackedPicture noise = pgd_picture(known.image, known.decoder, known.context,
                                            std::span<const std::uint8_t>(aim), settings, known.executor);
  CHECK(noise.planes != known.pixels);
  const double before = known.missing(known.image, aim), by_noise = before - known.missing(noise.view(), aim);
  settings.steps = 10;
  const AttackedPicture moved = pgd_picture(known.image, known.decoder, known.context,
                                            std::span<const std::uint8_t>(aim), settings, known.executor);
  CHECK(before - known.missing(moved.view(), aim) > 3 * std::abs(by_noise));
}

}  // namespace pgd_test
