// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The context network in whole numbers (docs/spec/compression.md, 3.2, point 3): activations and weights of 16 bits,
// sums of 32, a shift for every row so that each row uses its bits, ReLU, shifts that round. A check at load shows that
// no input can overflow a sum; then no order of summation, thread count or compiler can change a bit of an output.
// Outputs an anchor: means in units of Q0 (Q12), 8 log2(sigma / Q0) (Q8), r (Q16). Cost: 0.5-1 us an anchor for 96 ->
// 100 -> 175.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/integer/integer_dot.hpp"
#include "compmark/codec/integer/integer_functions.hpp"
#include "compmark/codec/integer/integer_hash_grid.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

/// y = round((W x + b) / 2^shift), a shift a row.
struct IntegerLayer {
  std::size_t inputs = 0, outputs = 0;
  std::vector<std::int16_t> weight;  ///< [outputs][inputs]
  std::vector<std::int32_t> bias;    ///< in units of the sum
  std::vector<std::int8_t> shift;    ///< negative: to the left

  friend bool operator==(const IntegerLayer&, const IntegerLayer&) = default;
};

/// The heads of the network's output, by attribute group: feature, scale, offset.
struct ContextHeads {
  int feature = 0, scale = 6, offset = 0;  ///< D, 6, 3 K

  [[nodiscard]] std::size_t channels() const { return static_cast<std::size_t>(feature + scale + offset); }
  [[nodiscard]] std::size_t outputs() const { return 2 * channels() + 3; }
  [[nodiscard]] std::size_t width(int group) const {
    return static_cast<std::size_t>(group == 0 ? feature : group == 1 ? scale : offset);
  }
  /// Row of the first mean of a group; its log2 sigma follow behind the means.
  [[nodiscard]] std::size_t mean_row(int group) const {
    return group == 0 ? 0 : 2 * width(0) + (group == 2 ? 2 * width(1) : 0);
  }
  [[nodiscard]] std::size_t sigma_row(int group) const { return mean_row(group) + width(group); }
  [[nodiscard]] std::size_t r_row(int group) const { return 2 * channels() + static_cast<std::size_t>(group); }
};

class IntegerNetwork {
 public:
  static constexpr int mean_bits = 12, sigma_bits = 8, r_bits = StepGrid::r_bits;  ///< fraction bits of the outputs
  static constexpr std::int32_t greatest_hidden = std::numeric_limits<std::int16_t>::max();
  static constexpr std::size_t most_hidden_units = 4096;

  IntegerLayer hidden, output;

  /// The problem with these numbers, for any inputs up to `most`; none if there is no problem.
  [[nodiscard]] Result<Done> check(std::size_t inputs, const ContextHeads& heads,
                                   std::int64_t most = std::int64_t{1} << IntegerHashGrid::activation_bits) const {
    const auto fail = [](std::string problem) {
      return Error{ErrorKind::invalid, "", "NETC", std::move(problem), "encode the model again"};
    };
    if (hidden.inputs != inputs || hidden.outputs == 0 || output.inputs != hidden.outputs ||
        output.outputs != heads.outputs()) {
      return fail("the network's layers do not fit what they read or the attributes");
    }
    if (hidden.outputs > most_hidden_units) return fail("more hidden units than a file has room for");
    for (const IntegerLayer* layer : {&hidden, &output}) {
      if (layer->weight.size() != layer->inputs * layer->outputs || layer->bias.size() != layer->outputs ||
          layer->shift.size() != layer->outputs) {
        return fail("a layer's weights, biases or shifts are incomplete");
      }
    }
    const std::vector<std::int64_t> most_of_units = most_hidden(most);
    for (std::size_t row = 0; row < hidden.outputs; ++row) {
      if (most_of_units[row] < 0 || hidden.shift[row] < 0 || hidden.shift[row] > 31)
        return fail("row " + std::to_string(row) + " of the first layer could overflow");
    }
    for (std::size_t row = 0; row < output.outputs; ++row) {
      if (most_sum(output, row, most_of_units) < 0 || output.shift[row] < -24 || output.shift[row] > 31) {
        return fail("row " + std::to_string(row) + " of the second layer could overflow");
      }
    }
    return Done{};
  }

  /// Largest |sum| of a row, its rounding included, for inputs up to `most`; -1 when it does not fit 32 bits.
  [[nodiscard]] static std::int64_t most_sum(const IntegerLayer& layer, std::size_t row,
                                             std::span<const std::int64_t> most) {
    std::int64_t sum = std::abs(std::int64_t{layer.bias[row]});
    for (std::size_t i = 0; i < layer.inputs; ++i) {
      const std::int64_t weight = layer.weight[row * layer.inputs + i];
      if (weight == std::numeric_limits<std::int16_t>::min()) return -1;
      sum += std::abs(weight) * most[i];
    }
    return sum <= std::numeric_limits<std::int32_t>::max() ? sum : -1;
  }

  /// Largest value of each hidden unit, for inputs up to `most`; -1 where a sum does not fit 32 bits.
  [[nodiscard]] std::vector<std::int64_t> most_hidden(std::int64_t most) const {
    const std::vector<std::int64_t> most_input(hidden.inputs, most);
    std::vector<std::int64_t> units(hidden.outputs);
    for (std::size_t row = 0; row < hidden.outputs; ++row) {
      const std::int64_t sum = most_sum(hidden, row, most_input);
      const int shift = std::clamp<int>(hidden.shift[row], 0, 31);
      units[row] = sum < 0 ? -1 : std::min<std::int64_t>(round_shift(sum, shift), greatest_hidden);
    }
    return units;
  }

  /// Scratch of one worker.
  struct Panel {
    std::vector<std::int16_t> input, hidden;  ///< [channel / 2][lane][2]
    std::vector<std::int32_t> output;         ///< [row][lane]
  };
  /// Room for weights padded to the kernel's blocks; made once from the layers, shared by all workers.
  struct Packed {
    std::vector<std::int16_t> weight1, weight2;
    std::size_t pairs1 = 0, pairs2 = 0, rows1 = 0, rows2 = 0;
  };
  [[nodiscard]] Packed pack() const {
    Packed p;
    p.pairs1 = (hidden.inputs + 1) / 2;
    p.pairs2 = (hidden.outputs + 1) / 2;
    p.rows1 = (hidden.outputs + 3) / 4 * 4;
    p.rows2 = (output.outputs + 3) / 4 * 4;
    p.weight1 = padded(hidden, p.rows1, p.pairs1);
    p.weight2 = padded(output, p.rows2, p.pairs2);
    return p;
  }

  /// panel.input -> panel.output for all lanes.
  void evaluate(const Packed& packed, Panel& panel) const {
    panel.hidden.assign(packed.pairs2 * 2 * integer_panel, 0);
    panel.output.resize(packed.rows2 * integer_panel);
    std::int32_t sums[4][integer_panel];
    for (std::size_t row = 0; row < packed.rows1; row += 4) {
      detail::integer_dot(packed.weight1.data() + row * 2 * packed.pairs1, 2 * packed.pairs1, panel.input.data(),
                          packed.pairs1, sums);
      for (std::size_t r = 0; r < 4 && row + r < hidden.outputs; ++r) {
        const std::int32_t bias = hidden.bias[row + r], shift = hidden.shift[row + r];
        const std::int64_t half = shift == 0 ? 0 : std::int64_t{1} << (shift - 1);
        std::int16_t* const out = panel.hidden.data() + (row + r) / 2 * 2 * integer_panel + (row + r) % 2;
        for (std::size_t lane = 0; lane < integer_panel; ++lane) {
          const std::int64_t value = (std::int64_t{sums[r][lane] + bias} + half) >> shift;
          out[2 * lane] = static_cast<std::int16_t>(std::clamp<std::int64_t>(value, 0, greatest_hidden));
        }
      }
    }
    for (std::size_t row = 0; row < packed.rows2; row += 4) {
      detail::integer_dot(packed.weight2.data() + row * 2 * packed.pairs2, 2 * packed.pairs2, panel.hidden.data(),
                          packed.pairs2, sums);
      for (std::size_t r = 0; r < 4 && row + r < output.outputs; ++r) {
        const std::int32_t bias = output.bias[row + r], shift = output.shift[row + r];
        std::int32_t* const out = panel.output.data() + (row + r) * integer_panel;
        for (std::size_t lane = 0; lane < integer_panel; ++lane) {
          const std::int64_t value = round_shift(std::int64_t{sums[r][lane] + bias}, shift);
          out[lane] = static_cast<std::int32_t>(std::clamp<std::int64_t>(value, -output_limit, output_limit));
        }
      }
    }
  }

  friend bool operator==(const IntegerNetwork& a, const IntegerNetwork& b) {
    return a.hidden == b.hidden && a.output == b.output;
  }

 private:
  static constexpr std::int64_t output_limit = std::numeric_limits<std::int32_t>::max();

  [[nodiscard]] static std::vector<std::int16_t> padded(const IntegerLayer& layer, std::size_t rows,
                                                        std::size_t pairs) {
    std::vector<std::int16_t> weight(rows * 2 * pairs, 0);
    for (std::size_t row = 0; row < layer.outputs; ++row) {
      std::copy_n(layer.weight.data() + row * layer.inputs, layer.inputs, weight.data() + row * 2 * pairs);
    }
    return weight;
  }
};

}  // namespace compmark
