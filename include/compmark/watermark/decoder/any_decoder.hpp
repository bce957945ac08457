// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message decoder chosen by its file: hidden, strided or carrier, in one type that satisfies MessageDecoder. The
// choice is one branch a call, beside a network of at least a million multiply-adds. A program that knows its decoder
// names the type instead and has its sizes checked.
#pragma once

#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/decoder/carrier_decoder.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"
#include "compmark/watermark/decoder/hidden_decoder.hpp"
#include "compmark/watermark/decoder/strided_decoder.hpp"

namespace compmark {

template <class T = float, template <class> class Kernel = DirectConvolution>
class AnyDecoder {
 public:
  static constexpr bool is_absent = false;
  using Scalar = T;
  using Hidden = HiddenDecoder<0, 0, 0, T, Kernel>;
  using Strided = StridedDecoder<0, 0, 0, 0, T, Kernel>;
  using Carrier = CarrierDecoder<T, Kernel>;
  using Context = typename NetworkDecoder<T, Kernel>::Context;  ///< one for all kinds

  AnyDecoder() = default;
  /// `carriers` [bits, dimension] (carriers.hpp) are needed by a carrier file and by no other; `file` is for messages.
  [[nodiscard]] static Result<AnyDecoder> create(const DecoderWeights& weights,
                                                 const std::vector<double>& carriers = {},
                                                 const std::string& file = {}) {
    switch (weights.kind) {
      case DecoderKind::hidden:
        return hold(Hidden::create(weights, file));
      case DecoderKind::strided:
        return hold(Strided::create(weights, file));
      case DecoderKind::carrier:
        return hold(Carrier::create(weights, carriers, file));
    }
    return detail::wrong_kind("known", file);
  }

  [[nodiscard]] int bits() const { return network().bits(); }
  [[nodiscard]] int minimum_size() const { return network().minimum_size(); }
  [[nodiscard]] double logit_scale() const { return network().logit_scale(); }
  [[nodiscard]] const InputConvention& input() const { return network().input(); }

  template <Executor E>
  void forward(ImageView<const T> image, std::span<T> logits, Context& context, E& executor) const {
    network().forward(image, logits, context, executor);
  }
  template <Executor E>
  void backward(std::span<const T> d_logits, ImageView<T> d_image, Context& context, E& executor) const {
    network().backward(d_logits, d_image, context, executor);
  }

 private:
  using Network = NetworkDecoder<T, Kernel>;

  template <class D>
  [[nodiscard]] static Result<AnyDecoder> hold(Result<D> decoder) {
    if (!decoder) return decoder.error();
    AnyDecoder any;
    any.held_ = std::move(*decoder);
    return any;
  }
  [[nodiscard]] const Network& network() const {
    return std::visit([](const auto& decoder) -> const Network& { return decoder; }, held_);
  }

  std::variant<Hidden, Strided, Carrier> held_;
};

}  // namespace compmark
