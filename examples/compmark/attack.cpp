// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark attack: applies an attack to a model and writes the result, for evaluate, extract and verify to read.
#include <compmark/io/json_file.hpp>
#include <compmark/splat/quantizer/int8_quantizer.hpp>
#include <compmark/watermark/attack/quantize_model.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <vector>

#include "commands.hpp"
#include "common.hpp"
#include "model_files.hpp"
#include "reading.hpp"

namespace tool {
namespace {

using namespace compmark;

struct AttackOptions {
  std::filesystem::path model;
  std::filesystem::path out;
  std::filesystem::path json;
  std::string int8;
  bool symmetric = false;
  bool keep_positions = false;
  bool keep_networks = false;
};

int attack(const AttackOptions& options) {
  using Quantizer = Int8Quantizer<float>;
  Result<AnyModel> loaded = load_model(options.model);
  if (!loaded) return fail(loaded.error());
  AnyModel& model = *loaded;
  const Int8Scheme scheme = options.symmetric ? Int8Scheme::symmetric : Int8Scheme::affine;
  const bool channels = options.int8 == "channel";
  const Result<Quantizer> anchors =
      Quantizer::create({scheme, channels ? Int8Channels::columns : Int8Channels::tensor});
  const Result<Quantizer> networks = Quantizer::create({scheme, channels ? Int8Channels::rows : Int8Channels::tensor});
  if (!anchors) return fail(anchors.error());
  if (!networks) return fail(networks.error());
  QuantizeModelSettings settings;
  settings.networks = !options.keep_networks;
  if (options.keep_positions) settings.kept = find_anchor_blocks(model.arena().layout()).position;
  const Result<std::vector<QuantizedBlock>> blocks = quantize_model(model.arena(), *anchors, *networks, settings);
  if (!blocks) {
    Error error = blocks.error();
    error.file = options.model.string();
    return fail(error);
  }
  if (Result<Done> written = model.write(options.out); !written) return fail(written.error());
  nlohmann::ordered_json json{{"schema", "compmark.attack.1"},
                              {"attack", "int8"},
                              {"channels", options.int8},
                              {"scheme", options.symmetric ? "symmetric" : "affine"},
                              {"tensors", nlohmann::ordered_json::array()}};
  std::printf("int8, %s, a scale a %s\n", options.symmetric ? "symmetric" : "affine", options.int8.c_str());
  for (const QuantizedBlock& block : *blocks) {
    std::printf("  %-24s %9zu values  error %.3g rms, %.3g at most; %.2g of their deviation\n", block.name.c_str(),
                block.values, block.rms_error, block.largest_error,
                block.deviation > 0 ? block.rms_error / block.deviation : 0.0);
    json["tensors"].push_back({{"name", block.name},
                               {"values", block.values},
                               {"deviation", block.deviation},
                               {"rms_error", block.rms_error},
                               {"largest_error", block.largest_error}});
  }
  std::printf("%s: %zu anchors\n", options.out.string().c_str(), model.anchor_count());
  if (options.json.empty()) return success;
  if (Result<Done> written = write_file(options.json, json.dump(2) + "\n"); !written) return fail(written.error());
  return success;
}

}  // namespace

Command add_attack(Options& app) {
  auto options = std::make_shared<AttackOptions>();
  app.reads("--model", options->model, InputKind::model, "model.safetensors of a run, or a compressed .cmk")
      ->required();
  app.writes("--out", options->out, OutputKind::model, "model.safetensors to write")->required();
  app.word("--int8", options->int8,
           "round every number to 8 bits; there is one scale for each tensor, or for each "
           "channel (a column of anchors, a row of weights)")
      ->required()
      ->check(CLI::IsMember({"tensor", "channel"}));
  app.flag("--symmetric", options->symmetric,
           "put the scale symmetrically around zero, not from the least to the greatest value");
  app.flag("--keep-positions", options->keep_positions, "do not round positions of anchors");
  app.flag("--keep-networks", options->keep_networks, "do not round weights of networks");
  app.writes("--json", options->json, OutputKind::words, "write the errors to this file");
  return [options]() -> int { return attack(*options); };
}

}  // namespace tool
