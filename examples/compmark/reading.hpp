// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Reading messages, as the options of several commands say what is read; what read bits say, in words.
#pragma once

#include <compmark/app/reading.hpp>
#include <compmark/core/result.hpp>
#include <compmark/io/owner_key.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>

#include "common.hpp"
#include "decoder_choice.hpp"
#include "options.hpp"

namespace tool {

using Decoder = compmark::FileDecoder;

/// Reads a key file and checks its payload; warns on stderr if others may read it.
compmark::Result<compmark::OwnerKey> load_key(const std::filesystem::path& path);

/// The payload of read bits, as a line and as JSON; for a key with a payload.
struct PayloadText {
  std::string line;
  nlohmann::ordered_json json;
};
PayloadText payload_text(const compmark::OwnerKey& key, const compmark::Message& read);

/// The input of a reading, from options.
struct ReadingOptions : compmark::ReadingSettings {
  std::string split_word = "test";
  std::string behind = "black";  ///< transparent pixels of images: a colour of color_of
  bool whole_images = false;
  std::size_t threads = 0;
};
/// --decoder, --model, --unmarked, --interference, --images, --split, --views, --background, --whole-images, --memory-budget, --threads
void add_reading_options(Options& app, ReadingOptions& options);

/// Runs a command that reads, once its decoder is chosen. Returns its exit code.
template <class Command>
int with_decoder(Command& options, int (*run)(const std::type_identity_t<Command>&)) {
  if (const auto chosen = choose_decoder(options.reading.decoder, options.reading.model); !chosen)
    return fail(chosen.error());
  return run(options);
}

[[nodiscard]] compmark::ReadingSettings reading_settings(const ReadingOptions& options);
/// compmark::read_messages on the threads that are asked for.
compmark::Result<compmark::Reading> read_all(const ReadingOptions& options,
                                             const std::optional<compmark::OwnerKey>& key);

}  // namespace tool
