// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Files are replaced whole or not at all: bytes go to `<path>.partial` next to the target, are flushed to the disk, and the name is
// then exchanged by one rename. A crash, a full disk or a Ctrl-C leaves the old file untouched. Reading checks sizes before it believes them.
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#if defined(__unix__) || defined(__APPLE__)
#include <unistd.h>
#endif

#include "compmark/core/result.hpp"

namespace compmark::inline v0 {

/// One file being written. Nothing is visible under `path` before commit(); destroyed without commit, it leaves no trace.
class AtomicFile {
 public:
  /// Opens `<path>.partial`; the folder must exist.
  [[nodiscard]] static Result<AtomicFile> create(const std::filesystem::path& path) {
    AtomicFile file(path);
    std::error_code status;
    if (std::filesystem::is_directory(path, status))
      return file.error("is a folder, not a file", "give the name of a file");
    file.stream_.reset(std::fopen(file.partial_.c_str(), "wb"));
    if (!file.stream_) {
      const std::string reason = std::strerror(errno);
      file.partial_.clear();  // it is not ours: the destructor must not remove it
      return file.error("cannot be written: " + reason, "create its folder and make it writable");
    }
    return file;
  }

  AtomicFile(AtomicFile&& other) noexcept
      : path_(std::move(other.path_)),
        partial_(std::exchange(other.partial_, {})),
        stream_(std::move(other.stream_)),
        failure_(other.failure_) {}
  AtomicFile& operator=(AtomicFile&& other) noexcept {
    std::swap(path_, other.path_);
    std::swap(partial_, other.partial_);
    std::swap(stream_, other.stream_);
    std::swap(failure_, other.failure_);
    return *this;
  }
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  ~AtomicFile() { discard(); }

  /// Appends bytes. A failure is remembered and reported by commit(), so that a caller may write many pieces and look once.
  void write(std::span<const std::byte> bytes) {
    if (failure_ != 0 || bytes.empty()) return;
    if (std::fwrite(bytes.data(), 1, bytes.size(), stream_.get()) != bytes.size()) failure_ = errno != 0 ? errno : EIO;
  }
  void write(std::string_view text) { write(std::as_bytes(std::span<const char>(text.data(), text.size()))); }

  /// Flushes to the disk and renames. On an error the old file is as it was and the partial file is gone.
  [[nodiscard]] Result<Done> commit() {
    if (failure_ == 0 && std::fflush(stream_.get()) != 0) failure_ = errno;
#if defined(__unix__) || defined(__APPLE__)
    // EINVAL: the target (a pipe, some network file systems) cannot be synchronised; the rename is still whole.
    if (failure_ == 0 && ::fsync(::fileno(stream_.get())) != 0 && errno != EINVAL) failure_ = errno;
#endif
    if (std::FILE* raw = stream_.release(); std::fclose(raw) != 0 && failure_ == 0) failure_ = errno;
    if (failure_ == 0) {
      std::error_code status;
      std::filesystem::rename(partial_, path_, status);
      if (!status) {
        partial_.clear();
        return Done{};
      }
      failure_ = status.value();
    }
    const std::string reason = std::strerror(failure_);
    discard();
    return error("cannot be written: " + reason, "free some space on its disk or choose another folder");
  }

 private:
  struct Close {
    void operator()(std::FILE* stream) const { std::fclose(stream); }
  };
  explicit AtomicFile(const std::filesystem::path& path) : path_(path), partial_(path) { partial_ += ".partial"; }
  void discard() {
    stream_.reset();
    if (partial_.empty()) return;
    std::error_code ignored;
    std::filesystem::remove(partial_, ignored);
    partial_.clear();
  }
  [[nodiscard]] Error error(std::string problem, std::string remedy) const {
    return {ErrorKind::unwritable, path_.string(), "", std::move(problem), std::move(remedy)};
  }

  std::filesystem::path path_;
  std::filesystem::path partial_;
  std::unique_ptr<std::FILE, Close> stream_;
  int failure_ = 0;
};

/// Writes one whole file.
[[nodiscard]] inline Result<Done> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  Result<AtomicFile> file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(bytes);
  return file->commit();
}
[[nodiscard]] inline Result<Done> write_file(const std::filesystem::path& path, std::string_view text) {
  return write_file(path, std::as_bytes(std::span<const char>(text.data(), text.size())));
}

/// Reads one whole file of at most `limit` bytes.
[[nodiscard]] inline Result<std::vector<std::byte>> read_file(const std::filesystem::path& path,
                                                              std::uintmax_t limit = std::uintmax_t{1} << 40) {
  const auto fail = [&](ErrorKind kind, std::string problem, std::string remedy) {
    return Error{kind, path.string(), "", std::move(problem), std::move(remedy)};
  };
  std::error_code status;
  if (!std::filesystem::exists(path, status)) return fail(ErrorKind::not_found, "no such file", "check the path");
  if (!std::filesystem::is_regular_file(path, status)) {
    return fail(ErrorKind::unreadable, "is not a regular file", "give the name of a file");
  }
  const std::uintmax_t size = std::filesystem::file_size(path, status);
  if (status)
    return fail(ErrorKind::unreadable, "its size cannot be read: " + status.message(), "check its permissions");
  if (size > limit) {
    return fail(ErrorKind::exhausted,
                "has " + std::to_string(size) + " bytes, more than the limit of " + std::to_string(limit),
                "check that this is the right file");
  }
  struct Close {
    void operator()(std::FILE* stream) const { std::fclose(stream); }
  };
  const std::unique_ptr<std::FILE, Close> stream(std::fopen(path.c_str(), "rb"));
  if (!stream)
    return fail(ErrorKind::unreadable, std::string("cannot be opened: ") + std::strerror(errno),
                "check its permissions");
  std::vector<std::byte> bytes(static_cast<std::size_t>(size));
  if (!bytes.empty() && std::fread(bytes.data(), 1, bytes.size(), stream.get()) != bytes.size()) {
    return fail(ErrorKind::truncated, "ended before its " + std::to_string(size) + " bytes", "copy it again");
  }
  return bytes;
}

}  // namespace compmark::inline v0
