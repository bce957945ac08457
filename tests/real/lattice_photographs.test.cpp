// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The shipped decoders on photographs that they were not trained on: what their cards state, on a few.
#include <doctest/doctest.h>

#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/scene/image_folder.hpp"
#include "compmark/watermark/decoder/stored_decoder.hpp"
#include "compmark/watermark/pretrain/decoder_measure.hpp"
#include "compmark/watermark/pretrain/photograph_split.hpp"
#include "support/data.hpp"

using namespace compmark;

namespace {

struct Codec {
  void operator()(ImageView<const float> image, int quality, ImageView<float> output) const {
    const Result<ImageBytes> read = decode_image(encode_jpeg(to_bytes(image), quality), "");
    for (std::size_t i = 0; i < image.plane_size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        output.data[c * image.plane_size() + i] = static_cast<float>(read->pixels[3 * i + c]) / 255.0f;
    }
  }
};

}  // namespace

TEST_CASE("mark/lattice: shipped decoders on photographs that were held out, clean and distorted") {
  const auto data = testing::data_dir();
  if (!data || !std::filesystem::exists(*data / "natural_crops256")) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  const std::filesystem::path folder = *data / "natural_crops256";
  const std::vector<std::string> names = detail::image_names(folder);
  const std::set<std::string> groups = held_out_groups(names, 0.2);
  std::vector<std::string> held;
  for (const std::string& name : names) {
    if (groups.count(photograph_group(name)) != 0) held.push_back(name);
  }
  REQUIRE(held.size() == 214);
  constexpr std::size_t images = 6;
  const auto image = [&](std::size_t i, std::vector<float>& pixels) {
    const Result<ImageBytes> read = read_image(folder / held[i * held.size() / images]);
    REQUIRE(read.ok());
    const auto channels = static_cast<std::size_t>(read->channels);
    const std::size_t count = read->pixels.size() / channels;
    pixels.resize(3 * count);
    for (std::size_t p = 0; p < count; ++p) {
      for (std::size_t c = 0; c < 3; ++c)
        pixels[c * count + p] = static_cast<float>(read->pixels[p * channels + (channels < 3 ? 0 : c)]) / 255.0f;
    }
    return ImageView<const float>{pixels.data(), 3, read->height, read->width};
  };
  PixelEmbeddingSettings settings;
  settings.steps = 100;
  ThreadExecutor executor(2);
  for (const int bits : {32, 48, 64}) {
    CAPTURE(bits);
    const auto file = read_safetensors("weights/lattice_" + std::to_string(bits) + ".safetensors");
    REQUIRE(file.ok());
    const auto decoder = StoredDecoder<>::read(*file);
    REQUIRE(decoder.ok());
    settings.temperature = decoder->logit_scale();
    const DecoderMeasurement result = measure_decoder(*decoder, images, image, settings, 3, Codec{}, executor);
    CHECK(result.psnr >= 38);
    const std::vector<MeasuredDistortion> kinds = measured_distortions();
    for (std::size_t d = 0; d < kinds.size(); ++d) {
      const std::string name(kinds[d].name);
      CAPTURE(name);
      CAPTURE(result.accuracy[d]);
      if (name == "none") CHECK(result.accuracy[d] >= 0.99);
      // The cards measure 32 photographs and twice the steps; six of them scatter by about two points. 64 bits read
      // .862 after scaling here (.916 on the card), and .823 before the training.
      const double least = bits == 64 ? 0.84 : 0.88;
      if (name == "noise 0.1" || name == "JPEG 50" || name == "scale 75 % (side)" || name == "crop 40 % (area)")
        CHECK(result.accuracy[d] >= least);
    }
  }
}
