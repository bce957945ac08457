// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/files.hpp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/app/detail/keep_evenly.hpp"
#include "compmark/app/files.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/io/read_file.hpp"
#include "compmark/io/sha256.hpp"
#include "compmark/scene/image_folder.hpp"

namespace compmark {
namespace detail {

/// An error that names a file: this one, if it named none.
inline Error named(Error error, const std::filesystem::path& file) {
  if (error.file.empty()) error.file = file.string();
  return error;
}

}  // namespace detail

COMPMARK_APP_INLINE Result<std::string> file_sha256(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes = read_file(path);
  if (!bytes) return bytes.error();
  return Sha256{}.update(*bytes).hex();
}

COMPMARK_APP_INLINE Result<Done> check_image_memory(const ImageInfo& info, const std::filesystem::path& path,
                                                    std::uint64_t bytes_a_pixel, std::size_t budget_mb) {
  const std::uint64_t pixels = static_cast<std::uint64_t>(info.width) * static_cast<std::uint64_t>(info.height);
  const std::uint64_t wanted = (pixels * bytes_a_pixel >> 20) + 1;
  if (wanted <= budget_mb) return Done{};
  return Error{ErrorKind::exhausted, path.string(), "--memory-budget",
               "the image has " + std::to_string(info.width) + " x " + std::to_string(info.height) +
                   " pixels and takes about " + std::to_string(wanted) + " MiB to read, more than " +
                   std::to_string(budget_mb),
               "scale it down, or give --memory-budget " + std::to_string(wanted)};
}

COMPMARK_APP_INLINE std::string pixels_sha256(ImageView<const float> image) {
  const ImageBytes bytes = to_bytes(image);
  return Sha256{}.update(std::as_bytes(std::span<const std::uint8_t>(bytes.pixels))).hex();
}

COMPMARK_APP_INLINE Result<std::vector<std::filesystem::path>> image_files(
    const std::vector<std::filesystem::path>& paths) {
  std::vector<std::filesystem::path> files;
  for (const std::filesystem::path& path : paths) {
    std::error_code status;
    if (!std::filesystem::is_directory(path, status)) {
      if (!std::filesystem::exists(path, status))
        return Error{ErrorKind::not_found, path.string(), "--images", "no such file or folder", "check the path"};
      files.push_back(path);
      continue;
    }
    std::vector<std::filesystem::path> found;
    for (std::filesystem::directory_iterator i(path, status), end; !status && i != end; i.increment(status)) {
      if (detail::is_image_name(i->path().filename().string())) found.push_back(i->path());
    }
    if (status) {
      return Error{ErrorKind::unreadable, path.string(), "--images", "cannot be listed: " + status.message(),
                   "check its permissions"};
    }
    if (found.empty()) {
      return Error{ErrorKind::not_found, path.string(), "--images", "holds no PNG or JPEG file",
                   "give a folder of images, or the files themselves"};
    }
    std::sort(found.begin(), found.end());
    files.insert(files.end(), found.begin(), found.end());
  }
  return files;
}

}  // namespace compmark
