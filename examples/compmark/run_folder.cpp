// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "run_folder.hpp"

#include <compmark/app/files.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/folder_lock.hpp>
#include <cstdio>
#include <string>
#include <system_error>
#include <utility>

#include "common.hpp"

namespace tool {

using namespace compmark;
namespace fs = std::filesystem;

Result<std::shared_ptr<const void>> hold_folder(const fs::path& folder) {
  if (Result<Done> made = make_folder(folder); !made) return made.error();
  Result<FolderLock> lock = FolderLock::acquire(folder);
  if (!lock) return lock.error();
  return std::shared_ptr<const void>(std::make_shared<FolderLock>(std::move(*lock)));
}

Result<std::shared_ptr<const void>> hold_file(const fs::path& file) {
  Result<FolderLock> lock = FolderLock::beside(file);
  if (!lock) return lock.error();
  return std::shared_ptr<const void>(std::make_shared<FolderLock>(std::move(*lock)));
}

Result<std::vector<std::shared_ptr<const void>>> hold_outputs(const FileUse& use) {
  std::vector<std::shared_ptr<const void>> all;
  for (const UsedFile& file : use.writes) {
    if (file.written != OutputKind::model && file.written != OutputKind::compressed &&
        file.written != OutputKind::splats)
      continue;
    if (Result<Done> possible = check_writable(file.path); !possible) return possible.error();
    Result<std::shared_ptr<const void>> held = hold_file(file.path);
    if (!held) return held.error();
    all.push_back(std::move(*held));
  }
  return all;
}

Result<Done> check_unfinished(const fs::path& folder, bool wanted) {
  std::error_code status;
  if (wanted || !fs::exists(folder / "results.json", status)) return Done{};
  return Error{ErrorKind::invalid, folder.string(), "--out", "holds a finished run (results.json)",
               "choose another folder, or give --force to replace it"};
}

Result<Done> check_no_decoder(const fs::path& file, bool wanted) {
  std::error_code status;
  if (wanted || !fs::is_regular_file(file, status)) return Done{};
  return Error{ErrorKind::invalid, file.string(), "--out", "exists, and without this decoder its marks cannot be read",
               "choose another file, or give --force to move it aside"};
}

Result<Done> move_decoder_aside(const fs::path& file) {
  std::error_code status;
  if (!fs::is_regular_file(file, status)) return Done{};
  const Result<std::string> digest = file_sha256(file);
  if (!digest) return digest.error();
  fs::path aside = file;
  aside += "." + digest->substr(0, 16) + ".old";
  if (!fs::exists(aside, status)) fs::rename(file, aside, status);  // else that is the same file once more
  if (status)
    return Error{ErrorKind::unwritable,
                 aside.string(),
                 {},
                 "the old decoder cannot be moved there: " + status.message(),
                 "choose another --out"};
  std::fprintf(stderr, "compmark: the old decoder was moved to %s\n", aside.string().c_str());
  return Done{};
}

}  // namespace tool
