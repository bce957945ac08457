// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A codec of one's own: whole numbers of base steps, in as many bytes as they need, without a context. It is written,
// read and described by the functions that the shipped codecs go through, and no file of the library is edited for it;
// to ship it is two edits, its name in codecs.hpp and its header in codec.hpp, and a third for the recipe of the tool.
#include "compmark/codec/container/codecs.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/codec/container/cmk.hpp"
#include "compmark/codec/container/inspect.hpp"
#include "compmark/core/thread_executor.hpp"
#include "support/codec_model.hpp"

namespace own_codec_test {
namespace {

using namespace compmark;

struct PlainCodec {
  static constexpr ContainerProfile profile = static_cast<ContainerProfile>(1001);
  static constexpr const char* name = "plain";
  static constexpr std::uint32_t rows = four_characters("ROWS");
  static constexpr std::array<std::uint32_t, 3> known{CodecFormat::meta, CodecFormat::networks, rows};
  static constexpr CodecSections sections{profile, "plain", known, {}, {}, 1};

  static bool codes(const CodecModel& model) {
    return !model.trained && !model.context && !model.trained_gs && !model.context_gs;
  }
  /// Every number of a model in turn, as an integer of its step: what reads and what writes go through the same.
  template <class Model, class Use>
  static void each(Model& model, const Use& use) {
    const std::size_t d = static_cast<std::size_t>(model.feature_dim), k = static_cast<std::size_t>(model.offset_count);
    for (std::size_t i = 0; i < model.voxels.size(); ++i) {
      for (auto& cell : model.voxels[i]) use(cell, 1.0);
      use(model.mask[i], 1.0);
      for (std::size_t c = 0; c < d; ++c) use(model.feature[d * i + c], model.base_step[0]);
      for (std::size_t c = 0; c < 6; ++c) use(model.scale[6 * i + c], model.base_step[1]);
      for (std::size_t c = 0; c < 3 * k; ++c) use(model.offset[3 * k * i + c], model.base_step[2]);
    }
  }
  template <Executor E>
  static Result<CodecEncoded> encode(const CodecModel& model, const CodecEncodeSettings&, E&) {
    CodecEncoded result;
    result.model = model;
    std::vector<std::int64_t> symbols;
    each(result.model, [&](auto& value, double step) {
      symbols.push_back(static_cast<std::int64_t>(std::nearbyint(static_cast<double>(value) / step)));
      value = static_cast<std::remove_reference_t<decltype(value)>>(static_cast<double>(symbols.back()) * step);
    });
    ByteWriter writer;
    for (const std::int64_t symbol : symbols) {  // sign in the lowest bit, seven bits a byte
      std::uint64_t left =
          symbol < 0 ? static_cast<std::uint64_t>(-2 * symbol - 1) : static_cast<std::uint64_t>(2 * symbol);
      for (; left >= 128; left >>= 7) writer.put(static_cast<std::uint8_t>(left | 128));
      writer.put(static_cast<std::uint8_t>(left));
    }
    std::vector<Section> parts(3);
    parts[0].bytes = detail::encode_meta(model, model.anchors());
    parts[1].bytes = encode_networks(model.networks);
    parts[2].bytes = writer.take();
    for (std::size_t i = 0; i < 3; ++i) parts[i].entry.kind = known[i];
    parts[2].entry.items = symbols.size();
    Result<std::vector<CodecTensor>> stored = decode_networks(parts[1].bytes);
    if (!stored) return stored.error();
    result.model.networks = std::move(*stored);
    ContainerHeader header;
    header.profile = profile;
    header.numeric_spec = CodecFormat::numeric_spec;
    result.bytes = write_container(header, parts);
    result.report.profile = profile;
    result.report.anchors = model.anchors();
    result.report.total_bytes = result.bytes.size();
    return result;
  }
  template <Executor E>
  static Result<CodecDecoded> decode(std::span<const std::byte> bytes, const std::string& path,
                                     const CodecDecodeSettings& settings, E&) {
    const Result<Container> file = parse_container(bytes, path);
    if (!file) return file.error();
    if (Result<Done> known_all = detail::check_sections(*file, sections); !known_all) return known_all.error();
    std::array<std::span<const std::byte>, 3> parts;
    for (std::size_t i = 0; i < 3; ++i) {
      const SectionEntry* const entry = file->find(known[i]);
      if (entry == nullptr)
        return file->error(ErrorKind::malformed, section_name(known[i]), "is missing", "copy the file again");
      const auto payload = file->payload(*entry);
      if (!payload) return payload.error();
      parts[i] = *payload;
    }
    CodecDecoded result;
    result.header = file->header;
    CodecModel& model = result.model;
    const Result<std::uint64_t> anchors = detail::decode_meta(parts[0], model);
    if (!anchors) return anchors.error();
    const std::uint64_t width = 10 + static_cast<std::uint64_t>(model.feature_dim + 3 * model.offset_count);
    if (*anchors > parts[2].size() / width || *anchors * width * 4 > settings.memory_limit)
      return file->error(ErrorKind::malformed, "ROWS", "has too few bytes for its anchors", "copy the file again");
    const std::size_t n = static_cast<std::size_t>(*anchors);
    model.voxels.resize(n);
    model.mask.resize(n);
    model.feature.resize(n * static_cast<std::size_t>(model.feature_dim));
    model.scale.resize(n * 6);
    model.offset.resize(n * 3 * static_cast<std::size_t>(model.offset_count));
    ByteReader reader(parts[2]);
    each(model, [&](auto& value, double step) {
      std::uint64_t bits = 0, byte = 128;
      for (int shift = 0; byte >= 128 && shift < 56; shift += 7)
        bits |= ((byte = reader.get<std::uint8_t>()) & 127) << shift;
      const std::int64_t symbol =
          (bits & 1) != 0 ? -static_cast<std::int64_t>(bits / 2) - 1 : static_cast<std::int64_t>(bits / 2);
      value = static_cast<std::remove_reference_t<decltype(value)>>(static_cast<double>(symbol) * step);
    });
    if (!reader.complete())
      return file->error(ErrorKind::malformed, "ROWS", "does not end where its anchors do", "copy the file again");
    Result<std::vector<CodecTensor>> networks = decode_networks(parts[1]);
    if (!networks) return networks.error();
    model.networks = std::move(*networks);
    result.verified = true;
    return result;
  }
};
using Codecs = ShippedCodecs::With<PlainCodec>;

CodecModel plain_model() {
  CodecModel model = testing::make_codec_model(5, {.anchors = 60});
  model.trained.reset();
  return model;
}
bool same(const CodecModel& a, const CodecModel& b) {
  return a.voxels == b.voxels && a.mask == b.mask && a.feature == b.feature && a.scale == b.scale &&
         a.offset == b.offset && a.networks == b.networks && a.metadata == b.metadata && a.base_step == b.base_step;
}

}  // namespace

TEST_CASE("container/own_codec: a codec of one's own is written, read and described as the shipped ones are") {
  ThreadExecutor executor(2);
  const CodecModel model = plain_model();
  const auto file = encode_cmk<Codecs>(model, {}, executor);
  REQUIRE(file.ok());
  const auto read = decode_cmk<Codecs>(file->bytes, "a.cmk", {}, executor);
  REQUIRE(read.ok());
  CHECK(same(read->model, file->model));
  CHECK_FALSE(same(read->model, model));  // it did round
  for (std::size_t i = 0; i < model.feature.size(); ++i)
    CHECK(std::abs(read->model.feature[i] - model.feature[i]) <= 0.5001 * model.base_step[0]);
  CHECK(encode_cmk<Codecs>(read->model, {}, executor)->bytes == file->bytes);
  const auto info = inspect_cmk<Codecs>(file->bytes, "a.cmk");
  REQUIRE(info.ok());
  CHECK(info->anchors == 60);
  CHECK(info->bytes_of(PlainCodec::rows) > 0);
  CHECK(std::string(codec_name<Codecs>(info->header.profile)) == "plain");
  const auto names = Codecs::names();
  const auto shipped = ShippedCodecs::names();
  CHECK(std::string(names.back()) == "plain");
  CHECK(std::equal(shipped.begin(), shipped.end(), names.begin(), names.end() - 1));

  const CodecModel hac = testing::make_codec_model(5, {.anchors = 60});  // the others are in the list as before
  CHECK(encode_cmk<Codecs>(hac, {}, executor)->bytes == encode_cmk(hac, {}, executor)->bytes);
  CHECK(decode_cmk<Codecs>(encode_cmk(hac, {}, executor)->bytes, "a.cmk", {}, executor)->verified);
}

TEST_CASE(
    "container/own_codec: no change of a byte is taken for another model, and who does not know the codec says so") {
  SerialExecutor executor;
  const auto file = encode_cmk<Codecs>(plain_model(), {}, executor);
  for (std::size_t i = 0; i < file->bytes.size(); i += 7) {
    std::vector<std::byte> damaged = file->bytes;
    damaged[i] ^= std::byte{16};
    const auto read = decode_cmk<Codecs>(damaged, "a.cmk", {}, executor);
    if (read.ok()) CAPTURE(i);
    CHECK_FALSE(read.ok());
  }
  const auto unknown = decode_cmk(file->bytes, "a.cmk", {}, executor);
  REQUIRE_FALSE(unknown.ok());
  CHECK(unknown.error().line().find("profile: 1001 is not that of HAC") != std::string::npos);
}

}  // namespace own_codec_test
