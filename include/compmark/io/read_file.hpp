// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Reading whole files. Only regular files are read, a size is checked before memory is taken for it, a reader may look
// at the first bytes before it asks for the rest, and a file that changes its size while it is read is an error.
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#if defined(__unix__) || defined(__APPLE__)
#include <fcntl.h>
#endif

#include "compmark/core/result.hpp"

namespace compmark {

/// A regular file that is read from its begin to its end.
class InputFile {
 public:
  /// Opens a file of at most `limit` bytes.
  [[nodiscard]] static Result<InputFile> open(const std::filesystem::path& path,
                                              std::uintmax_t limit = std::uintmax_t{1} << 40) {
    InputFile file(path);
    std::error_code status;
    const std::filesystem::file_status found = std::filesystem::status(path, status);
    if (found.type() == std::filesystem::file_type::not_found)
      return file.error(ErrorKind::not_found, "no such file", "check the path");
    if (found.type() == std::filesystem::file_type::none)
      return file.error(ErrorKind::unreadable, "cannot be looked at: " + status.message(), "check its permissions");
    if (found.type() == std::filesystem::file_type::directory)
      return file.error(ErrorKind::unreadable, "is a folder, not a regular file", "give the name of a file");
    if (found.type() != std::filesystem::file_type::regular)
      return file.error(ErrorKind::unreadable, "is a pipe or a device, not a regular file",
                        "write its content to a file first");
    file.size_ = std::filesystem::file_size(path, status);
    if (status)
      return file.error(ErrorKind::unreadable, "its size cannot be read: " + status.message(), "check its permissions");
    if (file.size_ > limit) {
      return file.error(ErrorKind::exhausted,
                        "has " + std::to_string(file.size_) + " bytes, more than the limit of " + std::to_string(limit),
                        "check that this is the right file");
    }
#if defined(__unix__) || defined(__APPLE__)
    // Without waiting: should a pipe have taken the file's place since, opening it must not hang.
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    file.stream_.reset(descriptor < 0 ? nullptr : ::fdopen(descriptor, "rb"));
#else
    file.stream_.reset(std::fopen(path.string().c_str(), "rb"));
#endif
    if (!file.stream_)
      return file.error(ErrorKind::unreadable, std::string("cannot be opened: ") + std::strerror(errno),
                        "check its permissions");
    std::setvbuf(file.stream_.get(), nullptr, _IONBF, 0);  // pieces are large, and a key leaves no copy in a buffer
    return file;
  }

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::uintmax_t size() const { return size_; }
  [[nodiscard]] std::uintmax_t left() const { return size_ - read_; }

  /// Appends the next `count` bytes (at most those that are left) to `bytes`.
  [[nodiscard]] Result<Done> append(std::vector<std::byte>& bytes, std::uintmax_t count) {
    const std::size_t begin = bytes.size();
    const std::size_t end = begin + static_cast<std::size_t>(std::min(count, left()));
    try {
      bytes.reserve(end);
    } catch (const std::bad_alloc&) {
      return no_memory();
    } catch (const std::length_error&) {
      return no_memory();
    }
    // In pieces that stay in the cache between the zeros of resize and the file's bytes: a pass over the memory less.
    constexpr std::size_t piece = std::size_t{1} << 18;
    while (bytes.size() != end) {
      const std::size_t at = bytes.size(), wanted = std::min(piece, end - at);
      bytes.resize(at + wanted);
      errno = 0;
      if (std::fread(bytes.data() + at, 1, wanted, stream_.get()) == wanted) continue;
      if (std::ferror(stream_.get()) != 0)
        return error(ErrorKind::unreadable, std::string("cannot be read: ") + std::strerror(errno), "copy it again");
      return error(ErrorKind::truncated, "ended before its " + std::to_string(size_) + " bytes", "copy it again");
    }
    read_ += end - begin;
    return Done{};
  }
  /// Appends all that is left; an error if the file has grown meanwhile.
  [[nodiscard]] Result<Done> append_rest(std::vector<std::byte>& bytes) {
    if (Result<Done> rest = append(bytes, left()); !rest) return rest;
    std::byte more{};
    if (std::fread(&more, 1, 1, stream_.get()) != 0)
      return error(ErrorKind::unreadable, "grew while it was read", "wait until the program that writes it has ended");
    return Done{};
  }

 private:
  struct Close {
    void operator()(std::FILE* stream) const { std::fclose(stream); }
  };
  explicit InputFile(std::filesystem::path path) : path_(std::move(path)) {}
  [[nodiscard]] Error error(ErrorKind kind, std::string problem, std::string remedy) const {
    return {kind, path_.string(), "", std::move(problem), std::move(remedy)};
  }
  [[nodiscard]] Error no_memory() const {
    return error(ErrorKind::exhausted, "has " + std::to_string(size_) + " bytes, more than there is memory",
                 "check that this is the right file");
  }

  std::filesystem::path path_;
  std::unique_ptr<std::FILE, Close> stream_;
  std::uintmax_t size_ = 0;
  std::uintmax_t read_ = 0;
};

/// Reads one whole file of at most `limit` bytes. `check(head, size)` sees its first bytes (up to `head_size` of the
/// `size` bytes) and may refuse it by an Error before memory is taken for the rest.
template <class Check>
[[nodiscard]] Result<std::vector<std::byte>> read_file(const std::filesystem::path& path, std::uintmax_t limit,
                                                       std::size_t head_size, const Check& check) {
  Result<InputFile> file = InputFile::open(path, limit);
  if (!file) return file.error();
  std::vector<std::byte> bytes;
  if (const Result<Done> head = file->append(bytes, head_size); !head) return head.error();
  if (const Result<Done> fits = check(std::span<const std::byte>(bytes), file->size()); !fits) return fits.error();
  if (const Result<Done> rest = file->append_rest(bytes); !rest) return rest.error();
  return bytes;
}
[[nodiscard]] inline Result<std::vector<std::byte>> read_file(const std::filesystem::path& path,
                                                              std::uintmax_t limit = std::uintmax_t{1} << 40) {
  return read_file(path, limit, 0, [](std::span<const std::byte>, std::uintmax_t) { return Result<Done>(Done{}); });
}

}  // namespace compmark
