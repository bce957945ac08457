// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Information about a compressed file without decoding it: versions, numbers, metadata, and the bytes of each section.
// Reads the header, the table of contents and META, and checks the checksums of all sections: one pass over the bytes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/container/codecs.hpp"
#include "compmark/codec/container/container.hpp"
#include "compmark/codec/container/file_format.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

struct CodecInfo {
  ContainerHeader header;
  std::uint64_t anchors = 0;
  CodecModel numbers;  ///< voxel size, D, K, base steps, anchors a chunk and metadata; no anchors
  std::vector<SectionEntry> sections;
  std::vector<std::string> damaged;  ///< names of the sections whose checksums are wrong
  std::uint64_t file_bytes = 0;

  [[nodiscard]] std::uint64_t bytes_of(std::uint32_t kind) const {
    std::uint64_t bytes = 0;
    for (const SectionEntry& entry : sections) bytes += entry.kind == kind ? entry.size : 0;
    return bytes;
  }
};

/// A level of a file, in the order of the file: of ContextGS three, of HAC one, of HAC-plus one, or a coarse one and
/// the whole, of the same anchors.
struct CodecLevel {
  std::uint64_t anchors = 0;  ///< as the table of contents says
  std::uint64_t end = 0;      ///< so many bytes of the file are enough to decode this level and those before (partial)
};
template <class Codecs = ShippedCodecs, class File>
[[nodiscard]] std::vector<CodecLevel> codec_levels(const File& file) {
  const CodecSections& format = *Codecs::of_profile(file.header.profile, []<class C>() { return &C::sections; });
  std::uint64_t coarse_end = 0, end = 0, anchors = 0;
  for (const SectionEntry& entry : file.sections) {
    if (format.coarse == 0 || entry.kind != format.coarse) continue;
    coarse_end = std::max(coarse_end, entry.offset + entry.size);
  }
  std::vector<CodecLevel> levels(format.parts);
  for (const SectionEntry& entry : file.sections) {
    const bool chunked = CodecSections::in(format.chunked, entry.kind);
    if (!format.knows(entry.kind) || entry.kind == CodecFormat::digests || entry.part >= format.parts) continue;
    std::uint64_t& reached = chunked ? levels[format.parts - 1 - entry.part].end : end;
    reached = std::max(reached, entry.offset + entry.size);
    if (entry.kind == CodecFormat::mask) levels[format.parts - 1 - entry.part].anchors += entry.items;
    anchors += entry.kind == CodecFormat::mask ? entry.items : 0;
  }
  if (coarse_end != 0) levels.insert(levels.begin(), CodecLevel{anchors, coarse_end});
  for (CodecLevel& level : levels) level.end = end = std::max(end, level.end);
  return levels;
}

/// `path` is for messages. A file whose META is damaged has no information to give and is an error.
template <class Codecs = ShippedCodecs, class Info = CodecInfo>  // a template: free for programs that do not call it
[[nodiscard]] Result<Info> inspect_cmk(std::span<const std::byte> bytes, const std::string& path) {
  const Result<Container> file = parse_container(bytes, path);
  if (!file) return file.error();
  const Result<Done> promised =
      detail::check_sections(*file, *Codecs::of_profile(file->header.profile, []<class C>() { return &C::sections; }));
  if (!promised) return promised.error();
  Info info;
  info.header = file->header;
  info.sections = file->sections;
  info.file_bytes = bytes.size();
  for (const SectionEntry& entry : file->sections) {
    if (!file->payload(entry)) info.damaged.push_back(entry.name());
  }
  const SectionEntry* meta = file->find(CodecFormat::meta);
  if (meta == nullptr) return file->error(ErrorKind::malformed, "META", "is missing", "copy the file again");
  const auto payload = file->payload(*meta);
  if (!payload) return payload.error();
  const Result<std::uint64_t> anchors = detail::decode_meta(*payload, info.numbers);
  if (!anchors) {
    Error error = anchors.error();
    error.file = path;
    return error;
  }
  info.anchors = *anchors;
  return info;
}

}  // namespace compmark
