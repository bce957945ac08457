// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A decoder training on disk, exactly: the arena, the optimizer's moments and step counts, the slots with their pixels.
// Random numbers are functions of (seed, iteration) and need no state, so a run that is resumed ends in the same bits.
// The settings are stored as text and compared before anything is believed. `Writer` and `TensorFile` are
// SafetensorsWriter and SafetensorsFile or their like.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/result.hpp"
#include "compmark/watermark/pretrain/trainer.hpp"

namespace compmark {

inline constexpr const char* pretrain_format = "compmark decoder training";

/// Writes a checkpoint. `identity` is all that the run depends on, as text. OptimizerState: first_moment,
/// second_moment, steps.
template <class Writer, class OptimizerState, class Path>
[[nodiscard]] Result<Done> write_pretrain_state(const ParameterArena<float>& arena, const OptimizerState& optimizer,
                                                const PretrainState<float>& state, const std::string& identity,
                                                const Path& path) {
  Writer writer;
  writer.metadata["format"] = pretrain_format;
  writer.metadata["identity"] = identity;
  const auto add = [&](const std::string& name, std::span<const float> values) {
    writer.add_values(name, {static_cast<std::int64_t>(values.size())}, values);
  };
  add("arena", arena.all_values());
  add("first_moment", optimizer.first_moment.span());
  add("second_moment", optimizer.second_moment.span());
  std::vector<std::int64_t> counts{state.iteration};
  for (const auto steps : optimizer.steps) counts.push_back(static_cast<std::int64_t>(steps));
  for (const PretrainSlot<float>& slot : state.slots) {
    counts.insert(counts.end(), {slot.age, slot.life, static_cast<std::int64_t>(slot.pixels.steps)});
  }
  writer.add_values("counts", {static_cast<std::int64_t>(counts.size())}, std::span<const std::int64_t>(counts));
  for (std::size_t i = 0; i < state.slots.size(); ++i) {
    const PretrainSlot<float>& slot = state.slots[i];
    const std::string name = "slots." + std::to_string(i) + ".";
    add(name + "original", slot.original.span());
    add(name + "signs", slot.signs);
    add(name + "change", slot.pixels.change.span());
    add(name + "first", slot.pixels.first.span());
    add(name + "second", slot.pixels.second.span());
  }
  return writer.write(path);
}

/// Reads what write_pretrain_state wrote into an arena, an optimizer state and slots that were prepared with the same
/// settings.
template <class TensorFile, class OptimizerState>
[[nodiscard]] Result<Done> read_pretrain_state(const TensorFile& file, const std::string& identity,
                                               ParameterArena<float>& arena, OptimizerState& optimizer,
                                               PretrainState<float>& state) {
  const auto wrong = [&](std::string field, std::string problem) {
    return Error{ErrorKind::invalid, file.path, std::move(field), std::move(problem),
                 "resume with the options of the run that wrote it, or start again without --resume"};
  };
  const auto format = file.metadata.find("format"), run = file.metadata.find("identity");
  if (format == file.metadata.end() || format->second != pretrain_format)
    return wrong("__metadata__.format", "is not a checkpoint of a decoder training");
  if (run == file.metadata.end() || run->second != identity)
    return wrong("__metadata__.identity", "is \"" + (run == file.metadata.end() ? std::string() : run->second) +
                                              "\", this run is \"" + identity + "\"");
  const Result<std::vector<std::int64_t>> counts = file.template values<std::int64_t>("counts");
  if (!counts) return counts.error();
  const std::size_t blocks = optimizer.steps.size();
  if (counts->size() != 1 + blocks + 3 * state.slots.size() ||
      std::any_of(counts->begin(), counts->end(), [](std::int64_t n) { return n < 0 || n > (std::int64_t{1} << 40); }))
    return wrong("counts", "are not those of this run");
  Result<Done> result = Done{};
  const auto fill = [&](const std::string& name, std::span<float> target) {
    if (!result) return;
    const auto values = file.floats(name);
    if (!values) {
      result = values.error();
    } else if (values->size() != target.size()) {
      result = wrong(name, "has another size than this run's");
    } else {
      std::copy(values->begin(), values->end(), target.begin());
    }
  };
  fill("arena", arena.all_values());
  fill("first_moment", optimizer.first_moment.span());
  fill("second_moment", optimizer.second_moment.span());
  state.iteration = (*counts)[0];
  for (std::size_t b = 0; b < blocks; ++b) optimizer.steps[b] = static_cast<std::uint64_t>((*counts)[1 + b]);
  for (std::size_t i = 0; i < state.slots.size(); ++i) {
    PretrainSlot<float>& slot = state.slots[i];
    const std::int64_t* count = counts->data() + 1 + blocks + 3 * i;
    if (count[1] < 1 || count[1] > 1 << 20 || count[0] > count[1]) return wrong("counts", "are not those of this run");
    slot.age = static_cast<int>(count[0]);
    slot.life = static_cast<int>(count[1]);
    slot.pixels.steps = static_cast<std::size_t>(count[2]);
    const std::string name = "slots." + std::to_string(i) + ".";
    fill(name + "original", slot.original.span());
    fill(name + "signs", slot.signs);
    fill(name + "change", slot.pixels.change.span());
    fill(name + "first", slot.pixels.first.span());
    fill(name + "second", slot.pixels.second.span());
  }
  return result;
}

}  // namespace compmark
