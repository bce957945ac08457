// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message decoder of any kind, chosen by its file: a network (any_decoder.hpp) or a lattice (lattice_decoder.hpp), in
// one type that satisfies MessageDecoder. The tool holds one for --decoder FILE. Cost: one branch a call.
#pragma once

#include <span>
#include <utility>
#include <variant>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/decoder/any_decoder.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/decoder/decoder_reader.hpp"
#include "compmark/watermark/decoder/lattice_file.hpp"

namespace compmark {

template <class T = float, template <class> class Kernel = DirectConvolution>
class StoredDecoder {
 public:
  static constexpr bool is_absent = false;
  using Scalar = T;
  using Network = AnyDecoder<T, Kernel>;
  using Lattice = LatticeDecoder<T>;

  struct Context {
    typename Network::Context network;
    typename Lattice::Context lattice;
  };

  StoredDecoder() = default;
  /// `carriers` are needed by a carrier file and by no other (any_decoder.hpp).
  template <class TensorFile>
  [[nodiscard]] static Result<StoredDecoder> read(const TensorFile& file, const std::vector<double>& carriers = {}) {
    if (is_lattice_file(file)) {
      Result<Lattice> lattice = read_lattice<T>(file);
      if (!lattice) return lattice.error();
      return StoredDecoder(std::move(*lattice));
    }
    const Result<DecoderWeights> weights = read_decoder(file);
    if (!weights) return weights.error();
    Result<Network> network = Network::create(*weights, carriers, file.path);
    if (!network) return network.error();
    return StoredDecoder(std::move(*network));
  }

  [[nodiscard]] int bits() const {
    return visit([](const auto& decoder) { return decoder.bits(); });
  }
  [[nodiscard]] int minimum_size() const {
    return visit([](const auto& decoder) { return decoder.minimum_size(); });
  }
  [[nodiscard]] double logit_scale() const {
    return visit([](const auto& decoder) { return decoder.logit_scale(); });
  }

  template <Executor E>
  void forward(ImageView<const T> image, std::span<T> logits, Context& context, E& executor) const {
    visit([&](const auto& decoder) { decoder.forward(image, logits, part(decoder, context), executor); });
  }
  template <Executor E>
  void backward(std::span<const T> d_logits, ImageView<T> d_image, Context& context, E& executor) const {
    visit([&](const auto& decoder) { decoder.backward(d_logits, d_image, part(decoder, context), executor); });
  }

 private:
  // Built in place: assigning to a variant makes g++ 12 at -O3 warn about its other alternative.
  explicit StoredDecoder(Network network) : held_(std::in_place_type<Network>, std::move(network)) {}
  explicit StoredDecoder(Lattice lattice) : held_(std::in_place_type<Lattice>, std::move(lattice)) {}

  template <class Visit>
  decltype(auto) visit(const Visit& visitor) const {
    return std::visit(visitor, held_);
  }
  static typename Network::Context& part(const Network& /*decoder*/, Context& context) { return context.network; }
  static typename Lattice::Context& part(const Lattice& /*decoder*/, Context& context) { return context.lattice; }

  std::variant<Network, Lattice> held_;
};

}  // namespace compmark
