// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "reading.hpp"

#include <array>
#include <compmark/app/run/owner_keys.hpp>
#include <compmark/app/run/payload_json.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <cstdio>

#include "color_option.hpp"
#include "common.hpp"
#include "decoder_choice.hpp"

namespace tool {

using namespace compmark;
namespace fs = std::filesystem;

PayloadText payload_text(const OwnerKey& key, const Message& read) {
  const PayloadCode::Reading reading = read_payload(key, read);
  const bool whole = reading.outcome == PayloadCode::Outcome::read;
  PayloadText text;
  text.json = payload_json(key, read);
  const double chance = text.json["chance"].get<double>();
  std::array<char, 160> line{};
  if (whole) {
    std::snprintf(line.data(), line.size(),
                  "payload     %s, %zu bit%s corrected, CRC right; bits of chance pass with probability %.1g\n",
                  reading.data.hex().c_str(), reading.corrected, reading.corrected == 1 ? "" : "s", chance);
  } else {
    std::snprintf(line.data(), line.size(), "payload     cannot be read (%s)\n",
                  reading.outcome == PayloadCode::Outcome::crc_failed ? "the CRC is wrong" : "too many wrong bits");
  }
  text.line = line.data();
  return text;
}

Result<OwnerKey> load_key(const fs::path& path) { return open_private_key(path, print_warning); }

void add_reading_options(Options& app, ReadingOptions& options) {
  app.reads("--decoder", options.decoder, InputKind::decoder, reading_decoder_text);
  CLI::Option* model = app.reads("--model", options.model, InputKind::model,
                                 "model.safetensors of a run or a .cmk; its renders are read");
  CLI::Option* images =
      app.reads("--images", options.images, InputKind::images, "image files, or folders of them (PNG, JPEG)");
  app.reads("--unmarked", options.unmarked, InputKind::model,
            "the unmarked model; its reading at the same cameras is subtracted (informed reading)");
  app.reads(
      "--interference", options.interference, InputKind::interference,
      "what the unmarked scene says to the decoder by itself (a file of compmark interference); it is subtracted");
  images->excludes(model);
  model->excludes(images);
  app.word("--split", options.split_word, "cameras of the model: test, train or all")
      ->capture_default_str()
      ->check(CLI::IsMember({"test", "train", "all"}));
  app.number("--views", options.views, any_count, "largest number of views that are read, evenly spaced; 0: all")
      ->capture_default_str();
  background_option(app, options.behind);
  app.flag("--whole-images", options.whole_images,
           "read image files whole, also pages of which the picture would be read alone; trying both is two tests");
  app.number("--memory-budget", options.memory_budget_mb, WholeRange{1, 1 << 24},
             "MiB of memory for reading one image; larger ones are refused before they are decoded")
      ->capture_default_str();
  app.number("--threads", options.threads, thread_range, "0: all")->capture_default_str();
}

ReadingSettings reading_settings(const ReadingOptions& options) {
  ReadingSettings settings = options;
  settings.split = options.split_word == "all"     ? ViewChoice::all
                   : options.split_word == "train" ? ViewChoice::train
                                                   : ViewChoice::test;
  settings.pages = !options.whole_images;
  settings.background = color_of(options.behind).value_or(settings.background);
  return settings;
}

Result<Reading> read_all(const ReadingOptions& options, const std::optional<OwnerKey>& key) {
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  return read_messages(reading_settings(options), key, executor);
}

}  // namespace tool
