// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the concept accepts and what it refuses.
#include "compmark/splat/anchor/density_control.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/splat/anchor/growth.hpp"
#include "compmark/splat/anchor/no_growth.hpp"
#include "compmark/testing/archetypes.hpp"

using namespace compmark;

namespace {

using Archetype = testing::DensityControlArchetype<float>;

struct CannotPrepare : Archetype {
  void prepare(std::size_t, State&) const = delete;
};
struct ObservesNothing : Archetype {
  void observe() const;  // hides the other
};
struct ReportsNothing : Archetype {
  template <class OnEdit>
  void adapt(ParameterArena<float>&, const AnchorHandles&, State&, const AdjustmentInputs&, OnEdit&&) const {}
};
struct ChangesItself : Archetype {  // a policy is its settings: what it gathers belongs into State
  void observe(const DecodedStatistics<float>&, std::span<const std::uint8_t>, std::span<const float>, State&,
               SerialExecutor&) {}
};

}  // namespace

TEST_CASE("anchor/density_control: a policy prepares, observes and adapts, all of it const; an absence is none") {
  CHECK(DensityControl<GradientGrowth<float>>);
  CHECK(DensityControl<GradientGrowth<double>>);
  CHECK(DensityControl<Archetype>);
  CHECK_FALSE(DensityControl<CannotPrepare>);
  CHECK_FALSE(DensityControl<ObservesNothing>);
  CHECK_FALSE(DensityControl<ReportsNothing>);
  CHECK_FALSE(DensityControl<ChangesItself>);
  CHECK_FALSE(DensityControl<NoGrowth>);
}

TEST_CASE("anchor/density_control: a fresh report says that nothing was done") {
  const GrowthReport report;
  CHECK(report.grown + report.pruned + report.candidates + report.dropped_by_budget + report.non_finite +
            report.out_of_range ==
        0);
  CHECK_FALSE(report.edited);
  CHECK_FALSE(report.kept_last);
}
