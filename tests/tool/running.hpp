// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What every test of the tool does: run it, read what it wrote, and have a key and a decoder at hand.
#pragma once

#include <doctest/doctest.h>

#include <compmark/core/random.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/watermark/decoder/lattice_decoder.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/tool.hpp"

namespace compmark::testing {

/// The numbers of a tensor of a model's file.
inline std::vector<float> block(const std::string& model, const std::string& name) {
  const Result<SafetensorsFile> file = read_safetensors(model);
  REQUIRE(file);
  const Result<std::vector<float>> values = file->values<float>(name);
  REQUIRE(values);
  return *values;
}

/// `before` and `after` are words of the shell around the command.
inline Outcome tool(const std::string& arguments, const std::string& before = {}, const std::string& after = {}) {
  return run_tool(COMPMARK_TOOL, arguments, before, after);
}
/// A command that must succeed.
inline Outcome done(const std::string& arguments) {
  const Outcome outcome = tool(arguments);
  INFO(arguments, "\n", outcome.text);
  REQUIRE(outcome.code == 0);
  return outcome;
}
/// Runs a training or an embedding into the folder `out` and kills it (SIGKILL) as soon as a checkpoint is there.
inline void killed(const std::string& command, const std::string& out) {
  const std::string checkpoint = out + "/checkpoint.safetensors";
  static_cast<void>(tool(command + " --checkpoint-every 20 --out " + out + " 2>&1 & pid=$!; while [ ! -f " +
                         checkpoint +
                         " ]; do kill -0 $pid 2>/dev/null || break; sleep 0.01; done; kill -9 $pid; wait $pid #"));
  REQUIRE(std::filesystem::exists(checkpoint));
}
inline nlohmann::json json_of(const std::filesystem::path& path) {
  const Result<nlohmann::json> json = read_json(path);
  REQUIRE(json.ok());
  return *json;
}
inline std::string text_of(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes = read_file(path);
  REQUIRE(bytes.ok());
  return {reinterpret_cast<const char*>(bytes->data()), bytes->size()};
}
inline std::size_t times_in(const std::string& text, const std::string& piece) {
  std::size_t count = 0;
  for (std::size_t at = text.find(piece); at != std::string::npos; at = text.find(piece, at + 1)) ++count;
  return count;
}
inline std::vector<std::byte> file_bytes(const std::filesystem::path& path) {
  Result<std::vector<std::byte>> bytes = read_file(path);
  REQUIRE(bytes.ok());
  return *bytes;
}

/// Words for verify: a claim that names this key and decoder (none: the shipped one), written beside the key.
inline std::string claimed(const std::string& key, const std::string& decoder = {}, const std::string& more = {}) {
  const std::string file = key + ".claim";
  std::filesystem::remove(file);  // another claim is never written over
  done("claim --key " + key + (decoder.empty() ? "" : " --decoder " + decoder) + more + " --out " + file);
  return " --claim " + file;
}

/// A key that is the same in every run.
inline OwnerKey fixed_key(int number, std::size_t bits) {
  Digest256 secret{};
  secret[0] = static_cast<std::byte>(number);
  const Result<OwnerKey> key = make_key(secret, "2026-01-01T00:00:00Z", bits);
  REQUIRE(key.ok());
  return *key;
}

/// A lattice that nobody trained, so that seconds do; `frequency` is the deviation of its features' phases over the range of a colour.
inline LatticeDecoder<float> untrained_lattice(int bits, int features, double frequency) {
  LatticeSettings settings;
  settings.bits = bits;
  settings.features = features;
  settings.sigma = {1.5, 3, 6};
  LatticeWeights<float> weights(settings);
  const Random random(3, 0, random_stage("test/tool decoder"));
  std::uint64_t n = 0;
  for (float& value : weights.frequency) value = static_cast<float>(frequency * random.normal(n++));
  for (std::vector<float>* part : {&weights.phase, &weights.head})
    for (float& value : *part) value = static_cast<float>(random.normal(n++));
  return {settings, weights};
}

/// Fourier features of colour as they are drawn, one a bit: a mark that a small scene takes in seconds. A logit of 1 is about a deviation of the unmarked.
inline LatticeDecoder<float> untrained_colours(int bits) {
  LatticeSettings settings;
  settings.measure = LatticeMeasure::colour;
  settings.bits = settings.features = bits;
  settings.sigma = {0.5};
  settings.stride = 1;
  settings.gate = 0.02;
  LatticeWeights<float> weights(settings);
  const Random random(3, 0, random_stage("test/tool decoder"));
  std::uint64_t n = 0;
  for (float& value : weights.frequency) value = static_cast<float>(8 * random.normal(n++));
  for (float& value : weights.phase) value = static_cast<float>(random.uniform(n++));
  for (std::size_t b = 0; b < weights.phase.size(); ++b) weights.head[b * (weights.phase.size() + 1)] = 10;
  return {settings, weights};
}

}  // namespace compmark::testing
