// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/testing/gaussian_decoder_laws.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "compmark/splat/anchor/mlp_decoder.hpp"
#include "compmark/splat/anchor/reference_decoder.hpp"
#include "compmark/testing/archetypes.hpp"

namespace gaussian_decoder_laws_test {
namespace {

using namespace compmark;
constexpr DecoderShape shape{.feature_dim = 8, .offsets = 3, .distance = true, .appearance_dim = 2};
using Plain = testing::GaussianDecoderArchetype<double, shape>;
using Rows = std::span<const std::uint32_t>;

// Negative controls: one law each is broken.
struct HalfGradient : Plain {
  template <Executor E>
  void backward(const AnchorColumns<const double>& anchors, Rows visible, const std::array<double, 3>& center,
                std::size_t view, ParameterArena<double>& arena, const Handles& blocks,
                const GaussianColumns<const double>& d_gaussians, const AnchorColumns<double>& d_anchors,
                Context& context, E& executor) const {
    Plain::backward(anchors, visible, center, view, arena, blocks, d_gaussians, d_anchors, context, executor);
    for (double& value : d_anchors.position.flat()) value *= 0.5;
  }
};
struct TouchesAll : Plain {
  template <Executor E>
  void backward(const AnchorColumns<const double>& anchors, Rows visible, const std::array<double, 3>& center,
                std::size_t view, ParameterArena<double>& arena, const Handles& blocks,
                const GaussianColumns<const double>& d_gaussians, const AnchorColumns<double>& d_anchors,
                Context& context, E& executor) const {
    Plain::backward(anchors, visible, center, view, arena, blocks, d_gaussians, d_anchors, context, executor);
    d_anchors.feature(1, 0) += 1e-9;
  }
};
template <int fault>
struct Faulty : Plain {
  template <Executor E>
  std::size_t forward(const AnchorColumns<const double>& anchors, Rows visible, const std::array<double, 3>& center,
                      std::size_t view, const ParameterArena<double>& arena, const Handles& blocks,
                      GaussianBatch<double>& batch, Context& context, E& executor) const {
    const std::size_t count = Plain::forward(anchors, visible, center, view, arena, blocks, batch, context, executor);
    if (fault == 3) batch.columns().color[0][0] += 1e-6 * static_cast<double>(executor.concurrency());
    if (fault == 4) batch.columns().opacity[0] = context.opacity_sum[0] = -0.1;
    if (fault == 5) context.slot[1] = context.slot[0];
    if (fault == 6) context.opacity_sum[0] = 2;
    return count;
  }
};

template <class D>
bool breaks(const char* law) {
  return testing::gaussian_decoder_laws(D{}).find(law) != std::string::npos;
}

}  // namespace

TEST_CASE("testing/gaussian_decoder_laws: hold for every Gaussian decoder that is shipped, and for the archetype") {
  CHECK(testing::gaussian_decoder_laws(MlpDecoder<double, shape>{}) == "");
  CHECK(testing::gaussian_decoder_laws(ReferenceDecoder<double, shape>{}) == "");
  CHECK(testing::gaussian_decoder_laws(Plain{}) == "");
}

TEST_CASE("testing/gaussian_decoder_laws: each law is seen to be broken") {
  CHECK(breaks<HalfGradient>("A1"));
  CHECK(breaks<TouchesAll>("A2"));
  CHECK(breaks<Faulty<3>>("A3"));
  CHECK(breaks<Faulty<4>>("A4: a Gaussian has an opacity"));
  CHECK(breaks<Faulty<5>>("A4: two Gaussians of one slot"));
  CHECK(breaks<Faulty<6>>("A4: opacity_sum"));
  CHECK(testing::gaussian_decoder_laws(Faulty<0>{}) == "");
}

}  // namespace gaussian_decoder_laws_test
