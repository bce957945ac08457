// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept of an edit: what happens to a picture on its way to a reader, with its gradient, so that a mark is learned
// that survives it. An edit is a type without members; what is drawn of it in an iteration is a value.
//
//   expression                                        meaning                                                    cost
//   typename E::Settings                              ranges to draw from                                        -
//   typename E::Draw                                  one edit that was drawn; a default one changes nothing     -
//   typename E::template Context<T>                   what forward leaves for backward, and its output           -
//   E::draw(settings, random, first)                  a Draw; takes random numbers first ... first + 15          O(1)
//   E::forward(image, draw, context, executor)        the edited image [c, h', w'] of [c, h, w], in the context  a pass
//   E::backward(d_output, draw, d_image, context,     ADDS dL/dimage, after the forward of the same context      a pass
//     executor)
//
// Laws (tests/watermark/edit): E1 the gradient agrees with central differences in double, where the edit has one; E2
// backward adds; E3 same bits at any thread count; E4 a drawn edit is a function of the stream alone.
#pragma once

#include <concepts>
#include <cstdint>
#include <type_traits>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

template <class E>
concept PictureEdit = std::is_default_constructible_v<typename E::Draw> &&
    requires(const typename E::Settings& settings, const Random& random, ImageView<const float> image,
             ImageView<float> d_image, typename E::template Context<float>& context, SerialExecutor& executor,
             const typename E::Draw& draw) {
  { E::draw(settings, random, std::uint64_t{}) } -> std::same_as<typename E::Draw>;
  { E::forward(image, draw, context, executor) } -> std::same_as<ImageView<const float>>;
  E::backward(image, draw, d_image, context, executor);
};

/// Random numbers that an edit may take.
inline constexpr std::uint64_t random_numbers_of_an_edit = 16;

}  // namespace compmark
