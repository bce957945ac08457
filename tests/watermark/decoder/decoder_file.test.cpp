// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/decoder_file.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "compmark/io/safetensors.hpp"
#include "support/decoder.hpp"

namespace {

using namespace compmark;

std::filesystem::path folder() {
  const auto path = std::filesystem::temp_directory_path() / "compmark_decoder_file_test";
  std::filesystem::create_directories(path);
  return path;
}

/// The error line of a file made from `weights` whose metadata `edit` may change; without the path.
std::string refusal(const DecoderWeights& weights, const std::function<void(SafetensorsWriter&)>& edit = {}) {
  SafetensorsWriter writer;
  add_decoder(weights, writer);
  if (edit) edit(writer);
  const auto path = folder() / "bad.safetensors";
  REQUIRE(writer.write(path).ok());
  const auto file = read_safetensors(path);
  REQUIRE(file.ok());
  const auto result = read_decoder(*file);
  if (result) return "accepted";
  CHECK(result.error().file == path.string());
  CHECK(result.error().line().find('\n') == std::string::npos);
  CHECK(!result.error().remedy.empty());
  return result.error().field + ": " + result.error().problem;
}

}  // namespace

TEST_CASE("decoder/decoder_file: what is written comes back, every kind, to the bit") {
  DecoderWeights carrier = testing::small_decoder(4, 5, 2);
  carrier.kind = DecoderKind::carrier;
  carrier.bits = 0;
  carrier.activation = DecoderActivation::relu;
  carrier.linear_weight.clear();
  carrier.linear_bias.clear();
  carrier.layers[1].pool = carrier.layers[1].tap = true;
  carrier.layers[1].shape.stride = 2;
  for (auto part :
       {&DecoderLayer::norm_weight, &DecoderLayer::norm_bias, &DecoderLayer::norm_mean, &DecoderLayer::norm_variance})
    (carrier.layers[2].*part).clear();
  carrier.whiten_weight.assign(3 * 9, 0.5f);
  carrier.whiten_bias.assign(3, -1.0f);
  DecoderWeights strided = testing::small_decoder(4, 5, 2, 4);
  strided.whiten_weight.clear();
  strided.whiten_bias.clear();
  strided.note = "note, with \"quotes\"";
  for (DecoderWeights weights : {testing::small_decoder(4, 5, 2), strided, carrier}) {
    weights.input = {2,
                     0.1,
                     {0.1, 0.2, 0.3},
                     {1.0 / 3, 2, 3},
                     100,
                     weights.stem == 1 ? 90 : 0,
                     weights.stem == 1,
                     weights.stem == 1 ? 0.8 : 0};
    weights.logit_scale = 1.0 / 7;
    const auto path = folder() / "round.safetensors";
    REQUIRE(write_decoder<SafetensorsWriter>(weights, path).ok());
    const auto file = read_safetensors(path);
    REQUIRE(file.ok());
    CHECK(file->metadata.contains("smallest_side") == (weights.input.smallest_side != 0));  // else the bytes of before
    CHECK(file->metadata.contains("reads") == weights.input.subject_alone);
    CHECK(file->metadata.contains("middle") == (weights.input.middle != 0));
    const auto back = read_decoder(*file);
    REQUIRE_MESSAGE(back.ok(), back.error().line());
    CHECK(back->kind == weights.kind);
    CHECK(back->bits == weights.bits);
    CHECK(back->stem == weights.stem);
    CHECK(back->activation == weights.activation);
    CHECK(back->input == weights.input);
    CHECK(back->logit_scale == weights.logit_scale);
    CHECK(back->norm_epsilon == weights.norm_epsilon);
    CHECK(back->note == weights.note);
    REQUIRE(back->layers.size() == weights.layers.size());
    for (std::size_t l = 0; l < weights.layers.size(); ++l) {
      CHECK(back->layers[l].weight == weights.layers[l].weight);
      CHECK(back->layers[l].norm_variance == weights.layers[l].norm_variance);
      CHECK(back->layers[l].shape.stride == weights.layers[l].shape.stride);
      CHECK(back->layers[l].pool == weights.layers[l].pool);
      CHECK(back->layers[l].tap == weights.layers[l].tap);
    }
    CHECK(back->linear_weight == weights.linear_weight);
    CHECK(back->whiten_weight == weights.whiten_weight);
    CHECK(back->whiten_bias == weights.whiten_bias);
  }
}

TEST_CASE("decoder/decoder_file: a published file without metadata has the convention of the published decoders") {
  SafetensorsWriter writer;
  const DecoderWeights weights = testing::small_decoder(4, 5, 2);
  add_decoder(weights, writer);
  writer.metadata.clear();
  const auto path = folder() / "published.safetensors";
  REQUIRE(writer.write(path).ok());
  const auto file = read_safetensors(path);
  const auto back = read_decoder(*file);
  REQUIRE(back.ok());
  CHECK(back->bits == 4);
  CHECK(back->width == 5);
  CHECK(back->depth == 2);
  CHECK(back->kind == DecoderKind::hidden);
  CHECK(back->input == InputConvention{1, 1, {0, 0, 0}, {1, 1, 1}, 0});
  CHECK(back->logit_scale == 10);
}

TEST_CASE("decoder/decoder_file: bad files are refused with one line that names the place") {
  const DecoderWeights good = testing::small_decoder(4, 5, 2);
  CHECK(refusal(good) == "accepted");
  const auto with = [&](const char* key, const char* value) {
    return refusal(good, [=](SafetensorsWriter& w) { w.metadata[key] = value; });
  };
  const auto without = [&](const char* key) {
    return refusal(good, [=](SafetensorsWriter& w) { w.metadata.erase(key); });
  };
  CHECK(with("bits", "48") == "linear.weight: has shape [4, 4], expected [48, 4]");
  CHECK(with("bits", "0") == "__metadata__.bits: \"0\" is not an integer from 1 to 4096");
  CHECK(with("bits", "99999999999999999999") ==
        "__metadata__.bits: \"99999999999999999999\" is not an integer from 1 to 4096");
  CHECK(with("bits", "4 ") == "__metadata__.bits: \"4 \" is not an integer from 1 to 4096");
  CHECK(without("bits") == "__metadata__.bits: is missing");
  CHECK(with("width", "6") == "blocks.0.conv.weight: has shape [5, 3, 3, 3], expected [6, 3, 3, 3]");
  CHECK(with("depth", "3").find("blocks.2.conv.weight: has shape") == 0);
  CHECK(with("depth", "1000000").find("__metadata__.depth") == 0);
  CHECK(with("kind", "resnet") == "__metadata__.kind: \"resnet\" is not hidden, strided or carrier");
  CHECK(with("kind", "carrier").find("__metadata__.layers") != 0);  // its layers are read, then its whitening
  CHECK(with("format", "something") == "__metadata__.format: \"something\" is not \"compmark decoder\"");
  CHECK(with("format_version", "2") == "__metadata__.format_version: 2 is newer than this program's 1");
  CHECK(with("input_mean", "0 0") == "__metadata__.input_mean: \"0 0\" is not 3 finite numbers");
  CHECK(with("input_deviation", "1 1 0") == "__metadata__.input_deviation: is not above 0");
  CHECK(with("input_gain", "nan") == "__metadata__.input_gain: \"nan\" is not 1 finite number");
  CHECK(with("haar_levels", "3") == "__metadata__.haar_levels: \"3\" is not an integer from 0 to 2");
  CHECK(with("smallest_side", "-1").find("__metadata__.smallest_side: \"-1\" is not an integer from 0 to ") == 0);
  CHECK(refusal(good, [](SafetensorsWriter& w) {
          w.metadata["largest_side"] = "256";
          w.metadata["smallest_side"] = "257";
        }) == "__metadata__.smallest_side: \"257\" is not an integer from 0 to 256");
  // Every picture would be enlarged to it, which takes terabytes; a picture that is larger already may be read so.
  const auto sides = [&](const char* largest, const char* smallest) {
    return refusal(good, [=](SafetensorsWriter& w) {
      w.metadata["largest_side"] = largest;
      w.metadata["smallest_side"] = smallest;
    });
  };
  for (const char* largest : {"0", "1048576"}) {
    CAPTURE(largest);
    CHECK(sides(largest, "1048576") == "__metadata__.smallest_side: \"1048576\" is not an integer from 0 to 8192");
    CHECK(sides(largest, "8193") == "__metadata__.smallest_side: \"8193\" is not an integer from 0 to 8192");
    CHECK(sides(largest, "8192") == "accepted");
  }
  CHECK(with("reads", "frame") == "__metadata__.reads: \"frame\" is not picture or subject");
  for (const char* share : {"0", "1", "-0.5"}) {
    CAPTURE(share);
    CHECK(with("middle", share) == "__metadata__.middle: is not between 0 and 1");
  }
  CHECK(with("middle", "nan") == "__metadata__.middle: \"nan\" is not 1 finite number");
  CHECK(with("stem", "2") == "__metadata__.stem: a hidden decoder has none (1)");
  CHECK(with("activation", "tanh") == "__metadata__.activation: \"tanh\" is not gelu or relu");

  DecoderWeights bad = good;
  bad.layers[1].weight[7] = std::numeric_limits<float>::quiet_NaN();
  CHECK(refusal(bad) == "blocks.1.conv.weight: holds a NaN");
  bad = good;
  bad.whiten_bias[0] = std::numeric_limits<float>::infinity();
  CHECK(refusal(bad) == "whiten.bias: holds an infinity");
  bad = good;
  bad.layers[0].norm_variance[2] = -1;
  CHECK(refusal(bad) == "blocks.0.bn.running_var: holds a variance below 0");
  bad = good;
  bad.linear_bias.clear();
  CHECK(refusal(bad) == "linear.weight: no such tensor");
  bad = good;
  bad.layers.erase(bad.layers.begin() + 1);
  CHECK(refusal(bad) == "blocks.1.conv.weight: has shape [4, 5, 3, 3], expected [5, 5, 3, 3]");

  DecoderWeights carrier = good;
  carrier.kind = DecoderKind::carrier;
  const auto layers = [&](const char* text) {
    return refusal(carrier, [=](SafetensorsWriter& w) { w.metadata["layers"] = text; });
  };
  for (const char* text : {"", "3", "3/1", "3/1/1", "3/0/1t", "3/1/9t", "99/1/1t", "3/1/1x", "3/1/1t  ", "-3/1/1t"}) {
    CHECK_MESSAGE(layers(text).find("__metadata__.layers") == 0, text);
  }
}

TEST_CASE("decoder/decoder_file: a file cut short is refused, wherever it is cut") {
  const auto path = folder() / "whole.safetensors";
  REQUIRE(write_decoder<SafetensorsWriter>(testing::small_decoder(4, 5, 2), path).ok());
  std::ifstream in(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const auto cut = folder() / "cut.safetensors";
  for (std::size_t n = 0; n < bytes.size(); n += 97) {
    std::ofstream(cut, std::ios::binary | std::ios::trunc).write(bytes.data(), static_cast<std::streamsize>(n));
    CHECK(!read_safetensors(cut).ok());
  }
}
