// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Random bytes of the operating system, for secrets: getrandom where there is one, else /dev/urandom. Everything else
// in the library draws from core/random.hpp, which is repeatable and therefore no source of secrets. Either all bytes
// are random or there is an Error.
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#if defined(__linux__)
#include <sys/random.h>
#endif

#include "compmark/core/result.hpp"

namespace compmark {

/// Fills `bytes` from a device file.
[[nodiscard]] inline Result<Done> device_random(std::span<std::byte> bytes,
                                                const std::filesystem::path& device = "/dev/urandom") {
  struct Close {
    void operator()(std::FILE* stream) const { std::fclose(stream); }
  };
  const auto fail = [&](const std::string& problem) {
    return Error{ErrorKind::unreadable, device.string(), "", problem,
                 "no secret can be made on this system without its random numbers"};
  };
  const std::unique_ptr<std::FILE, Close> stream(std::fopen(device.c_str(), "rb"));
  if (!stream) return fail(std::string("cannot be opened: ") + std::strerror(errno));
  std::setvbuf(stream.get(), nullptr, _IONBF, 0);  // no copy of a secret stays in a buffer
  if (std::fread(bytes.data(), 1, bytes.size(), stream.get()) != bytes.size()) return fail("gave too few bytes");
  return Done{};
}

/// Fills `bytes` with random numbers fit for secrets.
[[nodiscard]] inline Result<Done> os_random(std::span<std::byte> bytes) {
#if defined(__linux__)
  std::size_t filled = 0;
  while (filled < bytes.size()) {
    const ssize_t count = ::getrandom(bytes.data() + filled, bytes.size() - filled, 0);
    if (count > 0) {
      filled += static_cast<std::size_t>(count);
    } else if (count == 0 || errno != EINTR) {
      return device_random(bytes);  // an old kernel, or a sandbox without the call
    }
  }
  return Done{};
#else
  return device_random(bytes);
#endif
}

}  // namespace compmark
