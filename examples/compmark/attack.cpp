// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark attack: applies attacks to a model, or to images, and writes the result, for evaluate, extract and verify to
// read. Which attacks there are is said by the lists of watermark/attack, one of them alone by an option of its own.
#include <compmark/app/files.hpp>
#include <compmark/app/model_attack.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/scene/image.hpp>
#include <compmark/scene/turn.hpp>
#include <compmark/splat/quantizer/int8_quantizer.hpp>
#include <compmark/watermark/attack/model_attacks.hpp>
#include <compmark/watermark/attack/picture_attacks.hpp>
#include <compmark/watermark/attack/quantize_model.hpp>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "common.hpp"
#include "model_files.hpp"
#include "reading.hpp"
#include "run_folder.hpp"
#include "view_files.hpp"

namespace tool {
namespace {

using namespace compmark;

struct AttackOptions {
  std::filesystem::path model;
  std::filesystem::path out;
  std::filesystem::path json;
  std::filesystem::path into;
  std::vector<std::filesystem::path> images, average;
  std::filesystem::path insert_into;
  std::vector<std::string> attacks;
  std::uint64_t seed = 0;
  std::string int8;
  bool symmetric = false;
  bool keep_positions = false;
  bool keep_networks = false;
};

/// Every image with the attacks in turn, under its own name in the folder.
int attack_images(const AttackOptions& options) {
  const Result<std::vector<std::filesystem::path>> files = image_files(options.images);
  if (!files) return fail(files.error());
  std::vector<std::string> called;
  for (const std::filesystem::path& file : *files) called.push_back(file.filename().string());
  const std::vector<std::string> names = view_files(called);
  FileUse use;
  for (const std::filesystem::path& file : *files) use.read(file, "--images", InputKind::images);
  for (const std::string& name : names) use.write(options.into / name, "--into");
  if (Result<Done> safe = check_file_use(use); !safe) return fail(safe.error());
  const Result<std::shared_ptr<const void>> held = hold_folder(options.into);
  if (!held) return fail(held.error());
  for (std::size_t i = 0; i < files->size(); ++i) {
    const std::string file = (*files)[i].string();
    const Result<std::vector<std::byte>> bytes = read_image_bytes((*files)[i]);
    if (!bytes) return fail(bytes.error());
    const Result<ImageInfo> info = decode_image_info(*bytes, file);
    if (!info) return fail(info.error());
    Result<ImageBytes> image = decode_image(*bytes, file);
    if (!image) return fail(image.error());
    *image = turned(std::move(*image), info->orientation);
    std::vector<std::uint8_t> planes(3 * static_cast<std::size_t>(image->width) *
                                     static_cast<std::size_t>(image->height));
    composite(image->pixels, image->channels, {}, AlphaRounding::nearest, planes);
    AttackedPicture picture{image->height, image->width, std::vector<float>(planes.size())};
    for (std::size_t k = 0; k < planes.size(); ++k) picture.planes[k] = static_cast<float>(planes[k]) / 255.0f;
    for (const std::string& text : options.attacks) {
      Result<AttackedPicture> attacked = attack_picture<PictureAttacks>(text, picture.view(), options.seed + i);
      if (!attacked) return fail(attacked.error());
      picture = std::move(*attacked);
    }
    if (Result<Done> written = write_png(options.into / names[i], picture.view()); !written)
      return fail(written.error());
  }
  std::printf("%zu images in %s\n", files->size(), options.into.string().c_str());
  return success;
}

/// A model, averaged with copies, with the attacks in turn, put into a scene.
int attack_numbers(const AttackOptions& options) {
  Result<AnyModel> model = load_model(options.model);
  if (!model) return fail(model.error());
  ThreadExecutor executor;
  if (!options.average.empty()) {
    if (Result<Done> averaged = average_models(*model, options.average, executor); !averaged)
      return fail(averaged.error());
  }
  for (const std::string& text : options.attacks) {
    if (Result<Done> attacked = attack_any_model(*model, text, options.seed, executor); !attacked)
      return fail(attacked.error());
  }
  if (!options.insert_into.empty()) {
    Result<AnyModel> scene = load_model(options.insert_into);
    if (!scene) return fail(scene.error());
    if (Result<Done> inserted = insert_model(*scene, *model); !inserted) return fail(inserted.error());
    model = std::move(scene);
  }
  if (Result<Done> written = model->write(options.out); !written) return fail(written.error());
  std::printf("%s: %zu anchors\n", options.out.string().c_str(), model->anchor_count());
  return success;
}

int attack_int8(const AttackOptions& options) {
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

/// What the options say together.
int attack(const AttackOptions& options) {
  const auto wrong = [](const char* field, const char* problem, const char* remedy) {
    return fail({ErrorKind::invalid, {}, field, problem, remedy});
  };
  if (options.model.empty() == options.images.empty())
    return wrong("--model, --images", options.model.empty() ? "are both missing" : "are both given",
                 "give a model with --out, or images with --into");
  const bool pictures = options.model.empty();
  if (pictures ? !options.out.empty() : !options.into.empty())
    return wrong(pictures ? "--out" : "--into",
                 pictures ? "is for a model, and images are attacked" : "is for images, and a model is attacked",
                 pictures ? "name a folder for the images, with --into" : "name the model to write, with --out");
  if (pictures ? options.into.empty() : options.out.empty())
    return wrong(pictures ? "--into" : "--out", "is missing",
                 pictures ? "name a folder for the attacked images" : "name the model to write, as edited.safetensors");
  const bool others = !options.average.empty() || !options.insert_into.empty();
  if (pictures && others) return wrong("--average, --insert-into", "are of a model", "leave them out, or give --model");
  if (options.int8.empty() == (options.attacks.empty() && !others) || (pictures && options.attacks.empty()))
    return wrong("--attack, --int8", options.int8.empty() ? "are both missing" : "do not go together",
                 pictures ? "give --attack" : "give one of them");
  if (options.int8.empty() &&
      (options.symmetric || options.keep_positions || options.keep_networks || !options.json.empty()))
    return wrong("--symmetric, --keep-positions, --keep-networks, --json", "are of --int8 alone",
                 "leave them out, or give --int8");
  return pictures ? attack_images(options) : options.int8.empty() ? attack_numbers(options) : attack_int8(options);
}

}  // namespace

Command add_attack(Options& app) {
  auto options = std::make_shared<AttackOptions>();
  app.reads("--model", options->model, InputKind::model, "model.safetensors of a run, or a compressed .cmk");
  app.reads("--images", options->images, InputKind::images, "or image files, or folders of them (PNG, JPEG)");
  app.writes("--out", options->out, OutputKind::model, "model.safetensors to write");
  app.writes_into("--into", options->into, "folder for the attacked images (PNG)");
  app.words("--attack", options->attacks,
            "NAME or NAME:STRENGTH, several in turn; of a model " + ModelAttacks::names() + ", of images " +
                PictureAttacks::names());
  app.reads("--average", options->average, InputKind::model,
            "copies of the model with other marks, or without: every number becomes the mean of theirs");
  app.reads("--insert-into", options->insert_into, InputKind::model,
            "a scene of the same networks, which gets the anchors; after cutout, a part of it");
  app.number("--seed", options->seed, any_seed, "seed of attacks that draw random numbers")->capture_default_str();
  app.word("--int8", options->int8,
           "round every number to 8 bits; there is one scale for each tensor, or for each "
           "channel (a column of anchors, a row of weights)")
      ->check(CLI::IsMember({"tensor", "channel"}));
  app.flag("--symmetric", options->symmetric,
           "put the scale symmetrically around zero, not from the least to the greatest value");
  app.flag("--keep-positions", options->keep_positions, "do not round positions of anchors");
  app.flag("--keep-networks", options->keep_networks, "do not round weights of networks");
  app.writes("--json", options->json, OutputKind::words, "write the errors to this file");
  app.also([](FileUse&) {});  // the names come with the images: attack_images
  return [options]() -> int { return attack(*options); };
}

}  // namespace tool
