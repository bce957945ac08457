// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Decides whether two names are the same file. If both exist, the file system decides (hard links, symbolic links,
// mounts, another case); if not, their folder and name do. It guards inputs from being overwritten.
#pragma once

#include <cctype>
#include <filesystem>
#include <string>
#include <system_error>

#if defined(__unix__) || defined(__APPLE__)
#include <sys/stat.h>
#endif

#include "compmark/io/output_target.hpp"

namespace compmark {

namespace detail {

[[nodiscard]] inline std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}
[[nodiscard]] inline std::string other_case(std::string text) {
  for (char& c : text) {
    const auto letter = static_cast<unsigned char>(c);
    c = static_cast<char>(std::islower(letter) != 0 ? std::toupper(letter) : std::tolower(letter));
  }
  return text;
}

enum class Identity { same, different, unknown };

/// What the file system says; unknown where neither exists.
[[nodiscard]] inline Identity identity(const std::filesystem::path& a, const std::filesystem::path& b) {
#if defined(__unix__) || defined(__APPLE__)  // the standard's function knows no devices and no pipes
  struct ::stat of_a {
  }, of_b{};
  const bool a_exists = ::stat(a.c_str(), &of_a) == 0, b_exists = ::stat(b.c_str(), &of_b) == 0;
  if (!a_exists && !b_exists) return Identity::unknown;
  const bool same = a_exists && b_exists && of_a.st_dev == of_b.st_dev && of_a.st_ino == of_b.st_ino;
#else
  std::error_code status;
  const bool a_exists = std::filesystem::exists(a, status), b_exists = std::filesystem::exists(b, status);
  if (!a_exists && !b_exists) return Identity::unknown;
  const bool same = a_exists && b_exists && std::filesystem::equivalent(a, b, status) && !status;
#endif
  return same ? Identity::same : Identity::different;
}

/// True if the file system does not tell capitals from small letters: the folder is also there under its name in the
/// other case.
[[nodiscard]] inline bool ignores_case(const std::filesystem::path& folder) {
  std::error_code status;
  std::filesystem::path at = std::filesystem::weakly_canonical(folder, status);
  for (; !status && at.has_relative_path(); at = at.parent_path()) {
    const std::string name = at.filename().string();
    if (other_case(name) == name) continue;
    return identity(at, at.parent_path() / other_case(name)) == Identity::same;
  }
  return false;
}

/// The absolute path behind all symbolic links, also of a file that does not exist yet.
[[nodiscard]] inline std::filesystem::path place_of(const std::filesystem::path& path) {
  const Result<OutputTarget> target = output_target(path);
  const std::filesystem::path& name = target ? target->path : path;
  std::error_code status;
  const std::filesystem::path absolute = std::filesystem::absolute(name, status);
  if (status) return name.lexically_normal();
  std::filesystem::path folder = std::filesystem::weakly_canonical(absolute.parent_path(), status);
  if (status) folder = absolute.parent_path().lexically_normal();
  return (folder / absolute.filename()).lexically_normal();
}

}  // namespace detail

/// True if `a` and `b` name one file or folder, now or once it is written. Empty paths name nothing.
[[nodiscard]] inline bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  if (a.empty() || b.empty()) return false;
  const detail::Identity known = detail::identity(a, b);
  if (known != detail::Identity::unknown) return known == detail::Identity::same;
  const std::filesystem::path place_a = detail::place_of(a), place_b = detail::place_of(b);
  if (place_a == place_b) return true;
  return detail::lower(place_a.string()) == detail::lower(place_b.string()) &&
         detail::ignores_case(place_a.parent_path());
}

/// True if `path` is `folder` or lies in it at any depth, now or once it is written.
[[nodiscard]] inline bool lies_in(const std::filesystem::path& path, const std::filesystem::path& folder) {
  if (path.empty() || folder.empty()) return false;
  if (same_file(path, folder)) return true;
  std::filesystem::path at = detail::place_of(path);
  for (; at.has_relative_path(); at = at.parent_path()) {
    if (same_file(at.parent_path(), folder)) return true;
  }
  return false;
}

}  // namespace compmark
