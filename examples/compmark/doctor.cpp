// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark doctor: what this program has to work with on this machine, and what it lacks. Nothing is written.
#include <cmath>
#include <compmark/app/files.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/splat/sog_image.hpp>
#include <compmark/io/splat/spz.hpp>
#include <compmark/version.hpp>
#include <compmark/watermark/proof/shipped_decoders.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "commands.hpp"
#include "common.hpp"
#include "decoder_choice.hpp"
#include "machine_memory.hpp"

namespace tool {
namespace {

using namespace compmark;

/// What was looked at, in a few words, and what would help where something is missing.
struct Finding {
  std::string name, value;
  std::string advice = {};  ///< empty: all is well
};

/// The widest registers that this program was compiled for.
const char* instruction_set() {
#if defined(__AVX512F__)
  return "AVX-512";
#elif defined(__AVX2__)
  return "AVX2";
#elif defined(__AVX__)
  return "AVX";
#elif defined(__ARM_NEON)
  return "NEON";
#else
  return "baseline";
#endif
}

Finding processors() {
  // Affinity and quota are looked at by the executor itself: the number is what --threads 0 means.
  const ThreadExecutor executor(0);
  return {"threads", std::to_string(executor.concurrency()) + " of " +
                         std::to_string(std::thread::hardware_concurrency()) + " processors"};
}

Finding memory() {
  const double free = free_memory_bytes();
  if (!(free > 0)) return {"free memory", "not known"};
  char text[32];
  std::snprintf(text, sizeof text, "%.1f GB", free / 1e9);
  return {"free memory", text,
          free < 2e9 ? "a training of 800 x 800 takes 1 to 2 GB: use --downscale 2, or --max-anchors" : ""};
}

Finding decoder() {
  const Result<std::filesystem::path> file = shipped_decoder();
  if (!file) return {"decoder of every scene", "not found", file.error().line()};
  const Result<std::string> digest = file_sha256(*file);
  if (!digest) return {"decoder of every scene", file->string(), digest.error().line()};
  if (!shipped_decoder_of(*digest)) {
    return {"decoder of every scene", file->string(),
            "its SHA-256 is none of those that this program knows: what it reads is no proof; install it again"};
  }
  return {"decoder of every scene", file->string()};
}

Finding library(const char* name, bool there, const char* use, const char* package) {
  return {name, there ? "yes" : "no",
          there ? std::string() : std::string(use) + ": install " + package + " and build again"};
}

Finding scratch() {
  std::error_code status;
  const std::filesystem::space_info space = std::filesystem::space(".", status);
  if (status) return {"free space here", "not known"};
  char text[32];
  std::snprintf(text, sizeof text, "%.1f GB", static_cast<double>(space.available) / 1e9);
  return {"free space here", text,
          space.available < std::uintmax_t{1'000'000'000} ? "a run of 100,000 anchors writes 100 MB: free some" : ""};
}

int doctor(bool json) {
  std::vector<Finding> findings{{"version", version}};
  findings.push_back({"instruction set", instruction_set(),
                      std::string(instruction_set()) == "baseline"
                          ? "kernels are two to eight times faster with -march=native: use the preset release"
                          : ""});
#if !defined(NDEBUG)
  findings.push_back({"build", "with assertions", "use the preset release, which is several times faster"});
#else
  findings.push_back({"build", "release"});
#endif
  findings.push_back(processors());
  findings.push_back(memory());
  findings.push_back(scratch());
  findings.push_back(decoder());
  findings.push_back(library("SPZ 4 (libzstd)", reads_zstd, "SPZ of version 4 is not read", "libzstd-dev"));
  findings.push_back(
      library("SOG with WebP (libwebp)", has_webp, "SOG files of other programs are not read", "libwebp-dev"));
  std::size_t wrong = 0;
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Finding& finding : findings) {
    if (!finding.advice.empty()) ++wrong;
    if (json) {
      list.push_back({{"name", finding.name}, {"value", finding.value}, {"advice", finding.advice}});
      continue;
    }
    std::printf("%-26s %s\n", finding.name.c_str(), finding.value.c_str());
    if (!finding.advice.empty()) std::printf("%-26s -> %s\n", "", finding.advice.c_str());
  }
  if (json) {
    std::printf("%s\n", nlohmann::ordered_json{{"schema", "compmark.doctor.1"}, {"findings", list}}.dump(2).c_str());
  } else {
    std::printf("%s\n", wrong == 0 ? "nothing is missing" : (std::to_string(wrong) + " could be better").c_str());
  }
  return success;
}

}  // namespace

Command add_doctor(Options& app) {
  auto json = std::make_shared<bool>(false);
  app.flag("--json", *json, "print one JSON object instead of text");
  return [json]() -> int { return doctor(*json); };
}

}  // namespace tool
