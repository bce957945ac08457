// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message decoder of one's own, with files of its own kind: the means of blocks of an image, along patterns of a key.
// It obeys the laws, is written, is read beside the shipped kinds, and reads what was hidden in a picture. Nothing of
// the library is edited for it; to ship one is two edits, its kind in decoder_formats.hpp and its header in watermark.hpp.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/testing/mark_laws.hpp"
#include "compmark/watermark/decoder/decoder_file.hpp"
#include "compmark/watermark/decoder/stored_decoder.hpp"
#include "compmark/watermark/pretrain/pixel_embedding.hpp"
#include "compmark/watermark/proof/verify.hpp"
#include "support/decoder.hpp"
#include "support/scene_files.hpp"

namespace own_decoder_test {
namespace {

using namespace compmark;

/// Logit i is `gain` times the sum of the means of side x side blocks of an image, with the signs of pattern i.
template <class T>
class BlockMeans {
 public:
  using Scalar = T;
  struct Context {};
  static constexpr T gain = 4;

  BlockMeans() = default;
  BlockMeans(int bits, int side, std::vector<float> signs) : bits_(bits), side_(side), signs_(std::move(signs)) {}
  /// The patterns of a key. Every other block has the opposite sign of the one before: brightness is no message.
  static BlockMeans of(const DecoderKey& key, int side) {
    std::vector<float> signs;
    for (std::size_t i = 0; i < static_cast<std::size_t>(key.bits * side * side); ++i)
      signs.push_back(i % 2 == 1 ? -signs.back() : Random(key.seed[0], key.seed[1], 0).centered(i) < 0 ? -1.0f : 1.0f);
    return {key.bits, side, std::move(signs)};
  }
  [[nodiscard]] int bits() const { return bits_; }
  [[nodiscard]] int side() const { return side_; }
  [[nodiscard]] const std::vector<float>& signs() const { return signs_; }
  [[nodiscard]] int minimum_size() const { return side_; }

  template <Executor E>
  void forward(ImageView<const T> image, std::span<T> logits, Context&, E&) const {
    std::fill(logits.begin(), logits.end(), T(0));
    each(image, [&](std::size_t bit, std::size_t i, T weight) { logits[bit] += weight * image.data[i]; });
  }
  template <Executor E>
  void backward(std::span<const T> d_logits, ImageView<T> d_image, Context&, E&) const {
    each(d_image, [&](std::size_t bit, std::size_t i, T weight) { d_image.data[i] += weight * d_logits[bit]; });
  }

 private:
  template <class Use>
  void each(ImageView<const T> image, const Use& use) const {
    const std::size_t blocks = static_cast<std::size_t>(side_ * side_);
    const T weight = gain * static_cast<T>(blocks) / static_cast<T>(image.size());
    for (std::size_t bit = 0; bit < static_cast<std::size_t>(bits_); ++bit) {
      for (std::size_t i = 0; i < image.size(); ++i) {
        const int pixel = static_cast<int>(i % image.plane_size());
        const int row = pixel / image.width * side_ / image.height, column = pixel % image.width * side_ / image.width;
        const std::size_t block = static_cast<std::size_t>(row * side_ + column);
        use(bit, i, weight * static_cast<T>(signs_[bit * blocks + block]));
      }
    }
  }

  int bits_ = 0, side_ = 0;
  std::vector<float> signs_;  ///< [bits, side, side], each 1 or -1
};

/// Its files: kind "blocks", metadata bits and side, and a tensor block.signs [bits, side, side].
template <class T>
struct BlockFormat {
  using Decoder = BlockMeans<T>;
  static constexpr std::string_view kind = "blocks";
  template <class TensorFile>
  static Result<Decoder> read(const TensorFile& file, const std::optional<DecoderKey>&) {
    compmark::detail::DecoderReader<TensorFile> reader(file);
    const int bits = reader.integer("bits", 1, 4096), side = reader.integer("side", 2, 64);
    std::vector<float> signs = reader.tensor("block.signs", bits, side, side);
    for (const float sign : signs) {
      if (std::abs(sign) != 1) reader.fail(ErrorKind::invalid, "block.signs", "is not of 1 and -1", reader.remedy);
    }
    if (reader.failed()) return reader.error();
    return Decoder(bits, side, std::move(signs));
  }
  static Result<Done> write(const Decoder& decoder, const std::filesystem::path& path) {
    SafetensorsWriter writer;
    writer.metadata = {{"format", std::string(decoder_format)},
                       {"format_version", "1"},
                       {"kind", std::string(kind)},
                       {"bits", std::to_string(decoder.bits())},
                       {"side", std::to_string(decoder.side())}};
    writer.add_values("block.signs", {decoder.bits(), decoder.side(), decoder.side()},
                      std::span<const float>(decoder.signs()));
    return writer.write(path);
  }
};

template <class T>
using Longer =
    StoredDecoder<T, DirectConvolution, typename ShippedDecoders<T, DirectConvolution>::template With<BlockFormat<T>>>;
static_assert(MessageDecoder<BlockMeans<float>> && MessageDecoder<Longer<float>>);
constexpr DecoderKey secret{{7, 8, 9, 10}, 32};

}  // namespace

TEST_CASE("decoder/own_decoder: obeys the laws, alone and held by a StoredDecoder, at sizes its blocks do not divide") {
  const testing::TemporaryFolder folder;
  const auto path = folder.path() / "blocks.safetensors";
  CHECK(testing::message_decoder_laws(BlockMeans<double>::of({{1, 2, 3, 4}, 5}, 6), 13, 17) == "");
  CHECK(testing::message_decoder_laws(BlockMeans<double>::of({{1, 2, 3, 4}, 5}, 6), 6, 6) == "");
  REQUIRE(BlockFormat<float>::write(BlockMeans<float>::of(secret, 6), path).ok());
  const auto held = Longer<double>::read(*read_safetensors(path));
  REQUIRE(held.ok());
  CHECK(testing::message_decoder_laws(*held, 13, 17) == "");
}

TEST_CASE(
    "decoder/own_decoder: a list with one kind more reads its files and all others; the shipped list says what it "
    "knows") {
  const testing::TemporaryFolder folder;
  const auto path = folder.path() / "decoder.safetensors";
  REQUIRE(BlockFormat<float>::write(BlockMeans<float>::of(secret, 12), path).ok());
  auto file = read_safetensors(path, FileKind::decoder);
  REQUIRE(file.ok());
  const auto own = Longer<float>::read(*file);
  REQUIRE(own.ok());
  CHECK(own->bits() == 32);
  CHECK(own->minimum_size() == 12);
  CHECK(own->logit_scale() == 1);
  const auto refused = StoredDecoder<float>::read(*file);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().line() == path.string() +
                                      ": __metadata__.kind: \"blocks\" is none of hidden, strided, carrier, lattice; "
                                      "check that this is a decoder file, or use a newer program");
  file->metadata["side"] = "11";
  CHECK_FALSE(Longer<float>::read(*file).ok());

  REQUIRE(write_decoder<SafetensorsWriter>(testing::small_decoder(4, 5, 2), path).ok());
  auto published = read_safetensors(path);
  CHECK(Longer<float>::read(*published)->bits() == 4);
  published->metadata.clear();
  CHECK(Longer<float>::read(*published)->bits() == 4);
}

TEST_CASE(
    "decoder/own_decoder: a small picture is marked through a file of one's own kind, and another key reads nothing") {
  const testing::TemporaryFolder folder;
  const auto path = folder.path() / "blocks.safetensors";
  REQUIRE(BlockFormat<float>::write(BlockMeans<float>::of(secret, 12), path).ok());
  const auto decoder = Longer<float>::read(*read_safetensors(path));
  REQUIRE(decoder.ok());
  const std::vector<float> image = testing::random_image<float>(48, 48);
  std::vector<float> marked(image.size()), signs(32);
  const Message message = Message::from_words(0x5bd1e995, 0, 32);
  for (std::size_t i = 0; i < 32; ++i) signs[i] = message[i] ? 1.0f : -1.0f;
  PixelEmbedding<Longer<float>> embedding;
  PixelEmbeddingSettings settings;
  settings.steps = 80;
  settings.psnr = 32;
  settings.temperature = 5;
  settings.augmentation = no_augmentation();
  SerialExecutor executor;
  const ImageView<float> out{marked.data(), 3, 48, 48};
  embedding.embed(
      *decoder, ImageView<const float>{image.data(), 3, 48, 48}, std::span<const float>(signs), settings, 1,
      [](auto&&...) {}, out, executor);
  round_to_8bit<float>(out, out);
  const auto verdict = [&](const auto& reader, const std::vector<float>& pixels) {
    typename std::remove_cvref_t<decltype(reader)>::Context context;
    std::vector<float> logits(32);
    reader.forward(ImageView<const float>{pixels.data(), 3, 48, 48}, std::span<float>(logits), context, executor);
    return verify_message(message, std::vector<ViewLogits>{{"a", "", {logits.begin(), logits.end()}}})->verdict;
  };
  CHECK(verdict(*decoder, marked) == Verdict::detected);
  CHECK(verdict(*decoder, image) != Verdict::detected);
  CHECK(verdict(BlockMeans<float>::of({{7, 8, 9, 10}, 32}, 12), marked) == Verdict::detected);
  CHECK(verdict(BlockMeans<float>::of({{8, 8, 9, 10}, 32}, 12), marked) != Verdict::detected);
}

}  // namespace own_decoder_test
