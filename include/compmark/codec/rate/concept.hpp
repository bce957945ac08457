// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept of an EntropyModel: it predicts the probabilities of an anchor's symbols, in floating point while training
// and in whole numbers while coding. Everything that decides a symbol of a file is an integer (docs/spec/numerics.md,
// EN6); floats only choose these integers.
//
//   expression                                     meaning                                                cost
//   typename E::Scalar, E::Settings, E::Handles,   number type, run-time numbers, blocks, scratch         -
//     E::Context
//   typename E::Phase, phase.active()              what it does in an iteration; the default is nothing   -
//   typename E::Report, report.loss                the rate of a forward pass, as a loss                  -
//   E::add_parameters(arena, anchors)              its blocks; E::initialise(arena, blocks, seed)         once
//   e.forward(arena, blocks, rows, phase,          distorts the listed rows of three tables by its own    a network
//     position, feature, scaling, offset, ctx, ex) steps, and counts bits
//   e.backward(arena, blocks, rows, d_feature,     in place, as a DistortionLayer; ADDS the gradients of  a network
//     d_scaling, d_offset, ctx, ex)                its blocks
//   E::mask_opacity(arena, blocks, slot, opacity,  opacity 0 where a Gaussian's offset is left out;       a Gaussian
//     ex), mask_opacity_backward(…)                slot is anchor row * K + k
//   E::WithQuantizer<Q>                            the model with a recipe's Quantizer; may be left out    -
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/absent.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// No entropy model: no rate in the loss, and nothing that can be coded. A plain training has this.
struct NoEntropyModel : Absent<NoEntropyModel> {};

template <class E>
concept EntropyModel = E::is_absent ||
    requires(const E& model, ParameterArena<typename E::Scalar>& arena, const ParameterArena<typename E::Scalar>& read,
             const typename E::Handles& blocks, std::span<const std::uint32_t> rows, const typename E::Phase& phase,
             MatrixView<const typename E::Scalar> position, MatrixView<typename E::Scalar> table,
             typename E::Scalar* opacity, const typename E::Scalar* d_opacity, typename E::Context& context,
             SerialExecutor& executor) {
  typename E::Settings;
  { E::add_parameters(arena, std::size_t{}) } -> std::same_as<typename E::Handles>;
  E::initialise(arena, blocks, std::uint64_t{});
  { phase.active() } -> std::convertible_to<bool>;
  {
    model.forward(read, blocks, rows, phase, position, table, table, table, context, executor)
    } -> std::same_as<typename E::Report>;
  model.backward(arena, blocks, rows, table, table, table, context, executor);
  E::mask_opacity(read, blocks, rows, opacity, executor);
  E::mask_opacity_backward(arena, blocks, rows, d_opacity, d_opacity, executor);
};

}  // namespace compmark
