// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/patch_loss.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/testing/gradient.hpp>
#include <cstddef>
#include <vector>

#include "watermark/baselines/random_picture.hpp"

using namespace compmark;

TEST_CASE("baselines/patch_loss: its gradient, its sum over patches, and a picture that equals its target") {
  // Patches of 8: whole ones, and parts at the right and at the bottom.
  PatchLoss<double> patches;
  patches.settings.side = 8;
  const int height = 19, width = 21;
  std::vector<double> rendered = testing::random_picture(height, width, 5), gradient(rendered.size(), 0.0);
  const std::vector<double> target = testing::random_picture(height, width, 6);
  PatchLoss<double>::Context context;
  SerialExecutor serial;
  const ImageView<const double> seen{rendered.data(), 3, height, width}, wanted{target.data(), 3, height, width};
  std::vector<double> ignored(rendered.size());
  const auto loss = [&] {
    return 0.7 * patches.forward_backward(seen, wanted, 0.7, {ignored.data(), 3, height, width}, context, serial);
  };
  patches.forward_backward(seen, wanted, 0.7, {gradient.data(), 3, height, width}, context, serial);
  CHECK(testing::gradient_law(loss, rendered, gradient) == "");
  std::vector<double> wrong = gradient;
  for (double& value : wrong) value *= 1.01;
  CHECK(testing::gradient_law(loss, rendered, wrong) != "");
  // Gradients are added.
  std::vector<double> twice = gradient;
  patches.forward_backward(seen, wanted, 0.7, {twice.data(), 3, height, width}, context, serial);
  for (std::size_t i = 0; i < twice.size(); ++i) CHECK(twice[i] == doctest::Approx(2 * gradient[i]).epsilon(1e-12));

  // Of a picture that equals its target only the total variation is left, and a flat one has none.
  const double alone = patches.forward_backward(wanted, wanted, 1, {ignored.data(), 3, height, width}, context, serial);
  PatchLoss<double> plain = patches;
  plain.settings.total_variation = 0;
  CHECK(plain.forward_backward(wanted, wanted, 1, {ignored.data(), 3, height, width}, context, serial) ==
        doctest::Approx(0).epsilon(1e-12));
  CHECK(alone > 0);
  const std::vector<double> flat(rendered.size(), 0.5);
  const ImageView<const double> even{flat.data(), 3, height, width};
  CHECK(patches.forward_backward(even, even, 1, {ignored.data(), 3, height, width}, context, serial) ==
        doctest::Approx(0).epsilon(1e-12));

  // L1 alone is the whole picture's mean times its patches, parts counted by their pixels.
  PatchLoss<double> differences;
  differences.settings = {1, 0, 0, 8};
  double mean = 0;
  for (std::size_t i = 0; i < target.size(); ++i) mean += std::abs(rendered[i] - target[i]);
  mean /= static_cast<double>(target.size());
  CHECK(differences.forward_backward(seen, wanted, 1, {ignored.data(), 3, height, width}, context, serial) ==
        doctest::Approx(mean * height * width / 64.0).epsilon(1e-9));
}
