// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A lock on a folder or a file, so that two runs cannot write into it at once: the first one holds the lock, the second
// gets an Error. The lock belongs to the process and ends with it, however it ends, so a killed run never blocks the
// next. It is advisory: it binds programs that ask for it. Where the system has no such locks (not POSIX, some network
// file systems) every program gets one, and nothing is excluded.
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "compmark/core/result.hpp"
#include "compmark/io/detail/output_stream.hpp"
#include "compmark/io/output_target.hpp"

namespace compmark {

/// Held while it lives. Movable; one that was moved from, or default-constructed, holds nothing.
class FolderLock {
 public:
  FolderLock() = default;
  FolderLock(FolderLock&& other) noexcept
      : lock_(std::exchange(other.lock_, {})),
        descriptor_(std::exchange(other.descriptor_, -1)) {}
  FolderLock& operator=(FolderLock&& other) noexcept {
    std::swap(lock_, other.lock_);
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;
  ~FolderLock() {
#if defined(COMPMARK_POSIX_FILES)
    if (descriptor_ < 0) return;
    ::unlink(lock_.c_str());  // while it is held: afterwards the name may be another run's
    ::close(descriptor_);
#endif
  }

  /// Locks a folder that exists, by the file `.compmark-lock` in it, which is removed with the lock.
  [[nodiscard]] static Result<FolderLock> acquire(const std::filesystem::path& folder) {
    return acquire(folder / ".compmark-lock", folder, "another run writes into this folder",
                   "wait for it or choose another folder (--out)");
  }
  /// Locks the place of one output file, by `<file>.lock` beside it, which is removed with the lock. A stream is not
  /// locked.
  [[nodiscard]] static Result<FolderLock> beside(const std::filesystem::path& file) {
    const Result<OutputTarget> target = output_target(file);
    if (!target) return target.error();
    if (target->kind != OutputTarget::Kind::file) return FolderLock{};
    constexpr std::size_t name_limit = 240;  // as that of a partial file
    const std::string name = target->path.filename().string().substr(0, name_limit) + ".lock";
    const std::filesystem::path lock = target->path.parent_path() / name;
    return acquire(lock, file, "another run writes this file", "wait for it or choose another name (--out)");
  }

  [[nodiscard]] bool held() const { return descriptor_ >= 0; }

 private:
  [[nodiscard]] static Result<FolderLock> acquire(const std::filesystem::path& lock, const std::filesystem::path& what,
                                                  const char* taken, const char* remedy) {
    FolderLock result;
#if defined(COMPMARK_POSIX_FILES)
    const auto fail = [&](std::string problem, std::string advice) {
      return Error{ErrorKind::unwritable, what.string(), "", std::move(problem), std::move(advice)};
    };
    for (;;) {
      constexpr int flags = O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
      int descriptor = ::open(lock.c_str(), O_RDWR | O_CREAT | flags, 0666);
      if (descriptor < 0 && errno == EACCES) descriptor = ::open(lock.c_str(), O_RDONLY | flags);  // another user's
      if (descriptor < 0) {
        const std::string folder = lock.parent_path().empty() ? std::string(".") : lock.parent_path().string();
        return Error{ErrorKind::unwritable, folder, "", std::string("cannot be written into: ") + std::strerror(errno),
                     "create this folder, or make it writable"};
      }
      if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
        const int reason = errno;
        ::close(descriptor);
        if (reason == EINTR) continue;
        if (reason == EWOULDBLOCK) return fail(taken, remedy);
        return result;  // no locks on this file system
      }
      // Its last holder may have removed the file between our two steps: then this lock excludes nobody.
      if (!detail::is_name_of(lock, descriptor)) {
        ::close(descriptor);
        continue;
      }
      std::error_code status;
      result.lock_ = std::filesystem::absolute(lock, status);
      result.descriptor_ = descriptor;
      return result;
    }
#else
    static_cast<void>(lock), static_cast<void>(what), static_cast<void>(taken), static_cast<void>(remedy);
    return result;
#endif
  }

  std::filesystem::path lock_;
  int descriptor_ = -1;
};

}  // namespace compmark
