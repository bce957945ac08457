// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark compress: writes the compressed file of a model that was trained for it. compmark decompress: makes a model
// from a compressed file again, even from a damaged one.
#include <compmark/app/compress.hpp>
#include <compmark/codec/integer/coarse_bins.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/json_file.hpp>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "coded_text.hpp"
#include "commands.hpp"
#include "common.hpp"

namespace tool {
namespace {

using namespace compmark;

struct CompressOptions {
  std::filesystem::path model, out, json;
  std::string codec = "trained", preview = "none", cameras = "test", networks = "half";
  std::size_t threads = 0;
};

/// 3, 9 or 27 for all attributes, or three numbers, of features, scales and offsets.
Result<CoarseSteps> preview_steps(const std::string& text) {
  const Error error{ErrorKind::invalid,
                    {},
                    "--preview",
                    "\"" + text + "\" is no width of coarse steps",
                    "give none, 3, 9 or 27, or three of 1, 3, 9 and 27: features,scales,offsets, such as 3,9,9"};
  std::vector<std::uint8_t> thirds;
  std::istringstream words(text);
  for (std::string word; std::getline(words, word, ',');) {
    std::uint8_t power = 0;
    while (power <= CoarseSteps::most_thirds && word != std::to_string(CoarseSteps::width_of(power))) ++power;
    if (power > CoarseSteps::most_thirds) return error;
    thirds.push_back(power);
  }
  if (thirds.size() == 1) thirds.resize(3, thirds[0]);
  if (thirds.size() != 3) return error;
  const CoarseSteps steps{{thirds[0], thirds[1], thirds[2]}};
  return steps.valid() ? Result<CoarseSteps>(steps) : Result<CoarseSteps>(error);
}

int compress(const CompressOptions& options) {
  CodedModelSettings settings;
  settings.networks = options.networks == "single" ? TensorStorage::single : TensorStorage::half;
  settings.cameras = options.cameras == "none"  ? StoredCameras::none
                     : options.cameras == "all" ? StoredCameras::all
                                                : StoredCameras::test;
  settings.intra = options.codec == "hac_plus";
  if (options.preview != "none") {
    if (!settings.intra)
      return fail({ErrorKind::invalid, {}, "--preview", "is for hac_plus files only", "give --codec hac_plus too"});
    const Result<CoarseSteps> steps = preview_steps(options.preview);
    if (!steps) return fail(steps.error());
    settings.first_level = *steps;
  }
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  const Result<CodecReport> report = compress_file(options.model, options.out, settings, executor);
  if (!report) return fail(report.error());
  std::printf("%s: %s", options.out.string().c_str(), coded_text(*report).c_str());
  if (options.json.empty()) return success;
  const Result<Done> written = write_json(options.json, coded_json(*report));
  return written ? success : fail(written.error());
}

struct DecompressOptions {
  std::filesystem::path model, out;
  bool salvage = false, partial = false;
  std::size_t threads = 0;
};

int decompress(const DecompressOptions& options) {
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  CodecDecodeSettings settings;
  settings.salvage = options.salvage;
  settings.partial = options.partial;
  const Result<Decompressed> made = decompress_file(options.model, options.out, settings, executor);
  if (!made) return fail(made.error());
  const CodecDecoded& decoded = made->decoded;
  std::printf("%s: %zu anchors%s\n", options.out.string().c_str(), made->anchors, decoded.verified ? ", verified" : "");
  if (decoded.absent_bytes > 0) {
    std::fprintf(
        stderr,
        "compmark: note: %u of %u levels are complete in this file; %llu bytes and %llu anchors are still missing\n",
        static_cast<unsigned>(decoded.levels), static_cast<unsigned>(decoded.file_levels),
        static_cast<unsigned long long>(decoded.absent_bytes), static_cast<unsigned long long>(decoded.absent_anchors));
  }
  if (decoded.coarse_anchors > 0) {
    std::fprintf(stderr, "compmark: note: %llu anchors are of the coarse level\n",
                 static_cast<unsigned long long>(decoded.coarse_anchors));
  }
  for (const std::string& section : decoded.lost_sections)
    std::fprintf(stderr, "compmark: warning: section %s is lost\n", section.c_str());
  if (decoded.damaged.empty()) return decoded.lost_sections.empty() ? success : salvaged;
  for (const auto& [chunk, error] : decoded.damaged) {
    std::fprintf(stderr, "compmark: warning: chunk %u is lost: %s\n", static_cast<unsigned>(chunk),
                 error.line().c_str());
  }
  std::fprintf(stderr, "compmark: warning: %llu anchors are missing\n",
               static_cast<unsigned long long>(decoded.lost_anchors));
  return salvaged;
}

}  // namespace

Command add_compress(Options& app) {
  auto options = std::make_shared<CompressOptions>();
  app.reads("--model", options->model, InputKind::trained_model,
            "model.safetensors of a run with --codec, or of fit-codec")
      ->required();
  app.writes("--out", options->out, OutputKind::compressed, "compressed file (.cmk)")->required();
  app.word("--codec", options->codec,
           "trained: the codec that the model was trained for; hac_plus: a model that was trained for hac in fewer "
           "bytes, the decoded model is the same")
      ->capture_default_str()
      ->check(CLI::IsMember({"trained", "hac_plus"}));
  app.word("--preview", options->preview,
           "with hac_plus: the file begins with a coarse model of the whole scene, of steps so many times as wide "
           "(decompress --partial); the decoded model is the same. none, 3, 9 or 27, or of features,scales,offsets: "
           "3,9,9")
      ->capture_default_str();
  app.word("--cameras", options->cameras, "cameras of the model that the file stores, 144 bytes each")
      ->capture_default_str()
      ->check(CLI::IsMember({"none", "test", "all"}));
  app.word("--networks", options->networks, "precision of the rendering networks: half or single")
      ->capture_default_str()
      ->check(CLI::IsMember({"half", "single"}));
  app.number("--threads", options->threads, thread_range, "0: all; the file is the same for any number")
      ->capture_default_str();
  app.writes("--json", options->json, OutputKind::words, "write the sizes to this file");
  return [options]() -> int { return compress(*options); };
}

Command add_decompress(Options& app) {
  auto options = std::make_shared<DecompressOptions>();
  app.reads("--model", options->model, InputKind::compressed, "compressed file (.cmk)")->required();
  app.writes("--out", options->out, OutputKind::model, "model.safetensors to write")->required();
  app.flag("--salvage", options->salvage,
           "decode undamaged parts and leave out the rest (exit code 4 if anything is left out)");
  app.flag("--partial", options->partial,
           "decode a file that ends too early: the complete levels of a ContextGS file, and of a hac_plus file with "
           "--preview, are a preview of it (compmark info of the whole file lists the bytes each level needs)");
  app.number("--threads", options->threads, thread_range, "0: all")->capture_default_str();
  return [options]() -> int { return decompress(*options); };
}

}  // namespace tool
