// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One learning-rate schedule for the four blocks of a two-layer network. Cost: none.
#pragma once

#include "compmark/core/parameters.hpp"

namespace compmark::detail {

template <class Scalar, class Network>
void set_network_schedule(ParameterArena<Scalar>& arena, const Network& network, const LearningSchedule& schedule) {
  for (const BlockHandle handle : {network.weight1, network.bias1, network.weight2, network.bias2}) {
    arena.set_schedule(handle, schedule);
  }
}

}  // namespace compmark::detail
