// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What accuracy_vs_time_codec compares: symbols with the exact Gaussian of each, and coders of them that differ from
// the shipped one in one knob. All are four interleaved rANS states over one sequence of words, as in
// codec/coder/symbol_coder.hpp; the shipped one is measured by itself.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "compmark/codec/coder/symbol_coder.hpp"
#include "compmark/codec/container/chunk_coding.hpp"
#include "compmark/core/random.hpp"

namespace codec_bench {

using namespace compmark;

template <class T>
T upper_tail(T z) {
  return T(0.5) * std::erfc(z / std::numbers::sqrt2_v<T>);
}

/// Symbols and what is known of each: mean and deviation in bins before any grid, and the shipped coder's name for
/// them.
struct SymbolSet {
  std::vector<double> mean, sigma;
  std::vector<std::int32_t> value;
  std::vector<SymbolModel> models;
  double ideal =
      0;  ///< bits a symbol: of the Gaussian, and of an escape beyond five deviations, where no coder follows it

  [[nodiscard]] std::size_t size() const { return value.size(); }
  void add(double m, double s, std::int32_t v, SymbolModel model) {
    mean.push_back(m);
    sigma.push_back(std::max(s, 0.11));  // as in training
    value.push_back(v);
    models.push_back(model);
  }
  void finish() {
    long double bits = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      const std::int64_t centre = std::llround(mean[i]), window = std::llround(std::ceil(5 * sigma[i])) + 1;
      const std::int64_t beyond = std::abs(value[i] - centre) - window;
      if (beyond > 0) {
        bits += 16 + 8 * varint_size(static_cast<std::uint64_t>(2 * beyond));
        continue;
      }
      const long double low = std::abs(value[i] - static_cast<long double>(mean[i])) - 0.5L, s = sigma[i];
      bits -= std::log2(upper_tail(low / s) - upper_tail((low + 1) / s));
    }
    ideal = static_cast<double>(bits) / static_cast<double>(size());
  }
};

/// Deviations 0.3 to 8 bins, evenly in their logarithm, means anywhere; true to their Gaussians.
inline SymbolSet synthetic_symbols(std::size_t count) {
  const Random random(1, 2, 3);
  SymbolSet set;
  for (std::size_t i = 0; i < count; ++i) {
    const double octaves = std::log2(0.3) + random.uniform(4 * i) * std::log2(8 / 0.3), s = std::exp2(octaves);
    const double m = 60 * (random.uniform(4 * i + 1) - 0.5);
    const long index = std::max(0l, std::lround(8 * octaves) - GaussianTables::least_level);
    set.add(m, s, static_cast<std::int32_t>(std::lround(m + s * random.normal(4 * i + 2))),
            {static_cast<std::uint16_t>(index), static_cast<std::int32_t>(std::lround(32 * m))});
  }
  set.finish();
  return set;
}

/// The scalars of a trained model as its file codes them, with what its finest context network says of them.
inline SymbolSet model_symbols(CodecModel model, const IntegerContext& context, std::size_t most) {
  SymbolSet set;
  const IntegerNetwork::Packed packed = context.network.pack();
  ContextEvaluator evaluator(context, packed);
  const detail::ChunkRows rows = detail::chunk_rows(model, 0, model.anchors());
  std::vector<SymbolModel> models;
  for (std::size_t first = 0; first < model.anchors() && set.size() < most; first += integer_panel) {
    const std::size_t count = std::min<std::size_t>(integer_panel, model.anchors() - first);
    evaluator.evaluate(rows.voxels.subspan(first, count));
    for (std::size_t lane = 0; lane < count; ++lane) {
      models.clear();
      detail::append_models(evaluator, context.heads, rows.mask[first + lane], lane, models);
      std::array<std::size_t, 3> column{};
      std::vector<std::size_t> unmasked;
      for (std::size_t o = 0; o < static_cast<std::size_t>(model.offset_count); ++o) {
        if ((rows.mask[first + lane] >> o & 1u) != 0) unmasked.insert(unmasked.end(), {3 * o, 3 * o + 1, 3 * o + 2});
      }
      const SymbolModel* next = models.data();
      detail::visit_scalars(
          rows, first + lane, model.offset_count, evaluator, lane, [&](int group, std::size_t, int index, float value) {
            const auto g = static_cast<std::size_t>(group);
            const std::size_t c = group == 2 ? unmasked[column[g]++] : column[g]++;
            const double mean = evaluator.outputs()[(context.heads.mean_row(group) + c) * integer_panel + lane];
            const double sigma = evaluator.outputs()[(context.heads.sigma_row(group) + c) * integer_panel + lane];
            const double step = std::exp2(index / 16.0);
            set.add(mean / (1 << IntegerNetwork::mean_bits) / step,
                    std::exp2(sigma / (8 << IntegerNetwork::sigma_bits)) / step,
                    detail::symbol_of(value, index, model.base_step[g]).first, *next++);
          });
    }
  }
  set.finish();
  return set;
}

/// What a coder needs to know of a symbol.
struct Slot {
  std::uint32_t start = 0, frequency = 0;
  std::int64_t bin = 0;  ///< from the mean's bin
  bool escape = false;
};

/// Tables of any grid: levels of the deviation an octave (a divisor of 16) and positions of the mean in a bin (a
/// divisor of 32).
template <int bits_>
class GridModel {
 public:
  static constexpr int bits = bits_;
  /// `floor`: the least frequency of a slot, 1 in files.
  GridModel(const SymbolSet& set, int per_octave, int phases, int floor = 1) : phases_(phases) {
    const NormalIntegral phi;
    const int step = 16 / per_octave, least = -(50 / step), greatest = 112 / step;
    std::vector<std::uint32_t> bounds;
    for (int level = least; level <= greatest; ++level) {
      const int window = detail::window_of(level * step);
      bounds.resize(static_cast<std::size_t>(2 * window + 2));
      for (int phase = 0; phase <= phases / 2; ++phase) {
        detail::gaussian_bounds(phi, level * step, phase * (32 / phases), window, bits, bounds);
        raise(bounds, floor);
        add(bounds, window);
      }
    }
    for (std::size_t i = 0; i < set.size(); ++i) {
      const long level = std::clamp(std::lround(std::log2(set.sigma[i]) * per_octave), long{least}, long{greatest});
      refs_.push_back({static_cast<std::uint32_t>((level - least) * (phases / 2 + 1)),
                       static_cast<std::int32_t>(std::lround(set.mean[i] * phases))});
    }
  }
  [[nodiscard]] std::size_t bytes() const { return numbers_.size() * (bits > 16 ? 4 : 2) + rows_.size() * sizeof(Row); }

  struct Place {
    const std::uint32_t* numbers;
    std::uint32_t first, bounds, shift;
    std::int32_t window;
    std::int64_t centre, mirror;
  };
  [[nodiscard]] Place place(std::size_t i) const {
    const std::int64_t mean = refs_[i].mean,
                       centre = (mean + phases_ / 2) >> std::countr_zero(static_cast<unsigned>(phases_)),
                       above = mean - centre * phases_, mirror = above >> 63;
    const Row& row = rows_[refs_[i].table + static_cast<std::uint32_t>((above ^ mirror) - mirror)];
    return {numbers_.data(), row.first, row.bounds, row.shift, row.window, centre, mirror};
  }
  [[nodiscard]] static Slot slot(const Place& at, std::uint32_t index) {
    const std::uint32_t* const bounds = at.numbers + at.bounds;
    const std::uint32_t start = index == 0 ? 0 : bounds[index - 1] + 1;
    return {start, bounds[index] - start + 1, static_cast<std::int64_t>(index) - at.window,
            index > static_cast<std::uint32_t>(2 * at.window)};
  }
  [[nodiscard]] static std::uint32_t index_at(const Place& at, std::uint32_t number) {
    const std::uint32_t* const bounds = at.numbers + at.bounds;
    std::uint32_t index = at.numbers[at.first + (number >> at.shift)];
    index += bounds[index] < number;
    index += bounds[index] < number;
    while (bounds[index] < number) ++index;
    return index;
  }

 private:
  struct Row {
    std::uint32_t first, bounds, shift;
    std::int32_t window;
  };
  struct Ref {
    std::uint32_t table;
    std::int32_t mean;
  };
  /// Gives every slot `floor` numbers before the rest is shared out, where there are so many.
  static void raise(std::span<std::uint32_t> bounds, int floor) {
    const auto slots = static_cast<std::int64_t>(bounds.size()), least = std::int64_t{floor};
    const std::int64_t spread = (std::int64_t{1} << bits) - slots, left = (std::int64_t{1} << bits) - least * slots;
    if (least == 1 || left < spread / 2) return;
    for (std::int64_t i = 0; i < slots; ++i) {
      std::uint32_t& bound = bounds[static_cast<std::size_t>(i)];
      bound = static_cast<std::uint32_t>(least * (i + 1) - 1 + ((bound - i) * left + spread / 2) / spread);
    }
  }
  void add(std::span<const std::uint32_t> bounds, int window) {
    const int search = std::min(bits, std::max(4, static_cast<int>(std::bit_width(static_cast<unsigned>(window))) + 1));
    Row row{static_cast<std::uint32_t>(numbers_.size()), 0, static_cast<std::uint32_t>(bits - search), window};
    std::uint32_t slot = 0;
    for (std::uint32_t bucket = 0; bucket < 1u << search; ++bucket) {
      while (bounds[slot] < bucket << row.shift) ++slot;
      numbers_.push_back(slot);
    }
    row.bounds = static_cast<std::uint32_t>(numbers_.size());
    numbers_.insert(numbers_.end(), bounds.begin(), bounds.end());
    rows_.push_back(row);
  }
  int phases_;
  std::vector<Row> rows_;
  std::vector<std::uint32_t> numbers_;
  std::vector<Ref> refs_;
};

/// No tables: two evaluations of erfc to encode, a binary search of them to decode, as published coders do in floats.
/// Not the same numbers on another machine (EN6).
template <class T>
class ErfcModel {
 public:
  static constexpr int bits = 16;
  explicit ErfcModel(const SymbolSet& set)
      : mean_(set.mean.begin(), set.mean.end()),
        sigma_(set.sigma.begin(), set.sigma.end()) {}
  [[nodiscard]] std::size_t bytes() const { return 0; }

  struct Place {
    T mean, inverse;
    std::int32_t window;
    std::int64_t centre, mirror = 0;
  };
  [[nodiscard]] Place place(std::size_t i) const {
    return {mean_[i], 1 / sigma_[i], static_cast<std::int32_t>(std::ceil(5 * sigma_[i])) + 1, std::llrint(mean_[i])};
  }
  [[nodiscard]] static Slot slot(const Place& at, std::uint32_t index) {
    const std::uint32_t start = index == 0 ? 0 : bound(at, index - 1) + 1;
    return {start, bound(at, index) - start + 1, static_cast<std::int64_t>(index) - at.window,
            index > static_cast<std::uint32_t>(2 * at.window)};
  }
  [[nodiscard]] static std::uint32_t index_at(const Place& at, std::uint32_t number) {
    std::uint32_t low = 0, high = static_cast<std::uint32_t>(2 * at.window + 1);
    while (low < high) {
      const std::uint32_t middle = (low + high) / 2;
      if (bound(at, middle) < number) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    return low;
  }

 private:
  /// One piece of code for both directions: a compiler may round two copies of it differently.
  [[nodiscard, gnu::noinline]] static std::uint32_t bound(const Place& at, std::uint32_t index) {
    const std::uint32_t slots = static_cast<std::uint32_t>(2 * at.window + 2), spread = (1u << bits) - slots;
    if (index + 2 >= slots) return index + spread;
    const T edge =
        (static_cast<T>(static_cast<std::int64_t>(index) - at.window + at.centre) + T(0.5) - at.mean) * at.inverse;
    return index + static_cast<std::uint32_t>(std::lrint(upper_tail(-edge) * static_cast<T>(spread)));
  }
  std::vector<T> mean_, sigma_;
};

struct Coded {
  std::vector<std::uint32_t> words;  ///< the last written first
  std::array<std::uint64_t, 4> states{};
  std::vector<std::int32_t> escapes;  ///< the last first
  std::size_t escape_bytes = 0;
  [[nodiscard]] double bits() const {
    return 32.0 * static_cast<double>(words.size()) + 8.0 * static_cast<double>(escape_bytes) + 4 * 63;
  }
};

template <class Model>
void encode_any(const Model& model, std::span<const std::int32_t> values, Coded& coded) {
  coded.words.resize(values.size() + 1);
  coded.escapes.clear();
  coded.escape_bytes = 0;
  std::uint32_t* const end = coded.words.data() + coded.words.size();
  std::uint32_t* word = end;
  const auto put = [&](std::size_t i, std::uint64_t& state) {
    const auto at = model.place(i);
    const std::int64_t bin = ((values[i] - at.centre) ^ at.mirror) - at.mirror + at.window;
    const auto last = static_cast<std::uint64_t>(2 * at.window + 1);
    const Slot slot = Model::slot(at, static_cast<std::uint32_t>(std::min(static_cast<std::uint64_t>(bin), last)));
    const unsigned full = state >= std::uint64_t{slot.frequency} << (63 - Model::bits) ? 1 : 0;
    *(word - 1) = static_cast<std::uint32_t>(state);
    word -= full;
    state >>= 32 * full;
    const std::uint64_t quotient = state / slot.frequency;
    state = (quotient << Model::bits) + (state - quotient * slot.frequency) + slot.start;
    if (slot.escape) {
      coded.escapes.push_back(values[i]);
      const std::int64_t beyond = bin < 0 ? -bin : bin - 2 * at.window;
      coded.escape_bytes += static_cast<std::size_t>(varint_size(static_cast<std::uint64_t>(2 * beyond)));
    }
  };
  std::uint64_t a = least_rans_state, b = a, c = a, d = a;
  for (std::size_t i = values.size() / 4 * 4; i != 0; i -= 4) {
    put(i - 1, d);
    put(i - 2, c);
    put(i - 3, b);
    put(i - 4, a);
  }
  coded.states = {a, b, c, d};
  std::copy(word, end, coded.words.begin());
  coded.words.resize(static_cast<std::size_t>(end - word));
}

template <class Model>
void decode_any(const Model& model, const Coded& coded, std::span<std::int32_t> values) {
  const std::uint32_t* word = coded.words.data();
  const std::int32_t* escape = coded.escapes.data() + coded.escapes.size();
  constexpr std::uint64_t numbers = (std::uint64_t{1} << Model::bits) - 1;
  const auto take = [&](std::size_t i, std::uint64_t& state) {
    const auto at = model.place(i);
    const auto number = static_cast<std::uint32_t>(state & numbers);
    const Slot slot = Model::slot(at, Model::index_at(at, number));
    state = slot.frequency * (state >> Model::bits) + number - slot.start;
    values[i] = static_cast<std::int32_t>(at.centre + (slot.bin ^ at.mirror) - at.mirror);
    if (slot.escape) values[i] = *--escape;
    const bool empty = state < least_rans_state;
    if (empty) state = state << 32 | *word;
    word += empty ? 1 : 0;
  };
  auto [a, b, c, d] = coded.states;
  for (std::size_t i = 0; i + 4 <= values.size(); i += 4) {
    take(i, a);
    take(i + 1, b);
    take(i + 2, c);
    take(i + 3, d);
  }
}

}  // namespace codec_bench
