// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Damage of what is noted of a mark, mark.json and KEY.record: it is not used, and that is said; or nothing that is
// read is another.
#include "compmark/app/run/mark_record.hpp"

#include <doctest/doctest.h>

#include <compmark/io/json_file.hpp>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "support/damage.hpp"
#include "support/scene_files.hpp"

namespace {

using namespace compmark;
using testing::Reading;

bool same_record(const MarkRecord& a, const MarkRecord& b) {
  const auto file = [](const RecordedFile& f) { return f.name + "|" + f.sha256; };
  const auto text = [&](const MarkRecord& r) {
    std::string all = r.key_id + "|" + r.key_commitment + "|" + file(r.decoder) + "|" + r.decoder_tensors;
    for (const RecordedFile& model : r.models) all += "|" + file(model);
    return all;
  };
  return text(a) == text(b);
}

struct RecordFiles {
  testing::TemporaryFolder folder;
  std::filesystem::path key = folder.path() / "owner.key", record = folder.path() / "owner.key.record",
                        mark = folder.path() / "mark.json";
  MarkRecord first{"0123456789abcdef",
                   std::string(64, 'a'),
                   {"decoder.safetensors", std::string(64, 'b')},
                   std::string(64, 'c'),
                   {{"model.safetensors", std::string(64, 'd')}, {"model.cmk", std::string(64, 'e')}}};

  RecordFiles() {
    testing::put(key, "{}");
    REQUIRE(keep_record(first, key, folder.path(), {}).ok());
  }
};

TEST_CASE("app/run/mark_record: no damage of mark.json or of a record is read as another mark") {
  const RecordFiles files;
  const auto bytes = read_file(files.mark);
  REQUIRE(bytes.ok());
  const std::filesystem::path bad = files.folder.path() / "bad";
  testing::check_damage("mark.json", *bytes, 0, [&](const testing::FileBytes& damaged) {
    testing::put_raw(bad, damaged);
    const auto read = read_mark(bad);
    return !read ? Reading::refused : same_record(*read, files.first) ? Reading::same : Reading::other;
  });

  MarkRecord second = files.first;
  second.decoder_tensors = std::string(64, 'f');
  REQUIRE(keep_record(second, files.key, files.folder.path(), {}).ok());
  REQUIRE(keep_record(second, files.key, files.folder.path(), {}).ok());  // the same run once more
  const auto lines = read_file(files.record);
  REQUIRE(lines.ok());
  const std::size_t border = lines->size() / 2;
  testing::check_damage("KEY.record", *lines, 0, [&](const testing::FileBytes& damaged) {
    if (damaged.size() == border || damaged.size() + 1 == border)
      return Reading::refused;  // a whole line less: see below
    testing::put_raw(bad, damaged);
    const auto read = read_record(bad);
    if (!read) return Reading::refused;
    // Lines that are not used are told.
    for (const MarkRecord& record : read->records) {
      if (!same_record(record, files.first) && !same_record(record, second)) return Reading::other;
    }
    return read->records.size() == 2 ? Reading::same : read->unread.empty() ? Reading::other : Reading::refused;
  });
  // A record is appended to: one that ends with an earlier line is what it was then.
  testing::put_raw(bad, std::span<const std::byte>(*lines).first(border));
  CHECK(read_record(bad)->records.size() == 1);
}

TEST_CASE("app/run/mark_record: records of before have no checksum and are read; nothing protects them") {
  const RecordFiles files;
  auto json = *read_json<nlohmann::ordered_json>(files.mark);
  json.erase("checksum");
  REQUIRE(write_json(files.mark, json).ok());
  const auto read = read_mark(files.mark);
  REQUIRE(read.has_value());
  CHECK(same_record(*read, files.first));
  json["decoder"]["tensors_sha256"] = std::string(64, '9');
  REQUIRE(write_json(files.mark, json).ok());
  CHECK(!same_record(*read_mark(files.mark), files.first));
  json["decodes"] = 1;
  REQUIRE(write_json(files.mark, json).ok());
  CHECK(!read_mark(files.mark).has_value());
}

}  // namespace
