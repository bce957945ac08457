// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which file is meant by which name. The one place where this is decided, for photographs of every kind of capture and
// for their masks.
//
// A name means the file with which it shares the longest end of its path: first the stem, then folder by folder,
// whatever the capitals, the extension, the slashes and the drive (scene/path_key.hpp). Of files with equally long ends
// the one whose path is nothing but that end comes first, then the same extension, then the same letters. What is left
// undecided after that is given to nobody:
//   - a name for which two files are equally good, and names for which one file is equally good;
//   - a name whose neighbours in its folder were found better than it is (in their folder, say): its file is missing,
//     and a file of the same stem
//     elsewhere is another one (the other camera's, a thumbnail);
//   - the same for a folder of names whose neighbours were found in their folders while it was not;
//   - a name of which a part and a file of which a part do not agree (a/b/1 and a/c/1), if any other name was found
//     without; and where they share
//     no more than the stem, if another name or another file has that stem.
// Only where not one stem agrees, and there are as many files as names, the i-th name may mean the i-th file
// (PairingSettings::by_order): if the order by text and the order by number say the same, and the numbers in the names
// do not contradict it. Cost: O((n + m) log(n + m)) comparisons.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "compmark/scene/path_key.hpp"

namespace compmark {

inline constexpr std::size_t no_file = static_cast<std::size_t>(-1);

struct Pairing {
  std::vector<std::size_t> file;       ///< of each name; no_file: none
  std::vector<std::size_t> undecided;  ///< names that have a file among them, but which one cannot be known
  bool by_order = false;               ///< not one stem agreed, and the i-th name means the i-th file
};

struct PairingSettings {
  bool by_order = false;  ///< names and files are sorted, and may be paired by order where nothing else is left
};

namespace detail {

/// How well a file fits a name; larger is better, in this order.
struct Fit {
  std::size_t depth = 0;  ///< parts of the two paths that agree, from the end
  int whole = 0;          ///< 3: both paths are that end, 2: the file's is, 1: the name's is, 0: neither
  bool extension = false, letters = false, written = false;

  [[nodiscard]] auto key() const { return std::tuple(depth, whole, extension, letters, written); }
};

/// The names against the sorted files.
class NamePairs {
 public:
  NamePairs(const std::vector<std::string>& names, const std::vector<std::string>& files) {
    for (const std::string& name : names) names_.push_back(path_key(name));
    for (const std::string& file : files) files_.push_back(path_key(file));
    for (const PathKey& key : names_) ++named_[stem(key)];
    for (std::size_t i = 0; i < files_.size(); ++i) {
      ++filed_[stem(files_[i])];
      if (!files_[i].parts.empty()) order_.push_back(i);
    }
    std::sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
      return std::tie(files_[a].parts, files_[a].written) < std::tie(files_[b].parts, files_[b].written);
    });
  }

  [[nodiscard]] Pairing pair(const PairingSettings& settings) {
    Pairing result;
    result.file.assign(names_.size(), no_file);
    best_.assign(names_.size(), {no_file, {}});
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (!look(i)) result.undecided.push_back(i);
    }
    // One file, one name: the name that fits it best; where two fit alike, none.
    std::map<std::size_t, std::vector<std::size_t>> claims;
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (best_[i].first != no_file) claims[best_[i].first].push_back(i);
    }
    for (const auto& [file, claimants] : claims) {
      const auto better = [&](std::size_t a, std::size_t b) { return best_[a].second.key() > best_[b].second.key(); };
      const std::size_t winner = *std::min_element(claimants.begin(), claimants.end(), better);
      const auto equal = static_cast<std::size_t>(std::count_if(
          claimants.begin(), claimants.end(), [&](std::size_t i) { return !better(winner, i) && !better(i, winner); }));
      for (const std::size_t i : claimants) {
        if (equal > 1 && !better(winner, i)) result.undecided.push_back(i);
        if (equal > 1 || i != winner) best_[i].first = no_file;
      }
    }
    drop_strangers();
    for (std::size_t i = 0; i < names_.size(); ++i) result.file[i] = best_[i].first;
    std::sort(result.undecided.begin(), result.undecided.end());
    const bool strangers =
        std::none_of(names_.begin(), names_.end(), [&](const PathKey& key) { return filed_.count(stem(key)) > 0; });
    if (settings.by_order && strangers && names_.size() == files_.size() && order_is_certain()) {
      for (std::size_t i = 0; i < names_.size(); ++i) result.file[i] = i;
      result.by_order = true;
    }
    return result;
  }

 private:
  using Folder = std::vector<std::string>;  // of a name, innermost first

  [[nodiscard]] static std::string stem(const PathKey& key) { return key.parts.empty() ? std::string() : key.parts[0]; }
  [[nodiscard]] static Folder folder(const PathKey& key) { return {key.parts.begin() + 1, key.parts.end()}; }
  [[nodiscard]] bool one_stem(const PathKey& key) const {
    return named_.at(stem(key)) == 1 && filed_.at(stem(key)) == 1;
  }

  /// Finds the best file of a name; false if two are equally good.
  [[nodiscard]] bool look(std::size_t name) {
    const PathKey& key = names_[name];
    if (key.parts.empty()) return true;
    const auto common = [&](std::size_t file) {
      const std::vector<std::string>& parts = files_[file].parts;
      const auto ends = std::mismatch(parts.begin(), parts.end(), key.parts.begin(), key.parts.end());
      return static_cast<std::size_t>(ends.first - parts.begin());
    };
    const auto place =
        std::lower_bound(order_.begin(), order_.end(), key.parts,
                         [&](std::size_t file, const auto& parts) { return files_[file].parts < parts; });
    Fit fit;
    if (place != order_.end()) fit.depth = common(*place);
    if (place != order_.begin()) fit.depth = std::max(fit.depth, common(*std::prev(place)));
    if (fit.depth == 0) return true;
    const auto length = static_cast<std::ptrdiff_t>(fit.depth);
    const auto end_less = [&](const std::vector<std::string>& a, const std::vector<std::string>& b) {
      return std::lexicographical_compare(a.begin(), a.begin() + std::min<std::ptrdiff_t>(length, std::ssize(a)),
                                          b.begin(), b.begin() + std::min<std::ptrdiff_t>(length, std::ssize(b)));
    };
    const auto first = std::lower_bound(order_.begin(), order_.end(), key.parts, [&](std::size_t f, const auto& parts) {
      return end_less(files_[f].parts, parts);
    });
    const auto last = std::upper_bound(first, order_.end(), key.parts, [&](const auto& parts, std::size_t f) {
      return end_less(parts, files_[f].parts);
    });
    // Files that are nothing but the common end are the first of them.
    auto whole = first;
    while (whole != last && files_[*whole].parts.size() == fit.depth && whole - first <= most_) ++whole;
    const bool file_ends = whole != first, name_ends = key.parts.size() == fit.depth;
    fit.whole = (file_ends ? 2 : 0) + (name_ends ? 1 : 0);
    std::vector<std::size_t> candidates(first, file_ends ? whole : last - first > most_ ? first + most_ : last);
    const auto keep = [&](const auto& good) {
      if (std::none_of(candidates.begin(), candidates.end(), good)) return false;
      std::erase_if(candidates, [&](std::size_t file) { return !good(file); });
      return true;
    };
    if (fit.depth == 1 && fit.whole == 0 && !one_stem(key)) return true;
    if (candidates.size() >= static_cast<std::size_t>(most_)) return false;
    fit.extension = keep([&](std::size_t file) { return files_[file].extension == key.extension; });
    const auto bare = [](const std::string& path) { return path.substr(0, extension_place(path)); };
    fit.letters = keep([&](std::size_t file) { return same_letters(bare(files_[file].written), bare(key.written)); });
    fit.written = keep([&](std::size_t file) { return same_letters(files_[file].written, key.written); });
    if (candidates.size() != 1) return false;
    best_[name] = {candidates[0], fit};
    return true;
  }

  /// True if one of the two is the end of the other, letter by letter.
  [[nodiscard]] static bool same_letters(const std::string& a, const std::string& b) {
    const std::size_t n = std::min(a.size(), b.size());
    return a.compare(a.size() - n, n, b, b.size() - n, n) == 0;
  }

  /// Removes pairs that exist only because the right file is missing.
  void drop_strangers() {
    std::map<Folder, std::pair<std::size_t, int>> best;  // of the names of one folder
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (best_[i].first == no_file) continue;
      auto& found = best[folder(names_[i])];
      found = std::max(found, {best_[i].second.depth, best_[i].second.whole});
    }
    std::set<Folder> bases;  // what is above the folders that were found by their names
    for (const auto& [path, found] : best) {
      if (found.first > 1) bases.insert({path.begin() + static_cast<std::ptrdiff_t>(found.first - 1), path.end()});
    }
    const auto below_a_base = [&](const Folder& path) {
      for (std::size_t k = 1; k <= path.size(); ++k) {
        if (bases.count({path.begin() + static_cast<std::ptrdiff_t>(k), path.end()}) > 0) return true;
      }
      return false;
    };
    const bool ends = std::any_of(best_.begin(), best_.end(),
                                  [](const auto& found) { return found.first != no_file && found.second.whole > 0; });
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (best_[i].first == no_file) continue;
      const Folder path = folder(names_[i]);
      const Fit& fit = best_[i].second;
      const bool worse = std::pair(fit.depth, fit.whole) < best[path];
      const bool lost = fit.depth == 1 && below_a_base(path);
      if (worse || lost || (ends && fit.whole == 0)) best_[i].first = no_file;
    }
  }

  /// The number that a text ends in.
  [[nodiscard]] static std::optional<std::int64_t> last_number(const std::string& text) {
    const std::size_t begin = text.find_last_not_of("0123456789") + 1;  // npos + 1 is 0
    if (begin == text.size() || text.size() - begin > 17) return std::nullopt;
    return std::stoll(text.substr(begin));
  }

  /// The stems without what begins and what ends all of them, so far as that is no part of a number: "07" of
  /// v07_undistorted.
  [[nodiscard]] static std::vector<std::string> cores(const std::vector<PathKey>& keys) {
    const std::string first = stem(keys[0]);
    std::size_t begin = first.size(), end = first.size();
    for (const PathKey& key : keys) {
      const std::string text = stem(key);
      const auto common = [&](auto from, auto to, auto with, auto with_to) {
        return static_cast<std::size_t>(std::mismatch(from, to, with, with_to).first - from);
      };
      begin = std::min(begin, common(first.begin(), first.end(), text.begin(), text.end()));
      end = std::min(end, common(first.rbegin(), first.rend(), text.rbegin(), text.rend()));
    }
    const auto digit = [&](std::size_t i) { return first[i] >= '0' && first[i] <= '9'; };
    while (begin > 0 && digit(begin - 1)) --begin;
    while (end > 0 && digit(first.size() - end)) --end;
    std::vector<std::string> result;
    for (const PathKey& key : keys) {
      const std::string text = stem(key);
      result.push_back(text.substr(begin, text.size() - std::min(text.size(), begin + end)));
    }
    return result;
  }

  [[nodiscard]] bool order_is_certain() const {
    const auto by_number = [](const std::vector<PathKey>& keys) {
      std::vector<std::size_t> order(keys.size());
      for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
      std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        if (stem(keys[a]) != stem(keys[b])) return natural_less(stem(keys[a]), stem(keys[b]));
        return a < b;
      });
      return order;
    };
    if (names_.empty()) return true;
    if (by_number(names_) != by_number(files_)) return false;
    // What agrees elsewhere and not in the pairs: something is missing and something else too many.
    const std::vector<std::string> a = cores(names_), b = cores(files_);
    const auto numbered = [](const std::string& core) { return last_number(core).has_value(); };
    const bool numbers = std::all_of(a.begin(), a.end(), numbered) && std::all_of(b.begin(), b.end(), numbered);
    const auto value = [&](const std::string& core) { return numbers ? std::to_string(*last_number(core)) : core; };
    std::set<std::string> there;
    std::set<std::int64_t> named, filed, shifts;
    std::size_t equal = 0, elsewhere = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      there.insert(value(b[i]));
      equal += value(a[i]) == value(b[i]);
      if (!numbers) continue;
      named.insert(*last_number(a[i]));
      filed.insert(*last_number(b[i]));
      shifts.insert(*last_number(b[i]) - *last_number(a[i]));
    }
    for (const std::string& core : a) elsewhere += there.count(value(core));
    // All numbers of one side larger by one: counted from 1 and from 0.
    return equal >= elsewhere || (numbers && shifts.size() == 1 && *named.begin() + *filed.begin() == 1);
  }

  static constexpr std::ptrdiff_t most_ = 64;  // candidates that are looked at: more are undecided
  std::vector<PathKey> names_, files_;
  std::vector<std::size_t> order_;
  std::map<std::string, std::size_t> named_, filed_;  // how often each stem is there
  std::vector<std::pair<std::size_t, Fit>> best_;     // of each name
};

}  // namespace detail

/// The file of each name, by the rules at the top of this header. Paths may be relative to different folders.
[[nodiscard]] inline Pairing pair_names(const std::vector<std::string>& names, const std::vector<std::string>& files,
                                        const PairingSettings& settings = {}) {
  return detail::NamePairs(names, files).pair(settings);
}

}  // namespace compmark
