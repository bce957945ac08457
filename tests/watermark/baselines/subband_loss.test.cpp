// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/subband_loss.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/testing/gradient.hpp>
#include <cstddef>
#include <vector>

#include "watermark/baselines/random_picture.hpp"

using namespace compmark;

TEST_CASE("baselines/subband_loss: its gradient obeys the law and is added") {
  const int height = 14, width = 19;
  std::vector<double> rendered = testing::random_picture(height, width, 5), gradient(rendered.size(), 0.0);
  const std::vector<double> target = testing::random_picture(height, width, 6);
  const SubbandLoss<double> bands;
  SubbandLoss<double>::Context context;
  SerialExecutor serial;
  const ImageView<const double> seen{rendered.data(), 3, height, width}, wanted{target.data(), 3, height, width};
  std::vector<double> ignored(rendered.size());
  const auto loss = [&] {
    return 0.7 * bands.forward_backward(seen, wanted, 0.7, {ignored.data(), 3, height, width}, context, serial);
  };
  bands.forward_backward(seen, wanted, 0.7, {gradient.data(), 3, height, width}, context, serial);
  CHECK(testing::gradient_law(loss, rendered, gradient) == "");
  std::vector<double> wrong = gradient;
  for (double& value : wrong) value *= 1.01;
  CHECK(testing::gradient_law(loss, rendered, wrong) != "");
  std::vector<double> twice = gradient;
  bands.forward_backward(seen, wanted, 0.7, {twice.data(), 3, height, width}, context, serial);
  for (std::size_t i = 0; i < twice.size(); ++i) CHECK(twice[i] == doctest::Approx(2 * gradient[i]).epsilon(1e-12));
}

TEST_CASE("baselines/subband_loss: it is the published sum, and a change of the low band alone costs nothing") {
  const int height = 16, width = 24;
  const std::vector<double> rendered = testing::random_picture(height, width, 8),
                            target = testing::random_picture(height, width, 9);
  SerialExecutor serial;
  SubbandLoss<double>::Context context;
  std::vector<double> ignored(rendered.size());
  const auto loss = [&](const std::vector<double>& a, const std::vector<double>& b) {
    return SubbandLoss<double>().forward_backward({a.data(), 3, height, width}, {b.data(), 3, height, width}, 1,
                                                  {ignored.data(), 3, height, width}, context, serial);
  };
  // Each picture transformed by itself, in the published scale: a level's bands are 2 times ours.
  const auto bands_of = [&](std::vector<double> picture) {
    std::vector<std::vector<double>> bands;
    int h = height, w = width;
    for (int level = 0; level < 2; ++level) {
      std::vector<double> low;
      for (const WaveletPass along_x : {WaveletPass::low, WaveletPass::high}) {
        for (const WaveletPass along_y : {WaveletPass::low, WaveletPass::high}) {
          WaveletBand<double> band(along_x, along_y);
          std::vector<double> out(static_cast<std::size_t>(3 * (h / 2) * (w / 2)));
          band.forward({picture.data(), 3, h, w}, {out.data(), 3, h / 2, w / 2}, serial);
          for (double& value : out) value *= 2;
          if (along_x == WaveletPass::low && along_y == WaveletPass::low) {
            low = out;
          } else {
            bands.push_back(out);
          }
        }
      }
      picture = low;
      h /= 2;
      w /= 2;
    }
    return bands;
  };
  const auto a = bands_of(rendered), b = bands_of(target);
  double expected = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    double sum = 0;
    for (std::size_t i = 0; i < a[k].size(); ++i) sum += std::abs(a[k][i] - b[k][i]);
    expected += sum / static_cast<double>(a[k].size());
  }
  CHECK(a.size() == 6);
  CHECK(loss(rendered, target) == doctest::Approx(expected).epsilon(1e-12));
  CHECK(loss(rendered, rendered) == 0);
  std::vector<double> brighter = rendered;
  for (double& value : brighter) value += 0.25;
  CHECK(loss(brighter, rendered) < 1e-11);
  brighter[5] += 0.25;  // the control: one sample is a detail
  CHECK(loss(brighter, rendered) > 1e-4);
}
