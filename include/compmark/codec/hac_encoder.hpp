// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model with a trained context to the bytes of a HAC file (ECCV 2024; compression sheet, 1.13 and 3.8), which decode without anything else.
// Besides the bytes it returns the model as every decoder will have it, to the last bit, and a report of what took how many bytes. Chunks
// are encoded in parallel and joined in order: same bytes at any thread count. Cost: ~5 us an anchor and core, and 0.25 s for
// finding how many bits the context's weights need (none when they are given, or when the context is that of a file).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/codec_model.hpp"
#include "compmark/codec/container.hpp"
#include "compmark/codec/context_choice.hpp"
#include "compmark/codec/geometry.hpp"
#include "compmark/codec/hac_chunk.hpp"
#include "compmark/codec/hac_digest.hpp"
#include "compmark/codec/hac_format.hpp"
#include "compmark/codec/network_coding.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"

namespace compmark::inline v0 {

struct HacSettings {
  /// Of the context network, when it comes from training. None: those that make the smallest file.
  std::optional<WeightBits> weight_bits;
};

/// Where the bytes of a file are. Attribute groups are features, extents, offsets.
struct HacReport {
  std::uint64_t anchors = 0;  ///< in the file
  std::uint64_t dropped = 0;  ///< had no live offset
  std::uint64_t live_offsets = 0;
  std::array<std::uint64_t, 3> symbols{};  ///< by attribute group
  std::array<std::uint64_t, 3> clamped{};  ///< values beyond the greatest symbol, which were held there
  std::array<double, 3> ideal_bits{};      ///< what the tables say the symbols cost
  std::array<std::uint64_t, HacFormat::known.size()> section_bytes{};  ///< in the order of HacFormat::known
  std::uint64_t container_bytes = 0;                                   ///< header and table of contents
  std::uint64_t extra_bytes = 0;                                       ///< sections that were kept unread
  std::uint64_t total_bytes = 0;

  [[nodiscard]] std::uint64_t bytes_of(std::uint32_t kind) const {
    for (std::size_t i = 0; i < section_bytes.size(); ++i) {
      if (HacFormat::known[i] == kind) return section_bytes[i];
    }
    return 0;
  }
  /// Size of the file if its symbols cost what the tables say.
  [[nodiscard]] double estimated_bytes() const {
    return static_cast<double>(total_bytes - bytes_of(HacFormat::stream)) +
           (ideal_bits[0] + ideal_bits[1] + ideal_bits[2]) / 8;
  }
};

struct HacEncoded {
  std::vector<std::byte> bytes;
  CodecModel model;  ///< what decoding the bytes gives
  HacReport report;
};

namespace detail {

/// The anchors that are coded, in their order; values as they were.
[[nodiscard]] inline CodecModel coded_anchors(const CodecModel& model, const VoxelRange& range,
                                              std::span<const Voxel> survivors, std::span<const std::uint32_t> rows) {
  CodecModel result;
  result.voxel_size = model.voxel_size;
  result.feature_dim = model.feature_dim;
  result.offset_count = model.offset_count;
  result.base_step = model.base_step;
  result.chunk_anchors = model.chunk_anchors;
  result.metadata = model.metadata;
  result.networks = model.networks;
  result.extra = model.extra;
  const auto d = static_cast<std::size_t>(model.feature_dim), k3 = 3 * static_cast<std::size_t>(model.offset_count);
  const std::vector<std::uint32_t> order = morton_order(survivors, range);
  result.voxels.resize(order.size());
  result.mask.resize(order.size());
  result.feature.resize(order.size() * d);
  result.extent.resize(order.size() * 6);
  result.offset.resize(order.size() * k3);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::size_t row = rows[order[i]];
    result.voxels[i] = model.voxels[row];
    result.mask[i] = model.mask[row];
    std::copy_n(model.feature.data() + row * d, d, result.feature.data() + i * d);
    std::copy_n(model.extent.data() + row * 6, 6, result.extent.data() + i * 6);
    std::copy_n(model.offset.data() + row * k3, k3, result.offset.data() + i * k3);
  }
  return result;
}

}  // namespace detail

template <Executor E>
[[nodiscard]] Result<HacEncoded> encode_hac(const CodecModel& model, const HacSettings& settings, E& executor) {
  const Result<Done> checked = detail::check_codec_model(model);
  if (!checked) return checked.error();
  HacEncoded result;
  HacReport& report = result.report;
  std::vector<Voxel> survivors;
  std::vector<std::uint32_t> rows;
  for (std::size_t i = 0; i < model.anchors(); ++i) {
    if (model.mask[i] == 0) continue;
    survivors.push_back(model.voxels[i]);
    rows.push_back(static_cast<std::uint32_t>(i));
    report.live_offsets += static_cast<std::uint64_t>(std::popcount(model.mask[i]));
  }
  const VoxelRange range = voxel_range(survivors);
  result.model = detail::coded_anchors(model, range, survivors, rows);
  CodecModel& coded = result.model;
  const GaussianTables tables;
  Result<IntegerContext> context = detail::choose_context(model, coded, tables, settings.weight_bits, executor);
  if (!context) return context.error();
  const std::size_t n = coded.anchors(), grain = static_cast<std::size_t>(coded.chunk_anchors),
                    chunks = chunk_count(n, grain);
  report.anchors = n;
  report.dropped = model.anchors() - n;
  if (2 * chunks + HacFormat::known.size() + model.extra.size() > ContainerFormat::section_limit) {
    return Error{ErrorKind::exhausted, "", "anchors",
                 std::to_string(n) + " anchors need more chunks than a file can hold", "set more anchors a chunk"};
  }

  std::vector<Section> sections;
  const auto add = [&](std::uint32_t kind, std::vector<std::byte> bytes, std::uint64_t items, std::uint32_t chunk = 0) {
    Section section;
    section.entry.kind = kind;
    section.entry.chunk = chunk;
    section.entry.items = items;
    section.bytes = std::move(bytes);
    sections.push_back(std::move(section));
  };
  add(HacFormat::meta, detail::encode_meta(coded, n), model.metadata.size());
  add(HacFormat::tables, detail::encode_tables(tables), 2);
  add(HacFormat::geometry, encode_geometry(coded.voxels, range), n);
  const std::vector<std::uint8_t> seen = detail::seen_entries(context->grid, coded.voxels, executor);
  add(HacFormat::hash, detail::encode_hash_grid(context->grid, seen),
      static_cast<std::uint64_t>(std::count(seen.begin(), seen.end(), 1)));
  add(HacFormat::context, encode_context_network(context->network),
      context->network.hidden.weight.size() + context->network.output.weight.size());
  std::vector<std::byte> networks = encode_networks(coded.networks);
  Result<std::vector<CodecTensor>> stored = decode_networks(networks);  // the values as they will be read
  if (!stored) return stored.error();
  coded.networks = std::move(*stored);
  add(HacFormat::networks, std::move(networks), coded.networks.size());

  const IntegerNetwork::Packed packed = context->network.pack();
  const detail::ChunkCoder coder{*context, packed, tables, coded.base_step, coded.offset_count};
  std::vector<detail::EncodedChunk> encoded(chunks);
  executor.for_chunks(n, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    encoded[begin / grain] = detail::encode_chunk(coder, detail::chunk_rows(coded, begin, end));
  });
  detail::HacDigests digests;
  std::vector<detail::ChunkDigest> values;
  for (std::size_t c = 0; c < chunks; ++c) {
    detail::EncodedChunk& chunk = encoded[c];
    for (std::size_t g = 0; g < 3; ++g) {
      report.symbols[g] += chunk.symbols[g];
      report.clamped[g] += chunk.clamped[g];
      report.ideal_bits[g] += chunk.bits[g];
    }
    digests.symbols.push_back(chunk.symbol_hash);
    values.push_back(chunk.value_hash);
    add(HacFormat::mask, std::move(chunk.mask), std::min(grain, n - c * grain), static_cast<std::uint32_t>(c));
    add(HacFormat::stream, std::move(chunk.stream), chunk.symbol_count, static_cast<std::uint32_t>(c));
  }
  digests.model = detail::model_digest(values, coded, n, {sections[3].bytes, sections[4].bytes, sections[5].bytes});
  add(HacFormat::digests, detail::encode_digests(digests), chunks);
  for (const Section& section : sections) {
    const auto place =
        std::find(HacFormat::known.begin(), HacFormat::known.end(), section.entry.kind) - HacFormat::known.begin();
    report.section_bytes[static_cast<std::size_t>(place)] += section.bytes.size();
  }
  for (const Section& section : model.extra) {
    if (section.entry.critical() ||
        std::find(HacFormat::known.begin(), HacFormat::known.end(), section.entry.kind) != HacFormat::known.end()) {
      return Error{ErrorKind::invalid, "", section.entry.name(),
                   "cannot be kept: it is critical or has a name of the codec's own", "remove it"};
    }
    sections.push_back(section);
    report.extra_bytes += section.bytes.size();
  }

  ContainerHeader header;
  header.profile = ContainerProfile::hac;
  header.numeric_spec = HacFormat::numeric_spec;
  header.flags = ContainerFormat::flag_salvageable | (coded.networks.empty() ? 0u : ContainerFormat::flag_networks);
  header.digest = detail::short_digest(digests.model);
  result.bytes = write_container(header, sections);
  report.total_bytes = result.bytes.size();
  report.container_bytes = ContainerFormat::header_size + ContainerFormat::entry_size * sections.size() + 4;
  coded.context = std::move(*context);
  return result;
}

}  // namespace compmark::inline v0
