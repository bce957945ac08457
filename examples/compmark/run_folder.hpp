// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Locks what a command writes, so that no other process writes it at the same time.
#pragma once

#include <compmark/app/run/run_folder.hpp>
#include <compmark/core/result.hpp>
#include <memory>
#include <vector>

#include "file_use.hpp"

namespace tool {

/// Checks what a command reads and writes (file_use.hpp, input_files.hpp), and holds the models, compressed files and
/// splats among its outputs (hold_file), as long as what is returned lives.
compmark::Result<std::vector<std::shared_ptr<const void>>> take_files(const FileUse& use);

/// The files beside a key and in a run's folder that say which decoder reads a mark (compmark/app/run/mark_record.hpp).
void add_record_read(FileUse& use, const std::filesystem::path& key, const std::filesystem::path& model = {});
void add_record_written(FileUse& use, const std::filesystem::path& key);

}  // namespace tool
