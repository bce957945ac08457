// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A chunk of symbols (symbol_coder.hpp) symbol by symbol, for contexts that read what has been decoded: the model of a
// symbol may depend on all symbols before it. The bytes are the same. Cost: ~15 ns a symbol; where no model depends on
// a symbol, decode_symbols() is twice as fast.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "compmark/codec/coder/symbol_coder.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

template <class Tables>
class SymbolReader {
 public:
  /// Both must outlive this.
  SymbolReader(const Tables& tables, std::span<const std::uint8_t> chunk)
      : tables_(tables),
        parts_(detail::chunk_parts(chunk)) {
    if (parts_) {
      states_ = parts_->states;
      words_ = parts_->words;
      escapes_ = parts_->escapes;
    }
  }

  /// An error where the header is damaged or the chunk does not hold `symbols` symbols.
  [[nodiscard]] Result<Done> check(std::size_t symbols) const {
    if (!parts_) return parts_.error();
    if (parts_->symbols != symbols) {
      return detail::bad_chunk(ErrorKind::invalid, "it holds " + std::to_string(parts_->symbols) + " symbols, not " +
                                                       std::to_string(symbols));
    }
    return Done{};
  }

  /// The next symbol. After the end, or in a damaged chunk, it means nothing, and finish() says so.
  [[nodiscard]] std::int32_t next(const SymbolModel& model) {
    std::uint64_t& state = states_[count_++ % detail::rans_states];
    const SlotTables::Place at = tables_.place(model);
    const std::uint32_t number = rans_number(state), slot = tables_.slot_of(*at.table, number);
    const SlotTables::Interval interval = tables_.interval(*at.table, slot);
    state = rans_take(state, interval.start, interval.frequency);
    if (state < least_rans_state) {
      if (words_.empty()) {
        whole_ = false;
        state |= least_rans_state;
      } else {
        state = state << 32 | detail::load_word(words_.data());
        words_ = words_.subspan(4);
      }
    }
    const std::int64_t bin = static_cast<std::int64_t>(slot) - at.table->window;
    if (bin <= at.table->window) return static_cast<std::int32_t>(at.centre + (bin ^ at.mirror) - at.mirror);
    const std::optional<std::uint64_t> code = take_varint(escapes_);
    const std::optional<std::int32_t> symbol = code ? detail::escaped_symbol(at, *code) : std::nullopt;
    whole_ = whole_ && symbol.has_value();
    return symbol.value_or(0);
  }

  /// `symbols` is all that next() has given: an error where they are not those of the encoder.
  [[nodiscard]] Result<Done> finish(std::span<const std::int32_t> symbols) const {
    if (const Result<Done> checked = check(symbols.size()); !checked) return checked;
    if (symbols.empty()) return Done{};
    if (!whole_ || !words_.empty() || !escapes_.empty() || states_ != detail::first_states(symbols))
      return detail::bad_chunk(ErrorKind::malformed, "its symbols do not end where they began");
    return Done{};
  }

 private:
  const Tables& tables_;
  Result<detail::ChunkParts> parts_;
  std::array<std::uint64_t, detail::rans_states> states_{};
  std::span<const std::uint8_t> words_, escapes_;
  std::size_t count_ = 0;
  bool whole_ = true;
};

}  // namespace compmark
