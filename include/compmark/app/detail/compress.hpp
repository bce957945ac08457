// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/compress.hpp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compress.hpp"
#include "compmark/codec/container/cmk.hpp"
#include "compmark/codec/container/container.hpp"
#include "compmark/codec/context_gs/context_gs_format.hpp"
#include "compmark/codec/hac/hac_format.hpp"
#include "compmark/codec/hac_plus/hac_plus_format.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/io/read_file.hpp"

namespace compmark {
namespace detail {

inline const char* section_purpose(std::uint32_t section) {
  using F = ContextGsFormat;
  if (section == F::meta) return "settings and cameras";
  if (section == F::geometry) return "positions";
  if (section == F::mask) return "offset masks";
  if (section == HacFormat::hash) return "hash grid";
  if (section == HacPlusFormat::intra) return "context inside anchors";
  if (section == HacPlusFormat::step) return "steps of the coarse level";
  if (section == HacPlusFormat::coarse) return "coarse level";
  if (section == F::levels) return "levels";
  if (section == F::prior) return "prior of the hyperprior";
  if (section == F::hyperprior) return "hyperprior";
  if (section == F::context) return "context network";
  if (section == F::networks) return "rendering networks";
  if (section == F::stream) return "features, extents, offsets";
  if (section == F::digests) return "digests";
  return section == F::tables ? "digest of the tables" : "sections of others";
}

}  // namespace detail

COMPMARK_APP_INLINE Result<CodecEncoded> encode_model(const CodecModel& model, ThreadExecutor& executor) {
  return encode_cmk(model, CodecEncodeSettings{}, executor);
}
COMPMARK_APP_INLINE Result<CodecEncoded> write_coded(const std::filesystem::path& out, const CodecModel& model,
                                                     ThreadExecutor& executor) {
  return write_cmk(out, model, CodecEncodeSettings{}, executor);
}
COMPMARK_APP_INLINE Result<CodecDecoded> read_coded(const std::filesystem::path& path,
                                                    const CodecDecodeSettings& settings, ThreadExecutor& executor) {
  return read_cmk(path, settings, executor);
}
COMPMARK_APP_INLINE Result<CodecDecoded> decode_model(std::span<const std::byte> bytes, const std::string& name,
                                                      const CodecDecodeSettings& settings, ThreadExecutor& executor) {
  return decode_cmk(bytes, name, settings, executor);
}

COMPMARK_APP_INLINE Result<CodecReport> compress_file(const std::filesystem::path& model,
                                                      const std::filesystem::path& out,
                                                      const CodedModelSettings& settings, ThreadExecutor& executor) {
  if (is_coded_file(model))
    return Error{ErrorKind::invalid, model.string(), {}, "is compressed already", "copy the file"};
  const Result<AnyModel> loaded = AnyModel::open(model, executor);
  if (!loaded) return loaded.error();
  const Result<CodecModel> coded = loaded->coded(settings);
  if (!coded) {
    Error error = coded.error();
    error.file = model.string();
    return error;
  }
  const Result<CodecEncoded> encoded = write_coded(out, *coded, executor);
  if (!encoded) return encoded.error();
  return encoded->report;
}

COMPMARK_APP_INLINE Result<Decompressed> decompress_file(const std::filesystem::path& file,
                                                         const std::filesystem::path& out,
                                                         const CodecDecodeSettings& settings,
                                                         ThreadExecutor& executor) {
  Result<CodecDecoded> decoded = read_coded(file, settings, executor);
  if (!decoded) return decoded.error();
  const Result<std::string> recipe = model_recipe(decoded->model);
  if (!recipe) return recipe.error();
  const Result<AnyModel> model = AnyModel::load(ModelSource{file, *recipe, std::move(decoded->model), {}});
  if (!model) return model.error();
  if (const Result<Done> written = model->write(out); !written) return written.error();
  decoded->model = {};
  return Decompressed{model->anchor_count(), std::move(*decoded)};
}

COMPMARK_APP_INLINE SectionBytes coded_sections(const CodecReport& report) {
  SectionBytes sections;
  for (const auto& [kind, bytes] : report.section_bytes) {
    if (bytes != 0) sections.emplace_back(detail::section_purpose(kind), bytes);
  }
  sections.emplace_back("header and table of contents", report.container_bytes);
  if (report.extra_bytes != 0) sections.emplace_back("sections of others", report.extra_bytes);
  std::stable_sort(sections.begin(), sections.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  return sections;
}

COMPMARK_APP_INLINE Result<CodedFile> coded_file(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes = read_file(path);
  if (!bytes) return bytes.error();
  const Result<Container> container = parse_container(*bytes, path.string());
  if (!container) return container.error();
  CodedFile file;
  file.codec = codec_name(container->header.profile);
  std::map<std::string, std::uint64_t> sizes;
  std::uint64_t left = bytes->size();
  for (const SectionEntry& entry : container->sections) {
    sizes[detail::section_purpose(entry.kind)] += entry.size;
    left -= std::min(left, entry.size);
  }
  sizes["header and table of contents"] = left;
  file.sections.assign(sizes.begin(), sizes.end());
  std::stable_sort(file.sections.begin(), file.sections.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  return file;
}

}  // namespace compmark
