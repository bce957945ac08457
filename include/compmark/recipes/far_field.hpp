// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recipes for unbounded scenes: cells of the anchors grow with the distance from the cameras, beyond the ball that they
// stand in. Origin and radius of the ball (scene/far_field.hpp) go into TrainSettings::effects. What it brings and
// costs is measured in docs/effects.md.
#pragma once

#include "compmark/recipes/captures.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/anchor/contracted_space.hpp"

namespace compmark {

namespace recipes {

struct ScaffoldFarField : Scaffold {
  using Space = ContractedSpace;
};
struct ScaffoldFarFieldExposure : ScaffoldExposure {
  using Space = ContractedSpace;
};

}  // namespace recipes

}  // namespace compmark
