// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Reading messages: a decoder file with what the key adds to it, and the logits of images or of a model's renders.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/mark/decoder_winograd.hpp>
#include <compmark/mark/report.hpp>
#include <compmark/mark/stored_decoder.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "options.hpp"

namespace tool {

/// Any decoder file, with the fast convolution.
using Decoder = compmark::StoredDecoder<float, compmark::WinogradOrDirect>;

/// SHA-256 of a render's pixels in 8 bits, row by row.
std::string pixels_sha256(compmark::ImageView<const float> image);
/// Reads a key file and checks its payload; warns on stderr if others may read it.
compmark::Result<compmark::OwnerKey> load_key(const std::filesystem::path& path);

/// The payload of read bits, as a line and as JSON; for a key with a payload.
struct PayloadText {
  std::string line;
  nlohmann::ordered_json json;
};
PayloadText payload_text(const compmark::OwnerKey& key, const compmark::Message& read);

/// Reads a decoder file. With a key: the decoder of the key's message length, or an error; a carrier file needs the
/// key.
compmark::Result<Decoder> load_decoder(const std::filesystem::path& path, const compmark::OwnerKey* key);

/// The input of a reading: a model's renders or images.
struct ReadingOptions {
  std::filesystem::path decoder;
  std::filesystem::path model;
  std::filesystem::path unmarked;             ///< unmarked model, whose reading is subtracted; may be empty
  std::vector<std::filesystem::path> images;  ///< files and folders
  std::string split = "test";
  std::size_t views = 0;                ///< at most so many, evenly spaced; 0: all
  std::string background;               ///< behind transparent pixels of images: "white", "black" or empty
  std::size_t memory_budget_mb = 1400;  ///< of one image
  std::size_t threads = 0;
};
/// --decoder, --model, --unmarked, --images, --split, --views, --background, --memory-budget, --threads
void add_reading_options(Options& app, ReadingOptions& options);

/// Files in the order they are read: a folder is its PNG and JPEG files by name.
compmark::Result<std::vector<std::filesystem::path>> image_files(const std::vector<std::filesystem::path>& paths);

struct Reading {
  std::vector<compmark::ViewLogits> views;  ///< with SHA-256 of the file, or of the 8-bit pixels of a render
  compmark::ReportSources sources;
  std::size_t bits = 0;
};

/// Everything that `options` names, read by its decoder. Renders are rounded to 8 bits; a model without test views
/// gives its training views.
compmark::Result<Reading> read_all(const ReadingOptions& options, const std::optional<compmark::OwnerKey>& key);

}  // namespace tool
