// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One open output of the operating system. On POSIX systems: created exclusively, locked while it is written (the lock
// ends with the process, so what a killed one left is recognised), and written so that a closed pipe or a size limit is
// an error code, not a signal. Elsewhere: the standard library's exclusive mode, and nothing is locked.
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <span>
#include <system_error>
#include <utility>

#if defined(__unix__) || defined(__APPLE__)
#define COMPMARK_POSIX_FILES 1
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#endif

namespace compmark::detail {

#if defined(COMPMARK_POSIX_FILES)

/// While it lives, SIGPIPE and SIGXFSZ of this thread wait, and those that came are taken away at the end: write() says
/// the same by its errno.
class WriteSignalsHeld {
 public:
  WriteSignalsHeld() {
#if !defined(__EMSCRIPTEN__)
    ::sigemptyset(&held_);
    ::sigaddset(&held_, SIGPIPE);
    ::sigaddset(&held_, SIGXFSZ);
    ::sigset_t pending;
    ::sigpending(&pending);
    if (::sigismember(&pending, SIGPIPE) != 0) ::sigdelset(&held_, SIGPIPE);  // somebody else's: it stays
    if (::sigismember(&pending, SIGXFSZ) != 0) ::sigdelset(&held_, SIGXFSZ);
    ::pthread_sigmask(SIG_BLOCK, &held_, &before_);
#endif
  }
  WriteSignalsHeld(const WriteSignalsHeld&) = delete;
  WriteSignalsHeld& operator=(const WriteSignalsHeld&) = delete;
  ~WriteSignalsHeld() {
#if !defined(__EMSCRIPTEN__)
    for (const int signal : {SIGPIPE, SIGXFSZ}) {
      ::sigset_t pending, one;
      ::sigpending(&pending);
      if (::sigismember(&held_, signal) == 0 || ::sigismember(&pending, signal) == 0) continue;
      ::sigemptyset(&one);
      ::sigaddset(&one, signal);
      int taken = 0;
      ::sigwait(&one, &taken);
    }
    ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
#endif
  }

 private:
#if !defined(__EMSCRIPTEN__)
  ::sigset_t held_{};
  ::sigset_t before_{};
#endif
};

/// True if the name is that of the open file.
[[nodiscard]] inline bool is_name_of(const std::filesystem::path& path, int descriptor) {
  struct ::stat named {
  }, open{};
  return ::lstat(path.c_str(), &named) == 0 && ::fstat(descriptor, &open) == 0 && named.st_dev == open.st_dev &&
         named.st_ino == open.st_ino;
}

class OutputStream {
 public:
  static constexpr bool may_rename_open = true;  ///< a file can be renamed and removed while it is open

  OutputStream() = default;
  OutputStream(OutputStream&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  OutputStream& operator=(OutputStream&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  OutputStream(const OutputStream&) = delete;
  OutputStream& operator=(const OutputStream&) = delete;
  ~OutputStream() { static_cast<void>(close()); }

  /// All functions return 0 or an errno. EEXIST: the name is taken by a file that somebody writes, or that is not a
  /// stale one of ours.
  [[nodiscard]] int create(const std::filesystem::path& path, unsigned mode) {
    constexpr int attempts = 100;
    for (int attempt = 0; attempt < attempts; ++attempt) {
      descriptor_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, static_cast<::mode_t>(mode));
      if (descriptor_ >= 0) {
        // Before our lock another program may have taken the file for a stale one: then it holds the lock, or the name
        // is gone. A file system without locks (ENOLCK, ENOSYS …) still creates exclusively.
        const bool locked = ::flock(descriptor_, LOCK_EX | LOCK_NB) == 0;
        const bool taken = locked ? !is_name_of(path, descriptor_) : errno == EWOULDBLOCK;
        if (!taken) return 0;
        static_cast<void>(close());
        continue;
      }
      if (errno != EEXIST) return errno;
      if (!remove_stale(path)) return EEXIST;
    }
    return EEXIST;
  }

  /// Opens a device or a named pipe. A pipe's reader may come a moment later: ENXIO after two seconds without one.
  [[nodiscard]] int open_stream(const std::filesystem::path& path) {
    constexpr int patience = 200, pause_ms = 10;
    for (int attempt = 0;; ++attempt) {
      descriptor_ = ::open(path.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
      if (descriptor_ >= 0) break;
      if (errno == EINTR) continue;
      if (errno != ENXIO || attempt == patience) return errno;
      ::poll(nullptr, 0, pause_ms);
    }
    const int flags = ::fcntl(descriptor_, F_GETFL);
    return flags < 0 || ::fcntl(descriptor_, F_SETFL, flags & ~O_NONBLOCK) < 0 ? errno : 0;
  }
  [[nodiscard]] int duplicate(int descriptor) {
    descriptor_ = ::fcntl(descriptor, F_DUPFD_CLOEXEC, 0);
    return descriptor_ < 0 ? errno : 0;
  }

  /// Gives the file the mode (and, where that is allowed, the owner) of the one it will replace.
  void take_after(const std::filesystem::path& path) {
    struct ::stat old {
    }, now{};
    if (::stat(path.c_str(), &old) != 0 || ::fstat(descriptor_, &now) != 0) return;
    if (old.st_uid != now.st_uid || old.st_gid != now.st_gid) {
      if (::fchown(descriptor_, old.st_uid, old.st_gid) != 0) errno = 0;  // only the administrator may
    }
    if (::fchmod(descriptor_, old.st_mode & 0777) != 0) errno = 0;
  }

  [[nodiscard]] int write(std::span<const std::byte> bytes) {
    const WriteSignalsHeld held;
    while (!bytes.empty()) {
      const ::ssize_t count = ::write(descriptor_, bytes.data(), bytes.size());
      if (count > 0) {
        bytes = bytes.subspan(static_cast<std::size_t>(count));
      } else if (count < 0 && errno == EAGAIN) {  // a descriptor that was opened without waiting
        ::pollfd ready{descriptor_, POLLOUT, 0};
        ::poll(&ready, 1, -1);
      } else if (count == 0 || errno != EINTR) {
        return count == 0 ? EIO : errno;
      }
    }
    return 0;
  }
  /// EINVAL: some network file systems cannot be synchronised; the rename is still whole.
  [[nodiscard]] int synchronise() { return ::fsync(descriptor_) != 0 && errno != EINVAL ? errno : 0; }
  [[nodiscard]] int close() {
    const int descriptor = std::exchange(descriptor_, -1);
    return descriptor >= 0 && ::close(descriptor) != 0 && errno != EINTR ? errno : 0;
  }

 private:
  /// Removes a partial file whose writer is dead: nobody holds its lock. While we hold it, nobody renames or removes
  /// the name but us.
  [[nodiscard]] static bool remove_stale(const std::filesystem::path& path) {
    constexpr int flags = O_NONBLOCK | O_CLOEXEC | O_NOFOLLOW;
    int descriptor = ::open(path.c_str(), O_WRONLY | flags);
    if (descriptor < 0 && errno == EACCES) descriptor = ::open(path.c_str(), O_RDONLY | flags);
    if (descriptor < 0) return errno == ENOENT;  // it has just been renamed
    struct ::stat open {};
    const bool ours = ::fstat(descriptor, &open) == 0 && S_ISREG(open.st_mode);
    bool removed = ours && ::flock(descriptor, LOCK_EX | LOCK_NB) == 0;
    if (removed && is_name_of(path, descriptor)) removed = ::unlink(path.c_str()) == 0;
    ::close(descriptor);
    return removed;
  }

  int descriptor_ = -1;
};

#else

class OutputStream {
 public:
  static constexpr bool may_rename_open = false;

  OutputStream() = default;
  OutputStream(OutputStream&& other) noexcept : stream_(std::exchange(other.stream_, nullptr)) {}
  OutputStream& operator=(OutputStream&& other) noexcept {
    std::swap(stream_, other.stream_);
    return *this;
  }
  OutputStream(const OutputStream&) = delete;
  OutputStream& operator=(const OutputStream&) = delete;
  ~OutputStream() { static_cast<void>(close()); }

  [[nodiscard]] int create(const std::filesystem::path& path, unsigned /*mode*/) {
    std::error_code status;
    if (std::filesystem::exists(path, status)) return EEXIST;
    stream_ = std::fopen(path.string().c_str(), "wbx");
    return stream_ == nullptr ? errno : 0;
  }
  [[nodiscard]] int open_stream(const std::filesystem::path& path) {
    stream_ = std::fopen(path.string().c_str(), "wb");
    return stream_ == nullptr ? errno : 0;
  }
  [[nodiscard]] int duplicate(int /*descriptor*/) { return EBADF; }
  void take_after(const std::filesystem::path& /*path*/) {}
  [[nodiscard]] int write(std::span<const std::byte> bytes) {
    return std::fwrite(bytes.data(), 1, bytes.size(), stream_) == bytes.size() ? 0 : errno != 0 ? errno : EIO;
  }
  [[nodiscard]] int synchronise() { return std::fflush(stream_) == 0 ? 0 : errno; }
  [[nodiscard]] int close() {
    std::FILE* stream = std::exchange(stream_, nullptr);
    return stream == nullptr || std::fclose(stream) == 0 ? 0 : errno;
  }

 private:
  std::FILE* stream_ = nullptr;
};

#endif

}  // namespace compmark::detail
