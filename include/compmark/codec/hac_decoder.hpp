// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The bytes of a HAC file to a model. Nothing is believed before its checksum, no memory is taken before the limits, and nothing that looks
// plausible comes out of a damaged file: it is refused with the section and the remedy, or, with `salvage`, the anchors of damaged chunks are
// left out and listed. Chunks decode in parallel; the result does not depend on the number of threads. Cost: ~2 us an anchor and core.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/codec_model.hpp"
#include "compmark/codec/container.hpp"
#include "compmark/codec/geometry.hpp"
#include "compmark/codec/hac_chunk.hpp"
#include "compmark/codec/hac_digest.hpp"
#include "compmark/codec/hac_format.hpp"
#include "compmark/codec/network_coding.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"

namespace compmark::inline v0 {

struct HacDecodeSettings {
  bool salvage = false;  ///< leave out the anchors of damaged chunks instead of refusing the file
  std::uint64_t memory_limit = std::uint64_t{1} << 34;  ///< bytes of the decoded arrays
  const GaussianTables* tables = nullptr;               ///< made anew if there are none, 1 ms
};

struct HacDecoded {
  CodecModel model;
  ContainerHeader header;
  std::vector<std::pair<std::uint32_t, Error>> damaged;  ///< chunks that were left out (salvage), and why
  std::uint64_t lost_anchors = 0;
  std::vector<std::string> lost_sections;  ///< of others, damaged and left out (salvage)
  bool verified = false;  ///< the digest of the whole model was right; cannot be when anchors were lost
};

namespace detail {

[[nodiscard]] inline bool known_section(std::uint32_t kind) {
  return std::find(HacFormat::known.begin(), HacFormat::known.end(), kind) != HacFormat::known.end();
}
/// Decoding can go on without it.
[[nodiscard]] inline bool can_be_lost(const SectionEntry& entry) {
  return entry.kind == HacFormat::mask || entry.kind == HacFormat::stream || !known_section(entry.kind);
}

/// Checks what the table of contents promises, before any payload is looked at.
[[nodiscard]] inline Result<Done> check_hac_sections(const Container& file) {
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return file.error(kind, std::move(field), std::move(problem), std::move(remedy));
  };
  if (file.header.profile != ContainerProfile::hac) {
    return fail(ErrorKind::unsupported, "profile",
                std::to_string(static_cast<std::uint32_t>(file.header.profile)) + " is not that of HAC, 1",
                "decode it with a program that knows its codec");
  }
  if (file.header.numeric_spec != HacFormat::numeric_spec) {
    return fail(
        ErrorKind::unsupported, "numeric specification",
        std::to_string(file.header.numeric_spec) + ", this program has " + std::to_string(HacFormat::numeric_spec),
        "decode it with the version that wrote it");
  }
  for (const SectionEntry& entry : file.sections) {
    const bool known = known_section(entry.kind);
    if (!known && entry.critical()) {
      return fail(ErrorKind::unsupported, entry.name(), "is needed for decoding, and this program does not know it",
                  "decode it with a newer version");
    }
    if (!known) continue;
    if (entry.version != 1 || entry.method != 0) {
      return fail(ErrorKind::unsupported, entry.name(),
                  "version " + std::to_string(entry.version) + ", method " + std::to_string(entry.method) +
                      "; this program reads 1, 0",
                  "decode it with a newer version");
    }
    const bool chunked = entry.kind == HacFormat::mask || entry.kind == HacFormat::stream;
    if (entry.part != 0 || (!chunked && entry.chunk != 0)) {
      return fail(ErrorKind::malformed, entry.name(), "has a number that this section does not have",
                  "copy the file again");
    }
  }
  return Done{};
}

}  // namespace detail

/// `path` is for messages.
template <Executor E>
[[nodiscard]] Result<HacDecoded> decode_hac(std::span<const std::byte> bytes, const std::string& path,
                                            const HacDecodeSettings& settings, E& executor) {
  const Result<Container> parsed = parse_container(bytes, path);
  if (!parsed) return parsed.error();
  const Container& file = *parsed;
  const Result<Done> promised = detail::check_hac_sections(file);
  if (!promised) return promised.error();
  const auto located = [&](Error error) {
    error.file = path;
    return error;
  };
  const auto section = [&](std::uint32_t kind) -> Result<std::span<const std::byte>> {
    const SectionEntry* entry = file.find(kind);
    if (entry == nullptr) {
      return file.error(ErrorKind::malformed, section_name(kind), "is missing", "copy the file again");
    }
    return file.raw(*entry);
  };
  // Checksums first, all of them: nothing below reads a byte that is not as it was written.
  std::vector<std::uint8_t> intact(file.sections.size(), 1);
  for (std::size_t i = 0; i < intact.size(); ++i) {
    const SectionEntry& entry = file.sections[i];
    const auto payload = file.payload(entry);
    if (payload) continue;
    if (!settings.salvage || !detail::can_be_lost(entry)) return payload.error();
    intact[i] = 0;
  }
  HacDecoded result;
  result.header = file.header;
  for (std::size_t i = 0; i < intact.size(); ++i) {
    if (intact[i] == 0 && !detail::known_section(file.sections[i].kind))
      result.lost_sections.push_back(file.sections[i].name());
  }
  CodecModel& model = result.model;

  const auto meta = section(HacFormat::meta);
  if (!meta) return meta.error();
  const Result<std::uint64_t> anchors = detail::decode_meta(*meta, model);
  if (!anchors) return located(anchors.error());
  std::optional<GaussianTables> own_tables;
  const GaussianTables& tables = settings.tables != nullptr ? *settings.tables : own_tables.emplace();
  const auto table = section(HacFormat::tables);
  if (!table) return table.error();
  const Result<Done> same_tables = detail::check_tables(*table, tables);
  if (!same_tables) return located(same_tables.error());

  // How many chunks there are says how many anchors there can be: a small file cannot ask for much memory.
  const std::size_t grain = static_cast<std::size_t>(model.chunk_anchors),
                    chunks = chunk_count(static_cast<std::size_t>(*anchors), grain);
  const std::vector<SectionEntry> masks = file.all(HacFormat::mask), streams = file.all(HacFormat::stream);
  if (masks.size() != chunks || streams.size() != chunks) {
    return file.error(ErrorKind::malformed, "META",
                      std::to_string(*anchors) + " anchors need " + std::to_string(chunks) + " chunks, the file has " +
                          std::to_string(masks.size()) + " of masks and " + std::to_string(streams.size()) +
                          " of symbols",
                      "copy the file again");
  }
  for (std::size_t c = 0; c < chunks; ++c) {
    if (masks[c].chunk != c || streams[c].chunk != c) {
      return file.error(ErrorKind::malformed, masks[c].name(), "chunks are not in order", "copy the file again");
    }
  }
  const auto d = static_cast<std::size_t>(model.feature_dim), k3 = 3 * static_cast<std::size_t>(model.offset_count);
  // … nor can a chunk of a few bytes: an anchor has its feature, its extents and one offset at least, and no symbol of a table of 2^16 costs
  // less than 2^-16 bits.
  for (std::size_t c = 0; c < chunks; ++c) {
    const std::uint64_t rows = std::min<std::uint64_t>(grain, *anchors - c * grain), items = streams[c].items;
    if (items < rows * (d + 9) || items > rows * (d + 6 + k3) || items >> 19 > streams[c].size) {
      return file.error(ErrorKind::malformed, streams[c].name(),
                        "names " + std::to_string(items) + " symbols, which " + std::to_string(rows) +
                            " anchors do not have or its bytes do not hold",
                        "copy the file again");
    }
  }
  const std::uint64_t memory = *anchors * 4 * (3 + 1 + d + 6 + k3);  // below 2^28 * 2^15
  if (memory > settings.memory_limit) {
    return file.error(ErrorKind::exhausted, "META",
                      std::to_string(*anchors) + " anchors take " + std::to_string(memory) +
                          " bytes, more than the limit of " + std::to_string(settings.memory_limit),
                      "raise the limit");
  }

  const auto geometry = section(HacFormat::geometry);
  if (!geometry) return geometry.error();
  Result<std::vector<Voxel>> voxels = decode_geometry(*geometry, *anchors);
  if (!voxels) return located(voxels.error());
  model.voxels = std::move(*voxels);

  IntegerContext context;
  context.heads = model.heads();
  const auto hash = section(HacFormat::hash);
  if (!hash) return hash.error();
  Result<IntegerHashGrid> grid = detail::decode_hash_grid(*hash, model.voxels, executor);
  if (!grid) return located(grid.error());
  context.grid = std::move(*grid);
  const auto weights = section(HacFormat::context);
  if (!weights) return weights.error();
  Result<IntegerNetwork> network = decode_context_network(
      *weights, static_cast<std::size_t>(context.grid.shape().channels()), context.heads.outputs());
  if (!network) return located(network.error());
  context.network = std::move(*network);
  const Result<Done> safe = context.check();
  if (!safe) return located(safe.error());
  const auto renderers = section(HacFormat::networks);
  if (!renderers) return renderers.error();
  Result<std::vector<CodecTensor>> networks = decode_networks(*renderers);
  if (!networks) return located(networks.error());
  model.networks = std::move(*networks);
  const auto digest_bytes = section(HacFormat::digests);
  if (!digest_bytes) return digest_bytes.error();
  const Result<detail::HacDigests> digests = detail::decode_digests(*digest_bytes, chunks);
  if (!digests) return located(digests.error());
  for (std::size_t i = 0; i < file.sections.size(); ++i) {
    const SectionEntry& entry = file.sections[i];
    if (detail::known_section(entry.kind) || intact[i] == 0) continue;
    const std::span<const std::byte> payload = file.raw(entry);
    model.extra.push_back({entry, {payload.begin(), payload.end()}});
  }

  const std::size_t n = model.anchors();
  model.mask.resize(n);
  model.feature.resize(n * d);
  model.extent.resize(n * 6);
  model.offset.resize(n * k3);
  const IntegerNetwork::Packed packed = context.network.pack();
  const detail::ChunkCoder coder{context, packed, tables, model.base_step, model.offset_count};
  std::vector<std::optional<Error>> errors(chunks);
  std::vector<detail::ChunkDigest> values(chunks);
  executor.for_chunks(n, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    const std::size_t c = begin / grain;
    const auto mask = file.payload(masks[c]), stream = file.payload(streams[c]);
    if (!mask || !stream) {
      errors[c] = !mask ? mask.error() : stream.error();
      return;
    }
    const Result<detail::DecodedChunk> chunk =
        detail::decode_chunk(coder, *mask, *stream, detail::chunk_rows(model, begin, end));
    if (!chunk) {
      errors[c] = located(chunk.error());
      errors[c]->field = "chunk " + std::to_string(c) + ": " + errors[c]->field;
      return;
    }
    if (chunk->symbol_hash != digests->symbols[c] || chunk->symbol_count != streams[c].items ||
        masks[c].items != end - begin) {
      errors[c] = file.error(
          ErrorKind::invalid, "chunk " + std::to_string(c),
          "its bytes are whole, but it decodes to other symbols than it was made of: encoder and decoder differ",
          "decode it with the version that wrote it and report this");
    }
    values[c] = chunk->value_hash;
  });
  std::vector<std::uint8_t> lost(chunks, 0);
  for (std::size_t c = 0; c < chunks; ++c) {
    if (!errors[c]) continue;
    if (!settings.salvage) return *errors[c];
    result.damaged.emplace_back(static_cast<std::uint32_t>(c), *errors[c]);
    result.lost_anchors += std::min(grain, n - c * grain);
    lost[c] = 1;
  }
  if (result.damaged.empty()) {
    const detail::Sha256Bytes digest = detail::model_digest(values, model, n, {*hash, *weights, *renderers});
    if (digest != digests->model || detail::short_digest(digest) != file.header.digest) {
      return file.error(
          ErrorKind::invalid, "DIGS",
          "its bytes are whole, but the model is another than the one that was encoded: encoder and decoder differ",
          "decode it with the version that wrote it and report this");
    }
    result.verified = true;
  } else {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (lost[i / grain] != 0) continue;
      model.voxels[kept] = model.voxels[i];
      model.mask[kept] = model.mask[i];
      std::copy_n(model.feature.data() + i * d, d, model.feature.data() + kept * d);
      std::copy_n(model.extent.data() + i * 6, 6, model.extent.data() + kept * 6);
      std::copy_n(model.offset.data() + i * k3, k3, model.offset.data() + kept * k3);
      ++kept;
    }
    model.voxels.resize(kept);
    model.mask.resize(kept);
    model.feature.resize(kept * d);
    model.extent.resize(kept * 6);
    model.offset.resize(kept * k3);
  }
  model.context = std::move(context);
  return result;
}

}  // namespace compmark::inline v0
