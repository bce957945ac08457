// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes in place of one section of a small file, checksums made right: the payload decoders of a codec and what
// holds them together give an answer, never a crash, and never a model that says it is verified.
#pragma once

#include <compmark/codec/container/cmk.hpp>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

namespace compmark::testing {

class AnySection {
 public:
  explicit AnySection(const CodecModel& model) {
    SerialExecutor executor;
    const auto file = encode_cmk(model, {}, executor);
    if (!file) std::abort();
    const auto container = parse_container(file->bytes, "");
    if (!container) std::abort();
    header_ = container->header;
    for (const SectionEntry& entry : container->sections) {
      const auto raw = container->raw(entry);
      good_.push_back({entry, {raw.begin(), raw.end()}});
    }
  }

  /// The first byte says which section, whether all of it is replaced, and whether the file is salvaged.
  void operator()(std::span<const std::byte> input) const {
    if (input.empty()) return;
    const auto choice = std::to_integer<unsigned>(input[0]);
    const auto bytes = input.subspan(1);
    std::vector<Section> sections = good_;
    const std::size_t which = (choice & 63u) % sections.size();
    std::vector<std::byte>& payload = sections[which].bytes;
    if ((choice & 64u) != 0) {
      payload.assign(bytes.begin(), bytes.end());
    } else if (!payload.empty()) {  // differences, so that what follows an unchanged beginning is reached
      for (std::size_t i = 0; i + 1 < bytes.size(); i += 2)
        payload[std::to_integer<std::size_t>(bytes[i]) * 7 % payload.size()] ^= bytes[i + 1];
    }
    SerialExecutor executor;
    CodecDecodeSettings settings;
    settings.salvage = (choice & 128u) != 0;
    settings.memory_limit = 1u << 24;
    settings.tables = &tables_;
    const std::vector<std::byte> file = write_container(header_, sections);
    const auto decoded = decode_cmk(file, "fuzz", settings, executor);
    if (!decoded && (decoded.error().problem.empty() || decoded.error().remedy.empty())) std::abort();
    if (decoded && decoded->verified && payload != good_[which].bytes) std::abort();
    settings.partial = true;  // of that file only as much as the last byte says
    const std::size_t there = file.size() * std::to_integer<std::size_t>(input.back()) / 256;
    const auto begun = decode_cmk(std::span<const std::byte>(file).first(there), "fuzz", settings, executor);
    if (begun && begun->verified) std::abort();
  }

 private:
  ContainerHeader header_;
  std::vector<Section> good_;
  GaussianTables tables_;
};

}  // namespace compmark::testing
