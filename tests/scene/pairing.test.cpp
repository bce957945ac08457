// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/pairing.hpp"

#include <doctest/doctest.h>
#include <compmark/core/random.hpp>

#include <algorithm>
#include <chrono>
#include <numeric>
#include <set>
#include <string>
#include <vector>

using namespace compmark;

namespace {

using Names = std::vector<std::string>;

/// "name>file" of every name, "-" for none.
std::string pairs(const Names& names, const Names& files, bool by_order = false) {
  const Pairing pairing = pair_names(names, files, {by_order});
  std::string text;
  for (const std::size_t file : pairing.file) text += (text.empty() ? "" : " ") + (file == no_file ? "-" : files[file]);
  for (std::size_t k = 0; k < pairing.undecided.size(); ++k) text += k == 0 ? " ?" : "?";
  return text + (pairing.by_order ? " by order" : "");
}

/// A stream of choices.
class Choices {
 public:
  explicit Choices(std::uint64_t seed) : random_(seed, 0, random_stage("pairing test")) {}
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(random_.below(next_++, n)); }
  bool one_in(std::size_t n) { return below(n) == 0; }
  template <class List>
  auto of(const List& list) {
    return list[below(std::size(list))];
  }

 private:
  Random random_;
  std::uint64_t next_ = 0;
};

struct Renaming {
  Names names, files;
  std::vector<std::size_t> right;  ///< file of each name; no_file: it is missing
  bool folders_kept = true;        ///< in the names
};

std::string number(std::size_t i, std::size_t digits) {
  std::string text = std::to_string(i);
  return std::string(text.size() < digits ? digits - text.size() : 0, '0') + text;
}

/// A capture in one to four folders with stems that may be in several of them, and its names as another machine wrote
/// them.
Renaming renamed_capture(std::uint64_t seed) {
  Choices any(seed);
  static const Names all_folders{"",          "cam0",     "cam1",  "cam10",     "left/raw",
                                 "right/raw", "DCIM/100", "Été 1", "day two/x", "images/sub"};
  static const Names prefixes{"images/", "C:\\scan\\Images\\", "/srv/scans/7/",       "https://host.example/p/1/",
                              "./",      "../input/",          "\\\\server\\share\\", "file:///D:/photos/"};
  Names folders;
  for (std::size_t k = 1 + any.below(4); k > 0; --k) folders.push_back(any.of(all_folders));
  const Names stems{"IMG_", "photo ", "", "frame.", "Łódź ", "é"};
  const std::string stem = any.of(stems), extension = any.of(Names{".png", ".jpg", ".JPG"});
  const std::size_t digits = 1 + any.below(4), count = 3 + any.below(10);
  const bool shared = !any.one_in(3);  // the same stems in every folder
  std::set<std::string> known;         // of files: "folder/stem", in small letters
  struct Photograph {
    std::string folder, stem;
  };
  std::vector<Photograph> capture;
  for (std::size_t i = 0; i < count; ++i) {
    const Photograph one{any.of(folders), stem + number(shared ? any.below(4) : i, digits)};
    if (known.insert(one.folder + "/" + one.stem).second) capture.push_back(one);
  }
  Renaming r;
  const auto join = [](const std::string& folder, const std::string& name) {
    return folder.empty() ? name : folder + "/" + name;
  };
  const std::size_t missing = any.below(capture.size());
  r.folders_kept = !any.one_in(6);
  // Without their folders nobody can tell the missing one of two names "1" from the other.
  const bool one_missing = any.one_in(2) && capture.size() > 2 && (r.folders_kept || !shared);
  const bool backslashes = any.one_in(3), mixed = any.one_in(4) && (r.folders_kept || !shared);
  const std::string new_extension = any.of(Names{extension, ".png", ".JPEG", ".tif", ""});
  const std::size_t capitals = any.below(3);
  std::string prefix = any.one_in(3) ? "" : any.of(prefixes);
  for (std::size_t i = 0; i < capture.size(); ++i) {
    if (mixed) prefix = any.one_in(2) ? "" : any.of(prefixes);
    std::string name =
        prefix + (r.folders_kept ? join(capture[i].folder, capture[i].stem) : capture[i].stem) + new_extension;
    if (backslashes) std::replace(name.begin(), name.end(), '/', '\\');
    for (char& c : name) {
      if (capitals == 1 && c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
      if (capitals == 2 && c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    }
    r.names.push_back(name);
    r.right.push_back(one_missing && i == missing ? no_file : r.files.size());
    if (r.right.back() != no_file) r.files.push_back(join(capture[i].folder, capture[i].stem + extension));
  }
  if (any.one_in(
          2)) {  // one too many: another number, or the number of another photograph in a folder that does not have it
    Photograph one{any.of(all_folders), stem + number(50, digits)};
    if (r.folders_kept && any.one_in(2)) one.stem = capture[any.below(capture.size())].stem;
    if (known.insert(one.folder + "/" + one.stem).second) r.files.push_back(join(one.folder, one.stem + extension));
  }
  // Files have the order of a listing.
  std::vector<std::size_t> order(r.files.size()), place(r.files.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return r.files[a] < r.files[b]; });
  Names sorted;
  for (std::size_t i = 0; i < order.size(); ++i) {
    place[order[i]] = i;
    sorted.push_back(r.files[order[i]]);
  }
  r.files = sorted;
  for (std::size_t& file : r.right) file = file == no_file ? no_file : place[file];
  return r;
}

/// What was done before: exact names, or by order where there is none and the counts agree.
std::vector<std::size_t> paired_by_order(const Renaming& r) {
  std::vector<std::size_t> result;
  for (const std::string& name : r.names) {
    const auto found = std::find(r.files.begin(), r.files.end(), name);
    result.push_back(found == r.files.end() ? no_file : static_cast<std::size_t>(found - r.files.begin()));
  }
  if (std::all_of(result.begin(), result.end(), [](std::size_t f) { return f == no_file; }) &&
      r.names.size() == r.files.size())
    std::iota(result.begin(), result.end(), std::size_t{0});
  return result;
}

}  // namespace

TEST_CASE("scene/pairing: 10,000 renamings of a capture are never paired wrongly; pairing by order is") {
  std::size_t wrong = 0, left = 0, there = 0, wrong_by_order = 0, twice = 0;
  for (std::uint64_t seed = 0; seed < 10000; ++seed) {
    const Renaming r = renamed_capture(seed);
    const Pairing pairing = pair_names(r.names, r.files);
    REQUIRE(pairing.file.size() == r.names.size());
    std::set<std::size_t> taken;
    for (std::size_t i = 0; i < r.names.size(); ++i) {
      if (pairing.file[i] == no_file) {
        there += r.folders_kept && r.right[i] != no_file;
        left += r.folders_kept && r.right[i] != no_file;
        continue;
      }
      there += r.folders_kept;
      twice += !taken.insert(pairing.file[i]).second;
      if (pairing.file[i] != r.right[i] && wrong++ < 3)
        MESSAGE("wrong: ", seed, " ", r.names[i], " was given ", r.files[pairing.file[i]]);
    }
    const std::vector<std::size_t> before = paired_by_order(r);
    for (std::size_t i = 0; i < before.size(); ++i) wrong_by_order += before[i] != no_file && before[i] != r.right[i];
  }
  CAPTURE(there);
  CAPTURE(left);
  CHECK(wrong == 0);
  CHECK(twice == 0);
  CHECK(wrong_by_order > 1000);
  CHECK(left * 50 < there);  // a refusal of everything would never be wrong either
}

TEST_CASE("scene/pairing: the longest end of the path, then the stem") {
  CHECK(pairs({"images/a.png", "images/b.png"}, {"a.png", "b.png", "c.png"}) == "a.png b.png");
  CHECK(pairs({"C:\\x\\a.JPG", "C:\\x\\b.JPG"}, {"b.png", "a.png"}) == "a.png b.png");
  CHECK(pairs({"cam0\\1.png", "cam1\\1.png"}, {"cam0/1.jpg", "cam1/1.jpg"}) == "cam0/1.jpg cam1/1.jpg");
  CHECK(pairs({"a.png"}, {"sub/a.png"}) == "sub/a.png");
  CHECK(pairs({"a.png"}, {"x/a.png", "y/a.jpg"}) == "x/a.png");  // the same extension
  CHECK(pairs({"a.tif"}, {"x/a.png", "y/a.jpg"}) == "- ?");
  CHECK(pairs({"a"}, {"A.png", "a.png"}) == "a.png");  // the same letters
  CHECK(pairs({"a.png", "A.png"}, {"a.png"}) == "a.png -");
  CHECK(pairs({"DCIM/1.jpg", "DCIM/2.jpg"}, {"photos/1.jpg", "photos/2.jpg"}) == "photos/1.jpg photos/2.jpg");
  CHECK(pairs({"http://h/a%20b.png?size=2"}, {"a b.png"}) == "a b.png");
  CHECK(pairs({"", "..", "/"}, {"a.png"}) == "- - -");
  CHECK(pairs({"a.jpg", "b.jpg"}, {"a.jpg.png", "c.jpg.png"}) == "a.jpg.png -");  // a program that appends
  CHECK(pairs({"x/a.png"}, {"a.png", "a.jpg.png"}) == "a.png");
}

TEST_CASE("scene/pairing: a missing file is not replaced by one of the same stem elsewhere") {
  CHECK(pairs({"cam0/1", "cam0/2", "cam1/1", "cam1/2"}, {"cam0/1.png", "cam1/1.png", "cam1/2.png", "cam2/2.png"}) ==
        "cam0/1.png - cam1/1.png cam1/2.png");
  CHECK(pairs({"1.png", "2.png"}, {"1.png", "thumbs/2.png"}) == "1.png -");
  CHECK(pairs({"a/1.png", "b/2.png"}, {"2.png", "a/1.png"}) == "a/1.png -");
  CHECK(pairs({"train/1", "test/9"}, {"train/1.png", "val/9.png"}) == "train/1.png -");
  // Two names for one file: neither has it, unless one of them is nearer.
  CHECK(pairs({"cam0/1.png", "cam1/1.png"}, {"1.png"}) == "- - ??");
  CHECK(pairs({"x/a.png", "y/x/a.png"}, {"y/x/a.png"}) == "- y/x/a.png");
}

TEST_CASE("scene/pairing: order counts only where no stem agrees, and where nothing speaks against it") {
  CHECK(pairs({"p", "q"}, {"1.png", "2.png"}) == "- -");  // not asked for
  CHECK(pairs({"p", "q"}, {"1.png", "2.png"}, true) == "1.png 2.png by order");
  CHECK(pairs({"p", "q"}, {"1.png", "2.png", "3.png"}, true) == "- -");
  CHECK(pairs({"p", "1"}, {"1.png", "2.png"}, true) == "- 1.png");
  // By text 1, 10, 2; by number 1, 2, 10.
  CHECK(pairs({"f01", "f02", "f10"}, {"1.png", "10.png", "2.png"}, true) == "- - -");
  // f0 is missing, 9 is one too many: three of four numbers agree elsewhere.
  CHECK(pairs({"f0", "f1", "f2", "f3"}, {"1.png", "2.png", "3.png", "9.png"}, true) == "- - - -");
  CHECK(pairs({"f1", "f2", "f3"}, {"0.png", "1.png", "2.png"}, true) ==
        "0.png 1.png 2.png by order");                                             // counted from 0
  CHECK(pairs({"f3", "f4", "f5"}, {"4.png", "5.png", "6.png"}, true) == "- - -");  // 3 is missing, or all are renamed
  CHECK(pairs({"f400", "f401"}, {"0.png", "1.png"}, true) == "0.png 1.png by order");
  // What is before and after the numbers, or in their place, says the same.
  CHECK(pairs({"f0_x", "f1_x", "f2_x"}, {"0.png", "1.png", "2.png"}, true) == "0.png 1.png 2.png by order");
  CHECK(pairs({"f0_x", "f1_x", "f2_x"}, {"0.png", "2.png", "3.png"}, true) == "- - -");
  CHECK(pairs({"f_a", "f_b", "f_c"}, {"g_a.png", "g_b.png", "g_c.png"}, true) == "g_a.png g_b.png g_c.png by order");
  CHECK(pairs({"f_a", "f_b", "f_c"}, {"g_a.png", "g_c.png", "g_d.png"}, true) == "- - -");
}

TEST_CASE("scene/pairing: the time of many names grows with their number, not with its square") {
  const auto seconds = [](std::size_t n) {
    Names names, files;
    for (std::size_t i = 0; i < n; ++i) {
      names.push_back("C:\\in\\cam" + std::to_string(i) + "\\000.jpg");
      files.push_back("cam" + std::to_string(i) + "/000.png");
    }
    const auto begin = std::chrono::steady_clock::now();
    const Pairing pairing = pair_names(names, files);
    CHECK(std::count(pairing.file.begin(), pairing.file.end(), no_file) == 0);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const double small = seconds(2000);
  CHECK(seconds(32000) < 100 * small + 0.2);  // 16 times as many: 16 to 25 times the time, not 256
}
