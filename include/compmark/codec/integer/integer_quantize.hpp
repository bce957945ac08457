// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// From the float context network of training to the integer one of the file. The constants of standardisation go into
// the second layer's weights, mean = m + d out and sigma = d 2^out, in units of Q0, so that coding knows nothing of
// them. Each row gets the largest power of two that keeps its weights in the bits asked for and its worst sum in 32.
// This may use floats: what it makes is stored, not remade.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/integer/integer_network.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

/// The float network: inputs -> hidden -> 2 (D + 6 + 3 K) + 3, row-major [out][in], and the constants [2][D + 6 + 3 K]
/// (means, deviations).
struct FloatContext {
  std::size_t inputs = 0, hidden = 0;
  std::span<const float> weight1, bias1, weight2, bias2, statistics;
};

/// Bits of weights, sign included, 2 … 16. Parts differ: on a trained lego 5 to 7 are enough for all but the means of
/// scales, which need 13 (codec/container/network_choice.hpp finds out). The three rows of the steps always have at
/// least 12.
struct WeightBits {
  int hidden = 12;                      ///< first layer
  std::array<int, 3> mean{12, 12, 12};  ///< second layer, by attribute group
  std::array<int, 3> deviation{12, 12, 12};

  [[nodiscard]] static constexpr WeightBits all(int bits) { return {bits, {bits, bits, bits}, {bits, bits, bits}}; }
  [[nodiscard]] constexpr bool valid() const {
    bool good = hidden >= 2 && hidden <= 16;
    for (std::size_t g = 0; g < 3; ++g)
      good = good && mean[g] >= 2 && mean[g] <= 16 && deviation[g] >= 2 && deviation[g] <= 16;
    return good;
  }
};

struct IntegerNetworkSettings {
  WeightBits bits;
  std::array<double, 3> base_step{1, 0.001, 0.2};
  int input_bits = IntegerHashGrid::activation_bits;  ///< fraction bits of the inputs
  /// The greatest input there is, and one that all inputs of an anchor seldom reach together: beyond it hidden units
  /// may be clipped.
  std::int64_t most_input = std::int64_t{1} << IntegerHashGrid::activation_bits, usual_input = most_input;
};

namespace detail {

/// Rounds one row to integers. `unit[i]`: what one unit of input i is worth; `most[i]`: its largest value. Returns the
/// row's exponent e: one unit of the sum is worth 2^-e.
[[nodiscard]] inline int quantize_row(std::span<const double> weight, double bias, std::span<const double> unit,
                                      std::span<const std::int64_t> most, int weight_bits, int most_exponent,
                                      std::int16_t* out, std::int32_t& out_bias) {
  const std::int64_t greatest = (std::int64_t{1} << (weight_bits - 1)) - 1;
  constexpr std::int64_t sum_limit = std::numeric_limits<std::int32_t>::max();
  for (int exponent = most_exponent;; --exponent) {
    const double scaled_bias = std::ldexp(bias, exponent);
    if (std::abs(scaled_bias) > 0x1p30) continue;
    std::int64_t sum = std::abs(std::llround(scaled_bias));
    bool fits = true;
    for (std::size_t i = 0; fits && i < weight.size(); ++i) {
      const double scaled = std::ldexp(weight[i] * unit[i], exponent);
      // A hair more is the greatest itself, from float_network().
      fits = std::abs(scaled) <= static_cast<double>(greatest) * (1 + 0x1p-20);
      if (!fits) break;
      const std::int64_t rounded = std::llround(scaled);
      out[i] = static_cast<std::int16_t>(rounded);
      sum += std::abs(rounded) * most[i];
      fits = sum <= sum_limit;
    }
    if (!fits) continue;
    out_bias = static_cast<std::int32_t>(std::llround(scaled_bias));
    return exponent;
  }
}

/// Output row o of the integer network is scale * (the float network's) + offset, with `bits` fraction bits.
struct OutputUnit {
  double scale = 1, offset = 0;
  int bits = IntegerNetwork::r_bits, weight_bits = 12;
};
[[nodiscard]] inline OutputUnit output_unit(std::size_t o, const ContextHeads& heads, std::span<const float> statistics,
                                            const IntegerNetworkSettings& settings) {
  OutputUnit unit;
  unit.weight_bits = std::max(settings.bits.hidden, 12);
  for (int group = 0; group < 3; ++group) {
    const auto g = static_cast<std::size_t>(group);
    const std::size_t width = heads.width(group),
                      first = group == 0 ? 0 : heads.width(0) + (group == 2 ? heads.width(1) : 0);
    const auto deviation = [&](std::size_t c) {
      return std::max(static_cast<double>(statistics[heads.channels() + first + c]) / settings.base_step[g], 0x1p-16);
    };
    if (o >= heads.mean_row(group) && o < heads.mean_row(group) + width) {
      const std::size_t c = o - heads.mean_row(group);
      unit = {deviation(c), static_cast<double>(statistics[first + c]) / settings.base_step[g],
              IntegerNetwork::mean_bits, settings.bits.mean[g]};
    } else if (o >= heads.sigma_row(group) && o < heads.sigma_row(group) + width) {
      unit = {8, 8 * std::log2(deviation(o - heads.sigma_row(group))), IntegerNetwork::sigma_bits,
              settings.bits.deviation[g]};
    }
  }
  return unit;
}

}  // namespace detail

[[nodiscard]] inline Result<IntegerNetwork> quantize_network(const FloatContext& context, const ContextHeads& heads,
                                                             const IntegerNetworkSettings& settings) {
  const auto fail = [](std::string field, std::string problem) {
    return Error{ErrorKind::invalid, "", std::move(field), std::move(problem), "train the context again"};
  };
  const std::size_t inputs = context.inputs, hidden = context.hidden, channels = heads.channels();
  if (!settings.bits.valid()) return fail("bits", "must be 2 to 16");
  if (context.weight1.size() != hidden * inputs || context.bias1.size() != hidden ||
      context.weight2.size() != heads.outputs() * hidden || context.bias2.size() != heads.outputs() ||
      context.statistics.size() != 2 * channels) {
    return fail("context", "its tensors do not have the sizes of the attributes");
  }
  for (const auto& tensor : {context.weight1, context.bias1, context.weight2, context.bias2, context.statistics}) {
    for (const float value : tensor) {
      if (!std::isfinite(value) || std::abs(value) > 0x1p40f)
        return fail("context", "holds a value that is not finite or above 2^40");
    }
  }

  IntegerNetwork network;
  network.hidden.inputs = inputs;
  network.hidden.outputs = hidden;
  network.output.inputs = hidden;
  network.output.outputs = heads.outputs();
  for (IntegerLayer* layer : {&network.hidden, &network.output}) {
    layer->weight.resize(layer->inputs * layer->outputs);
    layer->bias.resize(layer->outputs);
    layer->shift.resize(layer->outputs);
  }

  // First layer: hidden unit j is stored in units of 2^-f_j, as fine as its own worst case allows.
  const std::vector<double> unit1(inputs, std::ldexp(1.0, -settings.input_bits));
  const std::vector<std::int64_t> most1(inputs, settings.most_input), usual1(inputs, settings.usual_input);
  std::vector<double> row(std::max(inputs, hidden)), unit2(hidden);
  std::vector<std::int64_t> most2(hidden);
  for (std::size_t j = 0; j < hidden; ++j) {
    for (std::size_t i = 0; i < inputs; ++i) row[i] = context.weight1[j * inputs + i];
    const int exponent =
        detail::quantize_row(std::span(row).first(inputs), context.bias1[j], unit1, most1, settings.bits.hidden, 40,
                             network.hidden.weight.data() + j * inputs, network.hidden.bias[j]);
    const std::int64_t most = IntegerNetwork::most_sum(network.hidden, j, most1),
                       usual = IntegerNetwork::most_sum(network.hidden, j, usual1);
    int shift = 0;
    while (round_shift(usual, shift) > IntegerNetwork::greatest_hidden) ++shift;
    network.hidden.shift[j] = static_cast<std::int8_t>(shift);
    unit2[j] = std::ldexp(1.0, shift - exponent);
    most2[j] = std::min<std::int64_t>(round_shift(most, shift), IntegerNetwork::greatest_hidden);
  }

  // Second layer, the outputs in the units of coding.
  for (std::size_t o = 0; o < heads.outputs(); ++o) {
    const detail::OutputUnit unit = detail::output_unit(o, heads, context.statistics, settings);
    for (std::size_t j = 0; j < hidden; ++j) row[j] = unit.scale * static_cast<double>(context.weight2[o * hidden + j]);
    const int exponent = detail::quantize_row(
        std::span(row).first(hidden), unit.scale * static_cast<double>(context.bias2[o]) + unit.offset, unit2, most2,
        unit.weight_bits, unit.bits + 31, network.output.weight.data() + o * hidden, network.output.bias[o]);
    if (exponent - unit.bits < -24) return fail("context", "an output is too large to be coded");
    network.output.shift[o] = static_cast<std::int8_t>(exponent - unit.bits);
  }
  const Result<Done> checked = network.check(inputs, heads, settings.most_input);
  if (!checked) return checked.error();
  return network;
}

/// The weights of a float network in the form that FloatContext has.
struct FloatNetwork {
  std::vector<float> weight1, bias1, weight2, bias2;
};

/// A float network with the outputs of the integer one, up to the rounding of its hidden units and outputs. Its hidden
/// units are in the integers' units (a factor that ReLU lets pass). With the same bits, quantize_network makes the same
/// integers from it again, except for the last bits of biases above 2^24, which a float does not hold. `statistics` and
/// `settings` are the same there.
[[nodiscard]] inline FloatNetwork float_network(const IntegerNetwork& network, const ContextHeads& heads,
                                                std::span<const float> statistics,
                                                const IntegerNetworkSettings& settings) {
  const std::size_t inputs = network.hidden.inputs, hidden = network.hidden.outputs, outputs = network.output.outputs;
  FloatNetwork floats{std::vector<float>(hidden * inputs), std::vector<float>(hidden),
                      std::vector<float>(outputs * hidden), std::vector<float>(outputs)};
  for (std::size_t j = 0; j < hidden; ++j) {
    const int shift = network.hidden.shift[j];
    for (std::size_t i = 0; i < inputs; ++i) {
      floats.weight1[j * inputs + i] =
          std::ldexp(static_cast<float>(network.hidden.weight[j * inputs + i]), settings.input_bits - shift);
    }
    floats.bias1[j] = static_cast<float>(std::ldexp(static_cast<double>(network.hidden.bias[j]), -shift));
  }
  for (std::size_t o = 0; o < outputs; ++o) {
    const detail::OutputUnit unit = detail::output_unit(o, heads, statistics, settings);
    const int exponent = -network.output.shift[o] - unit.bits;
    for (std::size_t j = 0; j < hidden; ++j) {
      const double weight = std::ldexp(static_cast<double>(network.output.weight[o * hidden + j]), exponent);
      floats.weight2[o * hidden + j] = static_cast<float>(weight / unit.scale);
    }
    const double bias = std::ldexp(static_cast<double>(network.output.bias[o]), exponent);
    floats.bias2[o] = static_cast<float>((bias - unit.offset) / unit.scale);
  }
  return floats;
}

}  // namespace compmark
