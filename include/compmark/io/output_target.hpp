// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What lies under the name of an output. A regular file, or a name that is free, is replaced whole, behind any symbolic
// links: the links stay. A device, a named pipe or a descriptor of this process (/dev/stdout, /dev/fd/3) is written
// through, never replaced, and nothing can be read back from it. Folders, sockets and block devices are refused.
#pragma once

#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#if defined(__unix__) || defined(__APPLE__)
#include <unistd.h>
#endif

#include "compmark/core/result.hpp"

namespace compmark {

/// Where the bytes of an output go.
struct OutputTarget {
  enum class Kind {
    file,        ///< replaced whole by a rename
    stream,      ///< opened and written through: a character device or a named pipe
    descriptor,  ///< already open in this process: written through a copy of the descriptor, at its own place
  };
  Kind kind = Kind::file;
  std::filesystem::path path;  ///< the file, device or pipe itself, behind all links
  int descriptor = -1;         ///< of Kind::descriptor
  bool exists = false;         ///< false: a file of this name would be new
};

namespace detail {

/// The descriptor that a path names ("/dev/stdout", "/dev/fd/7", "/proc/self/fd/7"), or -1.
[[nodiscard]] inline int named_descriptor(const std::filesystem::path& path) {
#if defined(__unix__) || defined(__APPLE__)
  const std::filesystem::path clean = path.lexically_normal();
  if (clean == "/dev/stdin") return STDIN_FILENO;
  if (clean == "/dev/stdout") return STDOUT_FILENO;
  if (clean == "/dev/stderr") return STDERR_FILENO;
  const std::string folder = clean.parent_path().string();
  if (folder != "/dev/fd" && folder != "/proc/self/fd" && folder != "/proc/thread-self/fd" &&
      folder != "/proc/" + std::to_string(::getpid()) + "/fd") {
    return -1;
  }
  const std::string digits = clean.filename().string();
  if (digits.empty() || digits.size() > 9 || digits.find_first_not_of("0123456789") != std::string::npos) return -1;
  return std::stoi(digits);
#else
  static_cast<void>(path);
  return -1;
#endif
}

}  // namespace detail

/// Looks under a name, through symbolic links, also through one whose file does not exist yet. An error if nothing can
/// be written there.
[[nodiscard]] inline Result<OutputTarget> output_target(const std::filesystem::path& path) {
  const auto fail = [&](std::string problem, std::string remedy) {
    return Error{ErrorKind::unwritable, path.string(), "", std::move(problem), std::move(remedy)};
  };
  if (!path.has_filename()) return fail("is not the name of a file", "give the name of a file");
  constexpr int links_limit = 40;  // that of Linux
  OutputTarget target;
  target.path = path;
  for (int links = 0;; ++links) {
    target.descriptor = detail::named_descriptor(target.path);
    if (target.descriptor >= 0) {
      target.kind = OutputTarget::Kind::descriptor;
      target.exists = true;
      return target;
    }
    std::error_code status;
    const std::filesystem::file_type type = std::filesystem::symlink_status(target.path, status).type();
    if (type == std::filesystem::file_type::not_found) return target;
    target.exists = true;
    if (type == std::filesystem::file_type::regular) return target;
    if (type == std::filesystem::file_type::character || type == std::filesystem::file_type::fifo) {
      target.kind = OutputTarget::Kind::stream;
      return target;
    }
    if (type == std::filesystem::file_type::directory)
      return fail("is a folder, not a file", "give the name of a file");
    if (type == std::filesystem::file_type::socket || type == std::filesystem::file_type::block)
      return fail(type == std::filesystem::file_type::socket ? "is a socket" : "is a disk (block device)",
                  "give the name of a file");
    if (type != std::filesystem::file_type::symlink)
      return fail("cannot be looked at: " + (status ? status.message() : "its type is unknown"),
                  "give the name of a file");
    if (links == links_limit) return fail("is a loop of symbolic links", "give the name of a file");
    const std::filesystem::path next = std::filesystem::read_symlink(target.path, status);
    if (status) return fail("is a link that cannot be read: " + status.message(), "give the name of a file");
    target.path = next.is_absolute() ? next : target.path.parent_path() / next;
    target.exists = false;
    if (!target.path.has_filename()) return fail("is a link to a folder", "give the name of a file");
  }
}

/// True for a device, a pipe, a socket or a descriptor: what is written there cannot be read back, and opening it to
/// try would be seen by whoever reads it.
[[nodiscard]] inline bool is_stream_target(const std::filesystem::path& path) {
  const Result<OutputTarget> target = output_target(path);
  if (target) return target->kind != OutputTarget::Kind::file;
  std::error_code status;
  const std::filesystem::file_type type = std::filesystem::status(path, status).type();
  return type == std::filesystem::file_type::socket || type == std::filesystem::file_type::block;
}

}  // namespace compmark
