// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/model/codec_fit_settings.hpp"

#include <doctest/doctest.h>

#include <compmark/watermark/embed/base_model.hpp>

#include "support/coded_training.hpp"

namespace codec_fit_settings_test {

using namespace compmark;

/// A recipe with every network that an anchor's decoder can have.
struct AllNetworks
    : DefaultRecipe<float, DecoderShape{.feature_dim = 8, .offsets = 3, .feature_bank = true, .appearance_dim = 2}> {};
struct AllNetworksHac : recipes::Hac<AllNetworks, testing::small_grid> {};

TEST_CASE("model/codec_fit_settings: the context learns, and no number of the finished model moves") {
  testing::BlobViews views;
  ThreadExecutor executor(2);
  Trainer<AllNetworks, ThreadExecutor> first(testing::short_settings(5), views.size(), 1.0, executor);
  REQUIRE((first.initialise(testing::cloud(200, 7)).ok() && first.run(views).ok()));
  const auto fitted = [&](const TrainSettings& settings) {
    Trainer<AllNetworksHac, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    trainer.start_from(with_room_for_stages<AllNetworksHac>(first.model(), 1));
    REQUIRE(trainer.run(views).ok());
    return trainer.model();
  };
  TrainSettings settings = testing::short_settings(10);
  settings.rate.noise_after = settings.rate.context_after = 0;
  const auto before = with_room_for_stages<AllNetworksHac>(first.model(), 1),
             after = fitted(codec_fit_settings(settings));
  CHECK(testing::same_bits(base_model(after), first.model()));
  CHECK_FALSE(testing::same_bits(after, before));                                // the context did learn
  CHECK_FALSE(testing::same_bits(base_model(fitted(settings)), first.model()));  // the control
}

}  // namespace codec_fit_settings_test
