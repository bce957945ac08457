// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The part of decoding that all codecs share. Nothing is used before its checksum is right, and no memory is taken
// before the limits are checked. A damaged file is refused with section and remedy; with `salvage` the anchors of
// damaged chunks are left out and listed instead. With `partial` a ContextGS file may be truncated, and a HAC-plus file
// that begins with a coarse level: what is complete is decoded. The sections of one codec are in its own decoder
// (hac_decoder.hpp …). Longer than 300 lines: what is refused, and in which order, is one thing.
#pragma once

#include <algorithm>
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
#include "compmark/codec/container/encoding.hpp"
#include "compmark/codec/container/file_format.hpp"
#include "compmark/codec/container/network_coding.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

struct CodecDecodeSettings {
  bool salvage = false;  ///< leave out the anchors of damaged chunks instead of refusing the file
  /// Of a ContextGS file that ends too early decode the levels that are whole, at least the first: a preview
  /// (docs/notebook/compression_experiments.md). A HAC file has one level and must have all its chunks. A HAC-plus file
  /// with a first level must have all chunks of that; those that are refined are decoded as they are.
  bool partial = false;
  std::uint64_t memory_limit = std::uint64_t{1} << 34;  ///< bytes of the decoded arrays and of what decodes them
  const GaussianTables* tables = nullptr;               ///< made anew if there are none, 1 ms
};

struct CodecDecoded {
  CodecModel model;
  ContainerHeader header;
  std::vector<std::pair<std::uint32_t, Error>> damaged;  ///< chunks that were left out (salvage), and why
  std::uint64_t lost_anchors = 0;
  std::vector<std::string> lost_sections;  ///< of others, damaged and left out (salvage)
  std::uint64_t absent_bytes = 0;          ///< of the file's end (partial); sections of others there are left out too
  std::uint32_t levels = 0, file_levels = 0;  ///< how many were whole, of how many; HAC has one
  std::uint64_t absent_anchors = 0;           ///< of the levels that were not
  std::uint64_t coarse_anchors = 0;           ///< HAC-plus: of chunks of which the coarse level alone has arrived
  bool verified = false;                      ///< DIGS was right; false if DIGS or any anchor is missing
};

namespace detail {

/// The sections of a file on their way to a model. A template: it costs nothing where nothing is decoded.
template <class Settings>
class FileReader {
 public:
  /// All must outlive this.
  FileReader(const Container& file, const CodecSections& format, const Settings& settings)
      : format_(format),
        settings_(settings),
        file_(file) {}

  [[nodiscard]] const GaussianTables& tables() const { return *tables_; }
  [[nodiscard]] Error located(Error error) const {
    error.file = file_.path;
    return error;
  }
  [[nodiscard]] Error malformed(std::string field, std::string problem) const {
    return file_.error(ErrorKind::malformed, std::move(field), std::move(problem), "copy the file again");
  }
  /// A section whose checksum is right.
  [[nodiscard]] Result<std::span<const std::byte>> section(std::uint32_t kind, std::uint32_t part = 0) const {
    const SectionEntry* entry = file_.find(kind, part);
    if (entry == nullptr) return malformed(section_name(kind), "is missing");
    return file_.raw(*entry);
  }
  /// The same of the context: the digest of the model covers its bytes.
  [[nodiscard]] Result<std::span<const std::byte>> context(std::uint32_t kind, std::uint32_t part = 0) {
    auto bytes = section(kind, part);
    if (bytes) named_.push_back(*bytes);
    return bytes;
  }

  /// Checks all checksums first, so that everything after this reads the bytes that were written; then META and TABL.
  [[nodiscard]] Result<Done> begin(CodecDecoded& result) {
    const Result<Done> promised = check_sections(file_, format_);
    if (!promised) return promised.error();
    intact_.assign(file_.sections.size(), 1);
    for (std::size_t i = 0; i < intact_.size(); ++i) {
      const SectionEntry& entry = file_.sections[i];
      const auto payload = file_.payload(entry);
      if (payload) continue;
      const bool goes_on = file_.arrived(entry) ? settings_.salvage && format_.can_be_lost(entry)
                                                : format_.can_be_lost(entry) || entry.kind == CodecFormat::digests;
      if (!goes_on) return payload.error();
      intact_[i] = 0;
      if (file_.arrived(entry) && !format_.knows(entry.kind)) result.lost_sections.push_back(entry.name());
    }
    result.absent_bytes = file_.absent_bytes();
    result.header = file_.header;
    const auto meta = section(CodecFormat::meta);
    if (!meta) return meta.error();
    const Result<std::uint64_t> anchors = decode_meta(*meta, result.model);
    if (!anchors) return located(anchors.error());
    anchors_ = *anchors;
    tables_ = settings_.tables != nullptr ? settings_.tables : &own_tables_.emplace();
    const auto table = section(CodecFormat::tables);
    if (!table) return table.error();
    const Result<Done> same_tables = check_tables(*table, *tables_);
    if (!same_tables) return located(same_tables.error());
    return Done{};
  }
  [[nodiscard]] std::uint64_t anchors() const { return anchors_; }

  /// The number of chunks limits that of anchors: a small file cannot ask for much memory. Nor can a chunk of a few
  /// bytes: an anchor has feature, scales and an offset, and no symbol of a table of 2^16 costs less than 2^-16 bits.
  [[nodiscard]] Result<Done> expect(const CodecModel& model, const std::vector<LevelRange>& levels, std::size_t workers,
                                    std::size_t hyperprior = 0) {
    const auto grain = static_cast<std::size_t>(model.chunk_anchors);
    std::size_t chunks = 0;
    for (const LevelRange& level : levels) chunks += chunk_count(level.count, grain);
    for (const std::uint32_t kind : format_.chunked) {
      std::vector<SectionEntry> found = file_.all(kind);
      if (found.size() != chunks) {
        return malformed("META", std::to_string(anchors_) + " anchors need " + std::to_string(chunks) +
                                     " chunks, the file has " + std::to_string(found.size()) + " of " +
                                     section_name(kind));
      }
      entries_.push_back(std::move(found));
    }
    places_ = chunk_places(levels, grain);
    const auto d = static_cast<std::size_t>(model.feature_dim), k3 = 3 * static_cast<std::size_t>(model.offset_count);
    for (std::size_t c = 0; c < chunks; ++c) {
      for (const std::vector<SectionEntry>& entries : entries_) {
        if (entries[c].part != places_[c].part || entries[c].chunk != places_[c].chunk)
          return malformed(entries[c].name(), "chunks are not in order");
      }
      const SectionEntry& stream = entry(format_.coarse != 0 ? format_.coarse : CodecFormat::stream, c);
      const std::uint64_t rows = places_[c].end - places_[c].begin, items = stream.items;
      if (items < rows * (d + 9) || items > rows * (d + 6 + k3) || items >> 19 > stream.size) {
        return malformed(stream.name(), "names " + std::to_string(items) + " symbols, which " + std::to_string(rows) +
                                            " anchors do not have or its bytes do not hold");
      }
    }
    const Result<Done> some = count_arrived(levels);
    if (!some) return some.error();
    // A symbol that is decoded has a model and a value, 12 bytes, in each chunk that a worker decodes.
    std::uint64_t largest = 0;
    for (std::size_t c = 0; c < arrived_; ++c)
      largest = std::max(largest, entry(format_.coarse != 0 ? format_.coarse : CodecFormat::stream, c).items);
    const std::uint64_t memory = arrived_anchors() * 4 * (3 + 1 + d + 6 + k3 + hyperprior) +
                                 12 * largest * std::min<std::uint64_t>(workers, arrived_);  // below 2^43 + 2^60
    if (memory > settings_.memory_limit) {
      return file_.error(ErrorKind::exhausted, "META",
                         std::to_string(arrived_anchors()) + " anchors take " + std::to_string(memory) +
                             " bytes, more than the limit of " + std::to_string(settings_.memory_limit),
                         "raise the limit");
    }
    return Done{};
  }
  /// The chunks to decode: those of levels that are whole.
  [[nodiscard]] std::span<const ChunkPlace> places() const {
    return std::span<const ChunkPlace>(places_).first(arrived_);
  }
  /// How many anchors these have: nothing is kept for the others.
  [[nodiscard]] std::size_t arrived_anchors() const { return arrived_ == 0 ? 0 : places_[arrived_ - 1].end; }
  /// Whether a chunk is there as finely as it was coded.
  [[nodiscard]] bool refined(std::size_t chunk) const { return file_.arrived(entry(CodecFormat::stream, chunk)); }
  [[nodiscard]] const SectionEntry& entry(std::uint32_t kind, std::size_t chunk) const {
    const auto at = std::find(format_.chunked.begin(), format_.chunked.end(), kind) - format_.chunked.begin();
    return entries_[static_cast<std::size_t>(at)][chunk];
  }

  /// A network of the context, by what it reads.
  [[nodiscard]] Result<IntegerNetwork> network(std::size_t inputs, std::size_t outputs, std::uint32_t part = 0) {
    const auto weights = context(CodecFormat::context, part);
    if (!weights) return weights.error();
    Result<IntegerNetwork> network = decode_context_network(*weights, inputs, outputs);
    if (!network) return located(network.error());
    return network;
  }
  /// NETR, DIGS, what is kept unread, and room for the attributes; voxels are there.
  [[nodiscard]] Result<Done> prepare(CodecModel& model) {
    const auto renderers = context(CodecFormat::networks);
    if (!renderers) return renderers.error();
    Result<std::vector<CodecTensor>> networks = decode_networks(*renderers);
    if (!networks) return located(networks.error());
    model.networks = std::move(*networks);
    const SectionEntry* end = file_.find(CodecFormat::digests);
    if (end == nullptr || file_.arrived(*end)) {
      const auto digest_bytes = section(CodecFormat::digests);
      if (!digest_bytes) return digest_bytes.error();
      Result<CodecDigests> digests = decode_digests(*digest_bytes, places_.size());
      if (!digests) return located(digests.error());
      digests_ = std::move(*digests);
    }
    for (std::size_t i = 0; i < file_.sections.size(); ++i) {
      const SectionEntry& entry = file_.sections[i];
      if (format_.knows(entry.kind) || intact_[i] == 0) continue;
      const std::span<const std::byte> payload = file_.raw(entry);
      model.extra.push_back({entry, {payload.begin(), payload.end()}});
    }
    const std::size_t n = model.anchors();
    model.mask.resize(n);
    model.feature.resize(n * static_cast<std::size_t>(model.feature_dim));
    model.scale.resize(n * 6);
    model.offset.resize(n * 3 * static_cast<std::size_t>(model.offset_count));
    coarse_.assign(places_.size(), 0);
    errors_.resize(places_.size());
    values_.resize(places_.size());
    return Done{};
  }

  /// Decodes one chunk, in parallel with others; its error is kept for finish(). decode(kind): Result<DecodedChunk>.
  template <class Decode>
  void chunk(std::size_t c, const Decode& decode) {
    for (const std::vector<SectionEntry>& entries : entries_) {
      if (refines(entries[c]) && !file_.arrived(entries[c])) continue;
      const auto payload = file_.payload(entries[c]);
      if (!payload) {
        errors_[c] = payload.error();
        return;
      }
    }
    const std::string name = "chunk " + std::to_string(c);
    const Result<DecodedChunk> decoded = decode([&](std::uint32_t kind) { return file_.raw(entry(kind, c)); });
    if (!decoded) {
      errors_[c] = located(decoded.error());
      errors_[c]->field = name + ": " + errors_[c]->field;
      return;
    }
    const bool other = digests_ && !decoded->is_coarse && decoded->symbol_hash != digests_->symbols[c];
    const bool short_of = format_.coarse != 0 && decoded->refined != entry(CodecFormat::stream, c).items;
    if (other || short_of ||
        decoded->symbol_count != entry(format_.coarse != 0 ? format_.coarse : CodecFormat::stream, c).items ||
        entry(CodecFormat::mask, c).items != places_[c].end - places_[c].begin) {
      errors_[c] = file_.error(
          ErrorKind::invalid, name,
          "its bytes are whole, but it decodes to other symbols than it was made of: encoder and decoder differ",
          "decode it with the version that wrote it and report this");
      return;
    }
    values_[c] = decoded->value_hash;
    coarse_[c] = decoded->is_coarse ? 1 : 0;
  }
  [[nodiscard]] bool lost(std::size_t c) const { return errors_[c].has_value(); }

  /// Returns the kept errors, checks the digest of the whole, or makes the model without the lost anchors.
  [[nodiscard]] Result<Done> finish(CodecDecoded& result) {
    std::vector<std::uint32_t> kept;
    for (std::size_t c = 0; c < arrived_; ++c)
      result.coarse_anchors += coarse_[c] != 0 ? places_[c].end - places_[c].begin : 0;
    result.levels = whole_levels_ + (format_.coarse != 0 && result.coarse_anchors == 0 ? 1 : 0);
    result.file_levels = format_.parts + (format_.coarse != 0 ? 1 : 0);
    result.absent_anchors = anchors_ - arrived_anchors();
    for (std::size_t c = 0; c < arrived_; ++c) {
      if (errors_[c] && !settings_.salvage) return *errors_[c];
      if (errors_[c]) {
        result.damaged.emplace_back(static_cast<std::uint32_t>(c), *errors_[c]);
        result.lost_anchors += places_[c].end - places_[c].begin;
        continue;
      }
      for (std::size_t i = places_[c].begin; i < places_[c].end; ++i) kept.push_back(static_cast<std::uint32_t>(i));
    }
    if (!result.damaged.empty()) result.model = take_rows(result.model, kept);
    if (!result.damaged.empty() || result.absent_anchors > 0 || result.coarse_anchors > 0) return Done{};
    const Sha256Bytes digest = model_digest(values_, result.model, result.model.anchors(), named_);
    if ((digests_ && digest != digests_->model) || short_digest(digest) != file_.header.digest) {
      return file_.error(
          ErrorKind::invalid, "DIGS",
          "its bytes are whole, but the model is another than the one that was encoded: encoder and decoder differ",
          "decode it with the version that wrote it and report this");
    }
    result.verified = digests_.has_value();
    return Done{};
  }

 private:
  /// Complete levels, counted from the first; the anchors of an incomplete level would leave holes.
  [[nodiscard]] Result<Done> count_arrived(std::span<const LevelRange> levels) {
    for (whole_levels_ = 0; whole_levels_ < levels.size(); ++whole_levels_) {
      std::size_t end = arrived_;
      for (; end < places_.size() && places_[end].part == levels[whole_levels_].part; ++end) {
        for (const std::vector<SectionEntry>& entries : entries_) {
          if (file_.arrived(entries[end]) || refines(entries[end])) continue;
          if (arrived_ == 0) return file_.payload(entries[end]).error();
          return Done{};
        }
      }
      arrived_ = end;
    }
    return Done{};
  }

  /// Whether a chunk can be decoded without it, coarsely.
  [[nodiscard]] bool refines(const SectionEntry& section) const {
    return format_.coarse != 0 && section.kind == CodecFormat::stream;
  }

  const CodecSections& format_;
  const Settings& settings_;
  const Container& file_;
  std::vector<std::uint8_t> intact_;
  std::uint64_t anchors_ = 0;
  std::optional<GaussianTables> own_tables_;
  const GaussianTables* tables_ = nullptr;
  std::vector<std::vector<SectionEntry>> entries_;  ///< of each chunked kind, by chunk
  std::vector<ChunkPlace> places_;
  std::vector<std::span<const std::byte>> named_;
  std::size_t arrived_ = 0;  ///< of `places_`, those of whole levels
  std::uint32_t whole_levels_ = 0;
  std::optional<CodecDigests> digests_;  ///< none when the end of the file has not arrived
  std::vector<std::optional<Error>> errors_;
  std::vector<ChunkDigest> values_;
  std::vector<std::uint8_t> coarse_;  ///< chunks that are not refined
};

}  // namespace detail

}  // namespace compmark
