// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The files that a command reads and writes. Before any work is done, every pair is checked by file identity, through
// links of either kind: no output may be an input or another output. A key that a log has overwritten cannot be made
// again.
#pragma once

#include <compmark/core/result.hpp>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace tool {

/// Kinds of inputs.
enum class InputKind {
  model,          ///< model.safetensors or .cmk
  trained_model,  ///< model.safetensors alone
  markable,       ///< the same, or splats
  compressed,     ///< .cmk alone
  decoder,        ///< of messages
  interference,   ///< of an unmarked scene
  key,            ///< an owner's
  claim,          ///< an owner's
  time_stamp,     ///< of a claim
  images,         ///< files, or folders of them
  dataset,        ///< a capture: its folder, or its transforms file
  splats,         ///< of any program
  weights,        ///< of LPIPS
  other,          ///< what no option names
};

/// Kinds of outputs, and so of the existing files that they may replace.
enum class OutputKind {
  words,         ///< JSON, CSV, HTML, a log: text without a kind of its own
  splats,        ///< PLY
  model,         ///< model.safetensors
  compressed,    ///< .cmk
  decoder,       ///< of messages
  interference,  ///< of an unmarked scene
  key,           ///< an owner's: never replaced
  any,           ///< a file of a run's own folder
};

struct UsedFile {
  std::filesystem::path path;
  std::string said;  ///< the option that names it, or a description, for the error
  InputKind kind = InputKind::other;
  OutputKind written = OutputKind::any;
};

struct FileUse {
  std::vector<UsedFile> reads;   ///< files, and folders of images or captures
  std::vector<UsedFile> writes;  ///< files; the option of a folder stands for what is written into it

  void read(std::filesystem::path path, std::string said, InputKind kind = InputKind::other) {
    if (!path.empty()) reads.push_back({std::move(path), std::move(said), kind});
  }
  void write(std::filesystem::path path, std::string said, OutputKind written = OutputKind::any) {
    if (!path.empty()) writes.push_back({std::move(path), std::move(said), {}, written});
  }
  /// Files of these names in a folder.
  void write_in(const std::filesystem::path& folder, std::initializer_list<const char*> names,
                const std::string& said) {
    for (const char* name : names) write(folder / name, said);
  }
};

/// An error if an output is an input, another output, or a file of a folder that is read. Cost: a look at every file
/// that is named; where an output is there already, at every name in the folders that are read.
compmark::Result<compmark::Done> check_file_use(const FileUse& use);

}  // namespace tool
