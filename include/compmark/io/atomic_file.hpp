// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Files are replaced whole or not at all: bytes go to `<path>.partial-1` next to the target, are flushed to the disk,
// and the name is then exchanged by one rename. A crash, a full disk or a Ctrl-C leaves the old file untouched. The
// partial file is created exclusively and locked: another program that writes the same target at the same time takes
// `<path>.partial-2`, and the last one to finish wins, whole. What a killed program left is not locked any more and is
// removed by the next write of that target. Devices, pipes and descriptors are written through, symbolic links are
// followed: see output_target.hpp.
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/detail/output_stream.hpp"
#include "compmark/io/output_target.hpp"
#include "compmark/io/read_file.hpp"

namespace compmark {

/// One file being written. Nothing is visible under `path` before commit(); destroyed without commit, it leaves no
/// trace. A stream (a device, a pipe, a descriptor) sees the bytes as they are written.
class AtomicFile {
 public:
  /// Opens `<path>.partial-N`; the folder must exist. A new file gets `mode` less the process's umask, a replaced one
  /// keeps its mode.
  [[nodiscard]] static Result<AtomicFile> create(const std::filesystem::path& path, unsigned mode = 0666) {
    Result<OutputTarget> target = output_target(path);
    if (!target) return target.error();
    AtomicFile file(path, std::move(*target));
    const int failure = file.open(mode);
    if (failure == 0) return file;
    if (failure == ENXIO)
      return file.error("is a pipe that nobody reads", "start its reader first, or give the name of a file");
    if (failure == EEXIST)
      return file.error(
          "has " + std::to_string(slots) + " partial files (" + path.filename().string() + ".partial-1 …)",
          "remove them if no program is writing");
    return file.error(std::string("cannot be written: ") + std::strerror(failure),
                      "create its folder and make it writable");
  }

  AtomicFile(AtomicFile&& other) noexcept
      : path_(std::move(other.path_)),
        target_(std::move(other.target_)),
        partial_(std::exchange(other.partial_, {})),
        stream_(std::move(other.stream_)),
        buffer_(std::move(other.buffer_)),
        failure_(other.failure_) {}
  AtomicFile& operator=(AtomicFile&& other) noexcept {
    std::swap(path_, other.path_);
    std::swap(target_, other.target_);
    std::swap(partial_, other.partial_);
    std::swap(stream_, other.stream_);
    std::swap(buffer_, other.buffer_);
    std::swap(failure_, other.failure_);
    return *this;
  }
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  ~AtomicFile() { discard(); }

  /// Appends bytes. A failure is remembered and reported by commit(), so that a caller may write many pieces and look
  /// once.
  void write(std::span<const std::byte> bytes) {
    if (failure_ != 0 || bytes.empty()) return;
    if (buffer_.size() + bytes.size() > buffer_limit) flush();
    if (bytes.size() >= buffer_limit) {
      if (failure_ == 0) failure_ = stream_.write(bytes);
    } else {
      buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
    }
  }
  void write(std::string_view text) { write(std::as_bytes(std::span<const char>(text.data(), text.size()))); }

  /// Sends what was written so far: a stream's reader sees it now. False after a failure.
  bool flush() {
    if (failure_ == 0 && !buffer_.empty()) failure_ = stream_.write(buffer_);
    buffer_.clear();
    return failure_ == 0;
  }

  /// Flushes to the disk and renames. On an error the old file is as it was and the partial file is gone.
  [[nodiscard]] Result<Done> commit() { return commit_as(false); }
  /// The same, but a file that is there, also since create(), is left alone, and that is an error.
  [[nodiscard]] Result<Done> commit_new() { return commit_as(true); }

  /// True if the bytes go to a device, a pipe or a descriptor: nothing is replaced and nothing can be read back.
  [[nodiscard]] bool is_stream() const { return target_.kind != OutputTarget::Kind::file; }

 private:
  static constexpr int slots = 100;
  static constexpr std::size_t buffer_limit = std::size_t{1} << 16;

  [[nodiscard]] Result<Done> commit_as(bool only_new) {
    flush();
    const bool replaces = target_.kind == OutputTarget::Kind::file;
    if (failure_ == 0 && replaces) failure_ = stream_.synchronise();
    if constexpr (!detail::OutputStream::may_rename_open) {
      if (const int closed = stream_.close(); failure_ == 0) failure_ = closed;
    }
    // The lock is held until the name is exchanged: nobody takes the finished file for a stale one.
    if (failure_ == 0 && replaces) failure_ = only_new ? take_new_name() : take_name();
    if (const int closed = stream_.close(); failure_ == 0) failure_ = closed;
    if (failure_ == 0) return Done{};
    const int failure = failure_;
    discard();
    if (failure == EEXIST && only_new) return error("exists already", "choose another name");
    if (failure == EPIPE)
      return error("its reader has gone (closed pipe)", "keep the reader open until the program ends");
    return error(std::string("cannot be written: ") + std::strerror(failure),
                 replaces ? "free some space on its disk or choose another folder" : "give the name of a file");
  }

  [[nodiscard]] int take_name() {
    std::error_code status;
    std::filesystem::rename(partial_, target_.path, status);
    if (!status) partial_.clear();
    return status.value();
  }
  /// A second name for the partial file, which goes away as ever: it is given to one of two programs. Where a file cannot
  /// have two names (FAT), renamed after a look.
  [[nodiscard]] int take_new_name() {
    std::error_code status;
    std::filesystem::create_hard_link(partial_, target_.path, status);
    if (!status) {
      std::filesystem::remove(partial_, status);
      partial_.clear();
      return 0;
    }
    if (status == std::errc::file_exists) return EEXIST;
    const bool there = std::filesystem::exists(target_.path, status);
    return status ? status.value() : there ? EEXIST : take_name();
  }

  AtomicFile(std::filesystem::path path, OutputTarget target) : path_(std::move(path)), target_(std::move(target)) {}

  [[nodiscard]] int open(unsigned mode) {
    if (target_.kind == OutputTarget::Kind::descriptor) return stream_.duplicate(target_.descriptor);
    if (target_.kind == OutputTarget::Kind::stream) return stream_.open_stream(target_.path);
    // A name near the limit of 255 bytes is shortened, or its partial file could not be named.
    constexpr std::size_t name_limit = 240;
    const std::string name = target_.path.filename().string().substr(0, name_limit) + ".partial-";
    int failure = EEXIST;
    for (int slot = 1; slot <= slots && failure == EEXIST; ++slot) {
      const std::filesystem::path partial = target_.path.parent_path() / (name + std::to_string(slot));
      failure = stream_.create(partial, mode);
      if (failure == 0) partial_ = partial;  // ours from here: the destructor removes it
    }
    if (failure == 0 && target_.exists) stream_.take_after(target_.path);
    return failure;
  }
  void discard() {
    if constexpr (!detail::OutputStream::may_rename_open) static_cast<void>(stream_.close());
    // Removed before it is closed: once the lock is gone, the name may be another program's.
    if (!partial_.empty()) {
      std::error_code ignored;
      std::filesystem::remove(partial_, ignored);
      partial_.clear();
    }
    static_cast<void>(stream_.close());
  }
  [[nodiscard]] Error error(std::string problem, std::string remedy) const {
    return {ErrorKind::unwritable, path_.string(), "", std::move(problem), std::move(remedy)};
  }

  std::filesystem::path path_;
  OutputTarget target_;
  std::filesystem::path partial_;
  detail::OutputStream stream_;
  std::vector<std::byte> buffer_;
  int failure_ = 0;
};

/// Writes one whole file; `mode` as that of AtomicFile::create.
[[nodiscard]] inline Result<Done> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes,
                                             unsigned mode = 0666) {
  Result<AtomicFile> file = AtomicFile::create(path, mode);
  if (!file) return file.error();
  file->write(bytes);
  return file->commit();
}
[[nodiscard]] inline Result<Done> write_file(const std::filesystem::path& path, std::string_view text,
                                             unsigned mode = 0666) {
  return write_file(path, std::as_bytes(std::span<const char>(text.data(), text.size())), mode);
}

/// Whether a file can be written there, asked before work begins: a file's place is tried and left as it was, a stream
/// is not opened.
[[nodiscard]] inline Result<Done> check_writable(const std::filesystem::path& path) {
  const Result<OutputTarget> target = output_target(path);
  if (!target) return target.error();
  if (target->kind != OutputTarget::Kind::file) return Done{};
  const Result<AtomicFile> file = AtomicFile::create(path);
  if (!file) return file.error();
  return Done{};
}

}  // namespace compmark
