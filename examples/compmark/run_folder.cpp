// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "run_folder.hpp"

#include <compmark/app/run/mark_record.hpp>
#include <compmark/io/atomic_file.hpp>
#include <utility>

#include "input_files.hpp"

namespace tool {

using namespace compmark;

namespace {

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

}  // namespace

Result<std::vector<std::shared_ptr<const void>>> take_files(const FileUse& use) {
  for (const auto check : {check_file_use, check_output_kinds, check_input_kinds}) {
    if (const Result<Done> right = check(use); !right) return right.error();
  }
  return hold_outputs(use);
}

void add_record_read(FileUse& use, const std::filesystem::path& key, const std::filesystem::path& model) {
  use.read(key_record(key), "--key (its record)");
  if (!model.empty()) use.read(model.parent_path() / "mark.json", "--model (the record of its mark)");
}
void add_record_written(FileUse& use, const std::filesystem::path& key) {
  use.write(key_record(key), "--key (its record)");
}

}  // namespace tool
