// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/transforms_fields.hpp"

#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>

#include <algorithm>
#include <fstream>
#include <map>
#include <set>
#include <string>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

std::size_t warnings_with(const Dataset& dataset, const std::string& words) {
  return static_cast<std::size_t>(std::count_if(dataset.warnings.begin(), dataset.warnings.end(),
                                                [&](const auto& w) { return w.find(words) != std::string::npos; }));
}

/// A capture of three frames with one more field, of the file or of its second frame.
class Capture {
 public:
  Capture() {
    for (const char* name : {"a", "b", "c", "d"})
      put_image(folder_.path() / "images" / (std::string(name) + ".png"), 16, 12, 3 + (name[0] == 'b'));
  }
  Result<Dataset> with(const std::string& field, bool in_frame) {
    const std::string more = "{" + field + (field.empty() ? "" : ", ");
    const std::string second = frame_text("images/b.png").substr(1);
    std::string text = transforms_text(frame_text("images/a.png") + "," + (in_frame ? more : "{") + second + "," +
                                       frame_text("images/c.png"));
    if (!in_frame) text = more + text.substr(1);
    put(folder_.path() / "transforms.json", text);
    return open_dataset(folder_.path(), {});
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace

TEST_CASE("scene/transforms_fields: every field of the table gets its treatment, in the file and in a frame") {
  Capture capture;
  const Result<Dataset> plain = capture.with("", false);
  REQUIRE(plain.ok());
  for (const TransformsField& field : transforms_fields) {
    if (field.use == FieldUse::used) continue;  // tests of their readers
    for (const bool in_frame : {false, true}) {
      const std::string name(field.name);
      CAPTURE(name);
      CAPTURE(in_frame);
      for (const char* off : {"null", "0", "false", "[]", "[0,0,0]", "\"\""}) {
        const Result<Dataset> silent = capture.with("\"" + name + "\": " + off, in_frame);
        REQUIRE(silent.ok());
        CHECK(silent->warnings == plain->warnings);
      }
      const Result<Dataset> dataset =
          capture.with("\"" + name + "\": " + (name == "n_frames" ? "2" : "[1, 2]"), in_frame);
      if (field.use == FieldUse::refused) {
        REQUIRE(!dataset.ok());
        CHECK(names(dataset.error(), "transforms.json", in_frame ? "frames[1]." + name : name,
                    std::string(field.remedy)));
        CHECK(!field.remedy.empty());
        continue;
      }
      REQUIRE(dataset.ok());
      CHECK(dataset->views.size() == 3);
      const bool warned = field.use == FieldUse::warned && name != "time";
      CHECK(warnings_with(*dataset, name + " is not used (" + std::string(field.what) + ")") == (warned ? 1 : 0));
      if (!warned) CHECK(dataset->warnings == plain->warnings);
    }
  }
}

TEST_CASE("scene/transforms_fields: unknown fields are named once; times that differ, and frames that are too many") {
  Capture capture;
  const Result<Dataset> unknown = capture.with(R"("zz": 1, "z2": {"zz": 2})", true);
  REQUIRE(unknown.ok());
  CHECK(warnings_with(*unknown, "\"z2\", \"zz\" are fields that this reader does not know, and not used") == 1);
  std::string many = "\"q0\": 1";
  for (int i = 1; i < 3000; ++i) many += ", \"q" + std::to_string(i) + "\": 1";
  const Result<Dataset> flood = capture.with(many, true);
  REQUIRE(flood.ok());
  for (const std::string& warning : flood->warnings) CHECK(warning.size() < 400);
  CHECK(warnings_with(*capture.with("\"time\": 0.5", false), "time") == 0);  // all at one time
  const std::string second =
      R"("time": 0.25, "file_path": "images/d.png", "transform_matrix": )" + matrix_text() + "}, {\"time\": 0.5";
  CHECK(warnings_with(*capture.with(second, true), "time is not used (the scene moves)") == 1);
  CHECK(warnings_with(*capture.with("\"n_frames\": 3", false), "n_frames") == 0);
  CHECK(warnings_with(*capture.with("\"n_frames\": 1", false), "n_frames is not used") == 1);
}

TEST_CASE("scene/transforms_fields: the table of the manual is the table of the reader") {
  std::ifstream manual("docs/capture_formats.md");
  REQUIRE(manual.good());
  std::map<std::string, std::string> rows;
  for (std::string line; std::getline(manual, line) && line.find("## Programs") == std::string::npos;) {
    const std::size_t end = line.find("` | ", 3);
    if (line.compare(0, 3, "| `") != 0 || end == std::string::npos) continue;
    const std::size_t begin = end + 4;
    rows[line.substr(3, end - 3)] = line.substr(begin, line.find(" |", begin) - begin);
  }
  std::set<std::string> known;
  const std::map<FieldUse, std::string> words{{FieldUse::used, "used"},
                                              {FieldUse::harmless, "not needed"},
                                              {FieldUse::warned, "warned about"},
                                              {FieldUse::refused, "refused"}};
  for (const TransformsField& field : transforms_fields) {
    CAPTURE(field.name);
    CHECK(known.insert(std::string(field.name)).second);  // once
    CHECK(rows[std::string(field.name)] == words.at(field.use));
  }
  for (const auto& entry : rows) {
    const std::string& row = entry.first;
    CAPTURE(row);
    if (row.find_first_of("./*` ") == std::string::npos && row != "database" && row != "rigs")
      CHECK((known.count(row) == 1 || row.find("images") == 0 || row.find("masks") == 0 || row.find("depths") == 0));
  }
}

TEST_CASE("scene/transforms: a matrix by columns, or with another last row, is refused by name") {
  Capture capture;
  const auto with_matrix = [&](const std::string& matrix) {
    return capture.with("\"file_path\": \"images/d.png\", \"transform_matrix\": " + matrix + "}, {\"name\": 1", true);
  };
  const Result<Dataset> columns = with_matrix("[[1,0,0,0],[0,0,1,0],[0,-1,0,0],[1,2,3,1]]");
  REQUIRE(!columns.ok());
  CHECK(names(columns.error(), "transforms.json", "frames[1].transform_matrix", "by rows"));
  CHECK(columns.error().problem.find("by columns") != std::string::npos);
  for (const char* last : {"[0,0,0,2]", "[0,0,0,0]", "[0,0.5,0,1]", "[1,0,0,0]"}) {
    CAPTURE(last);
    const Result<Dataset> bad = with_matrix(std::string("[[1,0,0,4],[0,1,0,2],[0,0,1,3],") + last + "]");
    REQUIRE(!bad.ok());
    CHECK(names(bad.error(), "transforms.json", "frames[1].transform_matrix", "0 0 0 1"));
  }
  CHECK(with_matrix("[[1,0,0,4],[0,1,0,2],[0,0,1,3],[0,1e-9,0,1.0000001]]").ok());
  CHECK(with_matrix("[[1,0,0,4],[0,1,0,2],[0,0,1,3]]").ok());
  CHECK(!with_matrix("[[1,0,0],[0,1,0],[0,0,1]]").ok());
  const Result<Dataset> sheared = with_matrix("[[1,0.2,0,4],[0,1,0,2],[0,0,1,3],[0,0,0,1]]");
  REQUIRE(sheared.ok());
  CHECK(warnings_with(*sheared, "transform_matrix") == 1);
}
