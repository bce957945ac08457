// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes in place of one section of a small ContextGS file, checksums made right: the payload decoders (levels, prior, hyperprior, networks,
// chunks of all levels) and what holds them together give an answer, never a crash, and never a model that says it is verified.
#include <compmark/codec/cmk.hpp>

#include <cstdint>
#include <cstdlib>
#include <vector>

#include "support/context_gs_model.hpp"

namespace {

using namespace compmark;

std::vector<Section> whole_file(ContainerHeader& header) {
  testing::CodecModelShape tiny;
  tiny.anchors = 70;
  tiny.feature_dim = 4;
  tiny.offset_count = 2;
  tiny.chunk_anchors = 16;
  tiny.hidden = 5;
  SerialExecutor executor;
  const auto file = encode_cmk(testing::make_context_gs_model(21, tiny, 3), {}, executor);
  if (!file) std::abort();
  const auto container = parse_container(file->bytes, "");
  if (!container) std::abort();
  header = container->header;
  std::vector<Section> sections;
  for (const SectionEntry& entry : container->sections) {
    const auto raw = container->raw(entry);
    sections.push_back({entry, {raw.begin(), raw.end()}});
  }
  return sections;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static ContainerHeader header;
  static const GaussianTables tables;
  static const std::vector<Section> good = whole_file(header);
  if (size == 0) return 0;
  std::vector<Section> sections = good;
  Section& section = sections[(data[0] & 63u) % sections.size()];
  const auto bytes = std::as_bytes(std::span<const std::uint8_t>(data + 1, size - 1));
  if ((data[0] & 64u) != 0) {  // the whole payload
    section.bytes.assign(bytes.begin(), bytes.end());
  } else {  // differences, so that what follows an unchanged beginning is reached
    for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
      if (!section.bytes.empty())
        section.bytes[std::to_integer<std::size_t>(bytes[i]) * 7 % section.bytes.size()] ^= bytes[i + 1];
    }
  }
  bool changed = false;
  for (std::size_t i = 0; i < sections.size(); ++i) changed = changed || sections[i].bytes != good[i].bytes;
  SerialExecutor executor;
  const auto decoded =
      decode_cmk(write_container(header, sections), "fuzz",
                 {.salvage = (data[0] & 128u) != 0, .memory_limit = 1u << 24, .tables = &tables}, executor);
  if (!decoded && (decoded.error().problem.empty() || decoded.error().remedy.empty())) std::abort();
  if (decoded && decoded->verified && changed) std::abort();
  return 0;
}
