// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Reading messages: a decoder file with what the key adds to it, and the logits of images or of a model's renders. What
// they prove is another question (verify.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compiled.hpp"
#include "compmark/app/observer.hpp"
#include "compmark/app/picture.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/watermark/decoder/cover_interference.hpp"
#include "compmark/watermark/decoder/decoder_winograd.hpp"
#include "compmark/watermark/decoder/stored_decoder.hpp"
#include "compmark/watermark/proof/report.hpp"

namespace compmark {

/// Any decoder file, with the fast convolution.
using FileDecoder = StoredDecoder<float, WinogradOrDirect>;

/// Reads a key file and checks its payload, or its number of recipients.
[[nodiscard]] Result<OwnerKey> open_key(const std::filesystem::path& path);
/// The key, read from `path`, with the recipient whose copy is meant (OwnerKey::recipient); 0: none is named. Error: a
/// key with recipients and none of them is named, or another than it has.
[[nodiscard]] Result<OwnerKey> for_recipient(OwnerKey key, const std::filesystem::path& path, std::size_t recipient);
/// Reads a decoder file. With a key: the decoder of the key's message length, or an error; a carrier file needs the
/// key. `sha256`, if any, is set to that of the bytes that were read.
[[nodiscard]] Result<FileDecoder> open_decoder(const std::filesystem::path& path, const OwnerKey* key,
                                               std::string* sha256 = nullptr);

/// Reads a file of measure_interference (interference.hpp), as that of the logits of the decoder `decoder`; of a
/// carrier file, with the key. `sha256`, if any, is set to that of the bytes that were read. Error: it was measured for
/// another decoder.
[[nodiscard]] Result<CoverInterference> open_interference(const std::filesystem::path& path,
                                                          const std::filesystem::path& decoder, const OwnerKey* key,
                                                          std::string* sha256 = nullptr);

/// What a decoder reads from a render of `view`, rounded to 8 bits as others have it; with the SHA-256 of those pixels.
/// `interference`, if any, is subtracted.
[[nodiscard]] Result<ViewLogits> read_render(AnyModel& model, const StoredView& view, const FileDecoder& decoder,
                                             FileDecoder::Context& context, ThreadExecutor& executor,
                                             const CoverInterference* interference = nullptr);

/// Which of the cameras that a model stores.
enum class ViewChoice { test, train, all };

/// What is to be read: a model's renders, or images, and how (PictureSettings). Errors name these fields as the tool's options do ("--unmarked").
struct ReadingSettings : PictureSettings {
  std::filesystem::path decoder;
  std::filesystem::path model;                ///< or images
  std::filesystem::path unmarked;             ///< of the model: what it says by itself is subtracted; may be empty
  std::optional<std::array<double, 3>> up;    ///< of an unmarked splat file (RegisterSettings::up)
  std::filesystem::path interference;         ///< of the unmarked scene (interference.hpp): subtracted; may be empty
  std::vector<std::filesystem::path> images;  ///< files and folders
  std::vector<GivenPicture> pictures;         ///< in memory, read after the files, all of them
  ViewChoice split = ViewChoice::test;        ///< a model without test views gives those of its training
  std::size_t views = 0;                      ///< at most so many, evenly spaced; 0: all
  bool restored = false;                      ///< read a model's features in `unmarked` (restored_features.hpp)
  double missing_share = 0;                   ///< of a model's anchors, to make up for (AnyModel::make_up_for)
};

struct Reading {
  std::vector<ViewLogits> views;  ///< with SHA-256 of the file, or of the 8-bit pixels of a render
  ReportSources sources;
  std::size_t bits = 0;
  std::optional<RestoredFeatures> restored = {};  ///< of ReadingSettings::restored
};

/// Everything that the settings name, read by their decoder. `key`, if any, is of the decoder's message length. The
/// observer counts views. Cost: a render, if of a model, and a forward pass of the decoder a view; memory of one image.
[[nodiscard]] Result<Reading> read_messages(const ReadingSettings& settings, const std::optional<OwnerKey>& key,
                                            ThreadExecutor& executor, const WorkObserver& observer = {});

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/reading.hpp"
#endif
