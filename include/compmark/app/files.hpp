// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Files by what they are for: digests that name them, and the images that a user names by file or folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "compmark/app/compiled.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

struct ImageInfo;

/// SHA-256 of a file, 64 hexadecimal digits. Cost: the file in memory.
[[nodiscard]] Result<std::string> file_sha256(const std::filesystem::path& path);
/// SHA-256 of an image's pixels in 8 bits, row by row.
[[nodiscard]] std::string pixels_sha256(ImageView<const float> image);

/// Whether the memory that an image will take is there, asked before it is decoded: a small file may hold a very large
/// one.
[[nodiscard]] Result<Done> check_image_memory(const ImageInfo& info, const std::filesystem::path& path,
                                              std::uint64_t bytes_a_pixel, std::size_t budget_mb);
/// Files in the order they are read: a folder is its PNG and JPEG files by name. Error: a name that is not there, a
/// folder without any.
[[nodiscard]] Result<std::vector<std::filesystem::path>> image_files(const std::vector<std::filesystem::path>& paths);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/files.hpp"
#endif
