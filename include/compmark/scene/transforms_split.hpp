// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The training and test frames of a transforms.json that defines them itself. Frames in none of the lists that are
// used, or in two of them, give a warning. Cost: O(frames log frames).
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/image_lookup.hpp"

namespace compmark {
namespace detail {

/// The splits of nerfstudio: train_filenames, val_filenames, test_filenames. False if the file has none.
template <class Json>
[[nodiscard]] Result<bool> split_by_lists(const std::filesystem::path& file, const Json& json, Dataset& dataset) {
  constexpr std::array<const char*, 3> keys{"train_filenames", "val_filenames", "test_filenames"};
  std::array<bool, 3> there{};
  for (std::size_t k = 0; k < 3; ++k) there[k] = json.contains(keys[k]);
  if (!there[0] && !there[1] && !there[2]) return false;
  const auto fail = [&](const char* field, std::string problem, std::string remedy) {
    return Error{ErrorKind::invalid, file.string(), field, std::move(problem), std::move(remedy)};
  };
  if (!there[0])
    return fail(keys[0], "is missing, although there is a list of other images", "list the training images");
  std::map<std::string, std::size_t> known;  // every frame of the file, whether its image is there or not
  for (const Json& frame : json["frames"]) known[plain_name(frame["file_path"].template get<std::string>())] = 3;
  std::size_t twice = 0, unlisted = 0;
  std::string first_twice, first_unlisted;
  for (std::size_t k = 0; k < 3; ++k) {
    if (!there[k]) continue;
    if (!json[keys[k]].is_array()) return fail(keys[k], "is not a list of names", "list the images' file_path");
    for (const Json& entry : json[keys[k]]) {
      const auto found = entry.is_string() ? known.find(plain_name(entry.template get<std::string>())) : known.end();
      if (found == known.end())
        return fail(keys[k],
                    "names " + entry.dump(-1, ' ', false, Json::error_handler_t::replace) +
                        ", which is the file_path of no frame",
                    "correct the list");
      if (found->second == 3) {
        found->second = k;
      } else if (found->second != k && twice++ == 0) {
        first_twice = found->first;
      }
    }
  }
  // Test images are the test list, or the validation list where there is no other; the rest is left out.
  const std::size_t test = there[2] ? 2 : 1;
  std::vector<View> kept;
  for (View& view : dataset.views) {
    const std::size_t list = known[plain_name(view.name)];
    if (list != 0 && list != test) {
      if (unlisted++ == 0) first_unlisted = view.name;
      continue;
    }
    view.split = list == 0 ? Split::train : Split::test;
    kept.push_back(std::move(view));
  }
  dataset.views = std::move(kept);
  const auto say = [&](const std::string& sentence) { dataset.warnings.push_back(file.string() + ": " + sentence); };
  if (unlisted > 0) {
    say(std::to_string(unlisted) + " images are in neither train_filenames nor " + keys[test] +
        " and are left out, the first is \"" + first_unlisted + "\"");
  }
  if (twice > 0) {
    say(std::to_string(twice) + " images are in two lists, of which the first of " + keys[0] + ", " + keys[1] + ", " +
        keys[2] + " counts, the first is \"" + first_twice + "\"");
  }
  if (dataset.indices(Split::train).empty())
    return fail(keys[0], "lists no image that is there", "list the training images");
  return true;
}

}  // namespace detail
}  // namespace compmark
