// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The part of encoding that all codecs share: it leaves out anchors without an unmasked offset, orders the others, cuts
// them into chunks, writes the sections that every file has and counts every byte. The sections of one codec are in
// hac_encoder.hpp and context_gs_encoder.hpp.
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

#include "compmark/codec/container/chunk_coding.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/container/container.hpp"
#include "compmark/codec/container/digest.hpp"
#include "compmark/codec/container/file_format.hpp"
#include "compmark/codec/container/geometry.hpp"
#include "compmark/codec/container/network_coding.hpp"
#include "compmark/codec/integer/integer_quantize.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

struct CodecEncodeSettings {
  /// Of the context's networks, when they come from training. None: those that make the smallest file.
  std::optional<WeightBits> weight_bits;
};

/// Where the bytes of a file are. Attribute groups are features, scales, offsets.
struct CodecReport {
  ContainerProfile profile = ContainerProfile::hac;
  std::uint64_t anchors = 0;  ///< in the file
  std::uint64_t dropped = 0;  ///< had no unmasked offset
  std::uint64_t unmasked_offsets = 0;
  std::array<std::uint64_t, 3> level_anchors{};  ///< ContextGS: of levels 0, 1, 2
  std::array<std::uint64_t, 3> symbols{};        ///< by attribute group
  std::array<std::uint64_t, 3> clamped{};        ///< values beyond the greatest symbol, which were clipped to it
  std::array<double, 3> ideal_bits{};            ///< cost of the symbols by the tables
  std::uint64_t hyperprior_symbols = 0;          ///< ContextGS: of z
  double hyperprior_bits = 0;
  std::uint64_t coded_bytes = 0;                                       ///< of the sections that hold these symbols
  std::vector<std::pair<std::uint32_t, std::uint64_t>> section_bytes;  ///< by kind, in the order of the file
  std::uint64_t container_bytes = 0;                                   ///< header and table of contents
  std::uint64_t extra_bytes = 0;                                       ///< sections that were kept unread
  std::uint64_t total_bytes = 0;

  [[nodiscard]] std::uint64_t bytes_of(std::uint32_t kind) const {
    for (const auto& [section, bytes] : section_bytes) {
      if (section == kind) return bytes;
    }
    return 0;
  }
  /// Size of the file if each symbol cost exactly its ideal bits.
  [[nodiscard]] double estimated_bytes() const {
    return static_cast<double>(total_bytes - coded_bytes) +
           (ideal_bits[0] + ideal_bits[1] + ideal_bits[2] + hyperprior_bits) / 8;
  }
};

struct CodecEncoded {
  std::vector<std::byte> bytes;
  CodecModel model;  ///< what decoding the bytes gives
  CodecReport report;
};

namespace detail {

/// Anchors of one level and what part the sections of its chunks have.
struct LevelRange {
  std::uint32_t part = 0;
  std::size_t count = 0;
};
/// Rows that are coded together.
struct ChunkPlace {
  std::uint32_t part = 0, chunk = 0;
  std::size_t begin = 0, end = 0;
};
/// Chunks of levels that follow one another.
template <class Levels>
[[nodiscard]] std::vector<ChunkPlace> chunk_places(const Levels& levels, std::size_t grain) {
  std::vector<ChunkPlace> places;
  std::size_t first = 0;
  for (const LevelRange& level : levels) {
    const std::size_t end = first + level.count;
    for (std::uint32_t c = 0; first < end; ++c) {
      places.push_back({level.part, c, first, std::min(end, first + grain)});
      first = places.back().end;
    }
  }
  return places;
}
/// body(place, its number) for all chunks of a part, in parallel.
template <Executor E, class Body>
void for_part(std::span<const ChunkPlace> places, std::uint32_t part, E& executor, const Body& body) {
  std::size_t first = 0, count = 0;
  while (first < places.size() && places[first].part != part) ++first;
  while (first + count < places.size() && places[first + count].part == part) ++count;
  executor.for_chunks(count, 1, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) body(places[first + i], first + i);
  });
}

/// Rows of the anchors that are coded, along the Morton curve; counts the others.
template <class Model>
[[nodiscard]] std::vector<std::uint32_t> coded_rows(const Model& model, VoxelRange& range, CodecReport& report) {
  std::vector<Voxel> survivors;
  std::vector<std::uint32_t> rows;
  for (std::size_t i = 0; i < model.anchors(); ++i) {
    if (model.mask[i] == 0) continue;
    survivors.push_back(model.voxels[i]);
    rows.push_back(static_cast<std::uint32_t>(i));
    report.unmasked_offsets += static_cast<std::uint64_t>(std::popcount(model.mask[i]));
  }
  report.anchors = rows.size();
  report.dropped = model.anchors() - rows.size();
  range = voxel_range(survivors);
  std::vector<std::uint32_t> order = morton_order(survivors, range);
  for (std::uint32_t& row : order) row = rows[row];
  return order;
}

/// These rows of a model, in this order, with all that is not of anchors but the context.
template <class Model>
[[nodiscard]] Model take_rows(const Model& model, std::span<const std::uint32_t> rows) {
  Model result;
  result.voxel_size = model.voxel_size;
  result.feature_dim = model.feature_dim;
  result.offset_count = model.offset_count;
  result.base_step = model.base_step;
  result.chunk_anchors = model.chunk_anchors;
  result.metadata = model.metadata;
  result.networks = model.networks;
  result.extra = model.extra;
  const auto gather = [&](const auto& from, auto& to, std::size_t width) {
    to.resize(rows.size() * width);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(rows[i] * width), width,
                  to.begin() + static_cast<std::ptrdiff_t>(i * width));
    }
  };
  gather(model.voxels, result.voxels, 1);
  gather(model.mask, result.mask, 1);
  gather(model.feature, result.feature, static_cast<std::size_t>(model.feature_dim));
  gather(model.scale, result.scale, 6);
  gather(model.offset, result.offset, 3 * static_cast<std::size_t>(model.offset_count));
  if (!model.hyperprior.empty()) gather(model.hyperprior, result.hyperprior, model.hyperprior.size() / model.anchors());
  return result;
}

/// The sections of a file while it is written. A template, so that a program that does not encode does not pay for it.
template <class Model>
class FileWriter {
 public:
  /// `places` and `model` (in the order of coding) must outlive this.
  FileWriter(const CodecSections& format, const Model& model, std::span<const ChunkPlace> places)
      : format_(format),
        model_(model),
        places_(places) {}

  [[nodiscard]] Result<Done> check() const {
    if (format_.chunked.size() * places_.size() + format_.known.size() + format_.parts + model_.extra.size() >
        ContainerFormat::section_limit) {
      return Error{ErrorKind::exhausted, "", "anchors",
                   std::to_string(model_.anchors()) + " anchors need more chunks than a file can hold",
                   "set more anchors a chunk"};
    }
    return Done{};
  }
  void add(std::uint32_t kind, std::vector<std::byte> bytes, std::uint64_t items, std::uint32_t part = 0,
           std::uint32_t chunk = 0) {
    Section section;
    section.entry.kind = kind;
    section.entry.part = part;
    section.entry.chunk = chunk;
    section.entry.items = items;
    section.bytes = std::move(bytes);
    sections_.push_back(std::move(section));
  }
  /// META, TABL, GEOM; `voxels` along the Morton curve.
  void begin(const GaussianTables& tables, std::span<const Voxel> voxels, const VoxelRange& range) {
    add(CodecFormat::meta, encode_meta(model_, voxels.size()), model_.metadata.size());
    add(CodecFormat::tables, encode_tables(tables), 2);
    add(CodecFormat::geometry, encode_geometry(voxels, range), voxels.size());
  }
  /// A section of the context: the digest of the model covers its bytes.
  void add_context(std::uint32_t kind, std::vector<std::byte> bytes, std::uint64_t items, std::uint32_t part = 0) {
    named_.push_back(sections_.size());
    add(kind, std::move(bytes), items, part);
  }
  void add_network(const IntegerNetwork& network, std::uint32_t part = 0) {
    add_context(CodecFormat::context, encode_context_network(network),
                network.hidden.weight.size() + network.output.weight.size(), part);
  }
  /// NETR; returns the tensors as they will be read.
  [[nodiscard]] Result<std::vector<CodecTensor>> add_renderers() {
    std::vector<std::byte> networks = encode_networks(model_.networks);
    Result<std::vector<CodecTensor>> stored = decode_networks(networks);
    if (stored) add_context(CodecFormat::networks, std::move(networks), stored->size());
    return stored;
  }
  /// The chunks, DIGS and what is kept unread; the model is what decoding gives by now.
  [[nodiscard]] Result<std::vector<std::byte>> finish(std::vector<EncodedChunk> chunks, std::uint32_t hyperprior,
                                                      CodecReport& report) {
    CodecDigests digests;
    std::vector<ChunkDigest> values;
    for (std::size_t c = 0; c < places_.size(); ++c) {
      EncodedChunk& chunk = chunks[c];
      const ChunkPlace& place = places_[c];
      for (std::size_t g = 0; g < 3; ++g) {
        report.symbols[g] += chunk.symbols[g];
        report.clamped[g] += chunk.clamped[g];
        report.ideal_bits[g] += chunk.bits[g];
      }
      report.hyperprior_bits += chunk.hyperprior_bits;
      report.coded_bytes += chunk.coarse.size() + chunk.stream.size() + chunk.hyperprior.size();
      digests.symbols.push_back(chunk.symbol_hash);
      values.push_back(std::move(chunk.value_hash));
      const std::size_t rows = place.end - place.begin;
      if (hyperprior != 0) {
        const std::size_t symbols = model_.hyperprior.size() / model_.anchors() * rows;
        report.hyperprior_symbols += symbols;
        add(hyperprior, std::move(chunk.hyperprior), symbols, place.part, place.chunk);
      }
      add(CodecFormat::mask, std::move(chunk.mask), rows, place.part, place.chunk);
      if (format_.coarse != 0) {
        add(format_.coarse, std::move(chunk.coarse), chunk.symbol_count, place.part, place.chunk);
      } else {
        add(CodecFormat::stream, std::move(chunk.stream), chunk.symbol_count, place.part, place.chunk);
      }
    }
    for (std::size_t c = 0; format_.coarse != 0 && c < places_.size(); ++c)
      add(CodecFormat::stream, std::move(chunks[c].stream), chunks[c].refined, places_[c].part, places_[c].chunk);
    std::vector<std::span<const std::byte>> payloads;
    for (const std::size_t i : named_) payloads.emplace_back(sections_[i].bytes);
    digests.model = model_digest(values, model_, model_.anchors(), payloads);
    add(CodecFormat::digests, encode_digests(digests), places_.size());
    for (const std::uint32_t kind : format_.known) report.section_bytes.emplace_back(kind, 0);
    for (const Section& section : sections_) {
      for (auto& [kind, bytes] : report.section_bytes) bytes += kind == section.entry.kind ? section.bytes.size() : 0;
    }
    for (const Section& section : model_.extra) {
      if (section.entry.critical() || format_.knows(section.entry.kind)) {
        return Error{ErrorKind::invalid, "", section.entry.name(),
                     "cannot be kept: it is critical or has a name of the codec's own", "remove it"};
      }
      for (const Section& other : sections_) {
        if (other.entry.kind == section.entry.kind && other.entry.part == section.entry.part &&
            other.entry.chunk == section.entry.chunk) {
          return Error{ErrorKind::invalid, "", section.entry.name(), "is there twice", "remove one"};
        }
      }
      sections_.push_back(section);
      report.extra_bytes += section.bytes.size();
    }
    ContainerHeader header;
    header.profile = report.profile = format_.profile;
    header.numeric_spec = CodecFormat::numeric_spec;
    header.flags = ContainerFormat::flag_salvageable | (model_.networks.empty() ? 0u : ContainerFormat::flag_networks);
    header.digest = short_digest(digests.model);
    std::vector<std::byte> bytes = write_container(header, sections_);
    report.total_bytes = bytes.size();
    report.container_bytes = ContainerFormat::header_size + ContainerFormat::entry_size * sections_.size() + 4;
    return bytes;
  }

 private:
  const CodecSections& format_;
  const Model& model_;
  std::span<const ChunkPlace> places_;
  std::vector<Section> sections_;
  std::vector<std::size_t> named_;
};

}  // namespace detail

}  // namespace compmark
