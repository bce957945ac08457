// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/run/run_folder.hpp.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "compmark/app/files.hpp"
#include "compmark/app/run/run_folder.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/file_exists.hpp"
#include "compmark/io/folder_lock.hpp"

namespace compmark {

COMPMARK_APP_INLINE Result<Done> make_folder(const std::filesystem::path& path) {
  std::error_code status;
  std::filesystem::create_directories(path, status);
  if (status || !detail::folder_exists(path)) {
    return Error{ErrorKind::unwritable, path.string(), "--out", "the folder cannot be created: " + status.message(),
                 "choose a place you may write to"};
  }
  if (!AtomicFile::create(path / ".compmark-probe")) {  // never committed: nothing of it stays
    return Error{ErrorKind::unwritable, path.string(), "--out", "no file can be written in this folder",
                 "change its permissions or choose another"};
  }
  return Done{};
}

COMPMARK_APP_INLINE Result<std::shared_ptr<const void>> hold_folder(const std::filesystem::path& folder) {
  if (Result<Done> made = make_folder(folder); !made) return made.error();
  Result<FolderLock> lock = FolderLock::acquire(folder);
  if (!lock) return lock.error();
  return std::shared_ptr<const void>(std::make_shared<FolderLock>(std::move(*lock)));
}

COMPMARK_APP_INLINE Result<std::shared_ptr<const void>> hold_file(const std::filesystem::path& file) {
  Result<FolderLock> lock = FolderLock::beside(file);
  if (!lock) return lock.error();
  return std::shared_ptr<const void>(std::make_shared<FolderLock>(std::move(*lock)));
}

COMPMARK_APP_INLINE Result<Done> check_unfinished(const std::filesystem::path& folder, bool wanted) {
  std::error_code status;
  if (wanted || !std::filesystem::exists(folder / "results.json", status)) return Done{};
  return Error{ErrorKind::invalid, folder.string(), "--out", "holds a finished run (results.json)",
               "choose another folder, or give --force to replace it"};
}

COMPMARK_APP_INLINE Result<Done> check_no_decoder(const std::filesystem::path& file, bool wanted) {
  std::error_code status;
  if (wanted || !std::filesystem::is_regular_file(file, status)) return Done{};
  return Error{ErrorKind::invalid, file.string(), "--out", "exists, and without this decoder its marks cannot be read",
               "choose another file, or give --force to move it aside"};
}

COMPMARK_APP_INLINE Result<Done> move_decoder_aside(const std::filesystem::path& file, const SentenceSink& note) {
  std::error_code status;
  if (!std::filesystem::is_regular_file(file, status)) return Done{};
  const Result<std::string> digest = file_sha256(file);
  if (!digest) return digest.error();
  std::filesystem::path aside = file;
  aside += "." + digest->substr(0, 16) + ".old";
  if (!std::filesystem::exists(aside, status))
    std::filesystem::rename(file, aside, status);  // else that is the same file once more
  if (status)
    return Error{ErrorKind::unwritable,
                 aside.string(),
                 {},
                 "the old decoder cannot be moved there: " + status.message(),
                 "choose another --out"};
  if (note) note("the old decoder was moved to " + aside.string());
  return Done{};
}

}  // namespace compmark
