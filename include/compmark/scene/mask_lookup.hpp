// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Finds masks by the names of the images, for views whose file of cameras names none. A mask that could belong to
// several images (masks/r_0.png beside train/r_0.png and test/r_0.png) is given to none: a wrong guess would hide parts
// of the wrong photograph. Masks with other names (a_mask.png for a.jpg) are found by scene/pairing.hpp. Masks that
// belong to no image are reported.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "compmark/scene/dataset.hpp"
#include "compmark/scene/image_folder.hpp"
#include "compmark/scene/image_lookup.hpp"
#include "compmark/scene/pairing.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {
namespace detail {

/// The mask of the image `root`/<folder>/<rest>: masks/<folder>/<rest>, then masks/<rest>, with the image's name and
/// ".png", its stem and ".png", or its name. A folder like images_4 looks into masks_4 before masks. Empty if there is
/// none.
[[nodiscard]] inline std::filesystem::path find_mask(const std::filesystem::path& root,
                                                     const std::filesystem::path& image) {
  std::vector<std::filesystem::path> parts;
  for (const std::filesystem::path& part : image.lexically_normal().lexically_relative(root.lexically_normal())) {
    if (part != ".." && part != ".") parts.push_back(part);  // an image outside of the folder: by what follows
  }
  if (parts.empty()) return {};
  const auto join = [&](std::filesystem::path path, std::size_t from) {
    for (std::size_t i = from; i < parts.size(); ++i) path /= parts[i];
    return path;
  };
  std::vector<std::filesystem::path> places;
  if (folder_exists(root / "masks")) places.push_back(join(root / "masks", 0));
  if (parts.size() > 1) {
    const std::string first = parts[0].string();
    const std::size_t underscore = first.rfind('_');
    if (underscore != std::string::npos && folder_exists(root / ("masks" + first.substr(underscore))))
      places.push_back(join(root / ("masks" + first.substr(underscore)), 1));
    if (folder_exists(root / "masks")) places.push_back(join(root / "masks", 1));
  }
  for (const std::filesystem::path& base : places) {
    std::filesystem::path appended = base, replaced = base;
    appended += ".png";
    replaced.replace_extension(".png");
    for (const std::filesystem::path& candidate : {appended, replaced, base}) {
      if (std::filesystem::path found = find_image_file(candidate); !found.empty()) return found;
    }
    for (std::filesystem::path other : other_capitals(base)) {  // a.jpg.png for a.JPG
      other += ".png";
      if (file_exists(other)) return other;
    }
  }
  return {};
}

/// The name of a mask without what tells that it is one: "a" for "a_mask.png", "mask-a.png" and "a.jpg.png".
[[nodiscard]] inline std::string without_mask_affix(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  const std::string folder = path.substr(0, slash == std::string::npos ? 0 : slash + 1);
  std::string name = path.substr(folder.size());
  for (int k = 0; k < 2; ++k) name.erase(extension_place(name));
  const std::string small = folded(name);
  for (const std::string_view word : {"mask", "segmentation", "matte", "alpha"}) {
    for (const char mark : {'_', '-', '.', ' '}) {
      const std::string end = mark + std::string(word), begin = std::string(word) + mark;
      if (small.size() != name.size() || small.size() <= end.size()) continue;
      if (small.compare(small.size() - end.size(), end.size(), end) == 0)
        return folder + name.substr(0, name.size() - end.size());
      if (small.compare(0, begin.size(), begin) == 0) return folder + name.substr(begin.size());
    }
  }
  return folder + name;
}

/// The folders of masks at most two folders below `root`: masks, Masks, mask, masks_4, images/masks …
[[nodiscard]] inline std::vector<std::filesystem::path> mask_folders(const std::filesystem::path& root) {
  std::vector<std::filesystem::path> folders;
  std::error_code status;
  for (std::filesystem::recursive_directory_iterator i(root, status), end; !status && i != end; i.increment(status)) {
    std::error_code ignored;
    if (!i->is_directory(ignored)) continue;
    const std::string name = folded(i->path().filename().string());
    const bool masks = name.compare(0, 4, "mask") == 0;
    if (masks) folders.push_back(i->path());
    if (masks || i.depth() == 2 || holds_other_images(name)) i.disable_recursion_pending();
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

/// Warns of files that may be masks but lie in places where masks are not looked for: beside the photographs, or in
/// folders of labels.
inline void say_other_masks(Dataset& dataset, const std::filesystem::path& root) {
  std::size_t count = 0;
  std::string first;
  for (const View& view : dataset.views) {
    const std::filesystem::path& image = view.image_path;
    const std::string stem = image.stem().string();
    for (const std::string& name :
         {"dynamic_mask_" + stem + ".png", stem + "_mask.png", stem + "-mask.png", "mask_" + stem + ".png",
          image.filename().string() + ".mask.png", stem + ".mask.png",
          image.filename().string() + ".alpha" + image.extension().string()}) {
      if (view.mask_path.empty() && file_exists(image.parent_path() / name) && count++ == 0) first = name;
    }
  }
  const auto say = [&](const std::string& sentence) {
    dataset.warnings.push_back(dataset.root.string() + ": " + sentence +
                               "; put masks into a folder masks, black where a pixel is to be ignored");
  };
  if (count > 0) say(std::to_string(count) + " masks beside the images are not used, the first is " + first);
  std::error_code status;
  for (std::filesystem::directory_iterator i(root, status), end; !status && i != end; i.increment(status)) {
    const std::string name = folded(i->path().filename().string());
    static constexpr std::array<std::string_view, 6> begins{"seg",   "matte",      "alpha",
                                                            "label", "silhouette", "foreground"};
    const bool begin = std::any_of(begins.begin(), begins.end(),
                                   [&](std::string_view word) { return name.compare(0, word.size(), word) == 0; });
    const std::size_t mask = name.find("mask");
    const bool photographs = std::any_of(dataset.views.begin(), dataset.views.end(),
                                         [&](const View& view) { return view.image_path.parent_path() == i->path(); });
    if ((begin || (mask != std::string::npos && mask > 0)) && !photographs && holds_images(i->path()))
      say("the images in " + i->path().filename().string() + " are not used");
  }
}

/// Warns of files in the folders of masks that are no PNG or JPEG, and of empty folders.
inline void say_unread_masks(Dataset& dataset, const std::filesystem::path& root) {
  for (const std::filesystem::path& folder : mask_folders(root)) {
    std::size_t files = 0, others = 0;
    std::string first;
    std::error_code status, ignored;
    for (std::filesystem::recursive_directory_iterator i(folder, status), end; !status && i != end;
         i.increment(status)) {
      const std::string name = i->path().filename().string();
      if (name.front() == '.' || !i->is_regular_file(ignored) || (++files, is_image_name(name))) continue;
      if (others++ == 0 || name < first) first = name;
    }
    const std::string where =
        dataset.root.string() + ": the folder " + folder.lexically_relative(root).generic_string();
    if (files == 0) dataset.warnings.push_back(where + " holds no mask");
    if (others > 0) {
      dataset.warnings.push_back(where + " holds " + std::to_string(others) +
                                 " files that are neither PNG nor JPEG and are not used, the first is " + first);
    }
  }
}

/// Finds masks for views without one among the unused masks, by the ends of their names, and warns of masks that belong
/// to no image. `nobodys`: masks that were warned of before.
inline void pair_masks(Dataset& dataset, const std::filesystem::path& root,
                       const std::set<std::filesystem::path>& nobodys) {
  int told = 0;
  const auto say = [&](const std::string& sentence) {
    if (++told <= 8) dataset.warnings.push_back(dataset.root.string() + ": " + sentence);
    if (told == 9) dataset.warnings.push_back(dataset.root.string() + ": so it is with more folders of masks");
  };
  const std::vector<std::filesystem::path> folders = mask_folders(root);
  if (folders.empty()) return;
  std::set<std::filesystem::path> used;
  for (const View& view : dataset.views) {
    if (!view.mask_path.empty()) used.insert(view.mask_path.lexically_normal());
  }
  // Where one folder has masks of images; those beside it are of another size.
  std::set<std::filesystem::path> sources;
  for (const std::filesystem::path& folder : folders) {
    std::vector<std::size_t> views;
    std::vector<std::string> names, files, keys;
    for (std::size_t i = 0; i < dataset.views.size(); ++i) {
      if (!dataset.views[i].mask_path.empty()) continue;
      views.push_back(i);
      names.push_back(dataset.views[i].image_path.lexically_relative(root).generic_string());
    }
    if (views.empty()) return;
    bool of_images = false;
    for (const std::string& path : image_paths(folder, true)) {
      const std::filesystem::path file = (folder / path).lexically_normal();
      of_images = of_images || used.count(file) > 0;
      if (used.count(file) > 0 || nobodys.count(file) > 0) continue;
      files.push_back(path);
      const std::filesystem::path above = folder.parent_path().lexically_relative(root);
      keys.push_back(without_mask_affix((above / path).generic_string()));
    }
    if (of_images) sources.insert(folder.parent_path());
    if (files.empty() || (!of_images && sources.count(folder.parent_path()) > 0)) continue;
    const Pairing pairing = pair_names(names, keys);
    std::set<std::size_t> taken;
    std::string example;
    for (std::size_t k = 0; k < views.size(); ++k) {
      const std::size_t file = pairing.file[k];
      if (file == no_file) continue;
      View& view = dataset.views[views[k]];
      view.mask_path = folder / files[file];
      used.insert(view.mask_path.lexically_normal());
      if (taken.empty()) example = files[file] + " is of \"" + view.name + "\"";
      taken.insert(file);
      sources.insert(folder.parent_path());
    }
    if (!taken.empty())
      say(std::to_string(taken.size()) + " masks are found by the ends of their names (" + example + ")");
    for (std::size_t file = 0; file < files.size(); ++file) {
      if (taken.count(file) == 0) {
        say(std::to_string(files.size() - taken.size()) + " masks in " +
            folder.lexically_relative(root).generic_string() +
            " belong to no image, or to more than one, and are not used, the first is " + files[file]);
        break;
      }
    }
  }
}

/// Gives every view that has no mask yet the one that is found by its name, and says what is missing or could not be
/// decided.
inline void find_masks(Dataset& dataset, const std::filesystem::path& root) {
  std::map<std::filesystem::path, std::vector<std::size_t>> users;  // of the masks that are found by name
  for (std::size_t i = 0; i < dataset.views.size(); ++i) {
    View& view = dataset.views[i];
    if (!view.mask_path.empty()) continue;
    view.mask_path = find_mask(root, view.image_path);
    if (!view.mask_path.empty()) users[view.mask_path].push_back(i);
  }
  std::size_t undecided = 0;
  std::string example;
  std::set<std::filesystem::path> nobodys;
  for (const auto& [mask, list] : users) {
    const std::filesystem::path& image = dataset.views[list[0]].image_path;
    std::size_t other = 0;
    for (const std::size_t i : list) other = dataset.views[i].image_path != image ? i : other;
    if (other == 0) continue;  // one image, perhaps in several frames
    if (undecided++ == 0) {
      example = "\"" + mask.string() + "\" could be of \"" + dataset.views[list[0]].name + "\" and of \"" +
                dataset.views[other].name + "\"";
    }
    for (const std::size_t i : list) dataset.views[i].mask_path.clear();
    nobodys.insert(mask.lexically_normal());
  }
  const auto say = [&](const std::string& sentence) {
    dataset.warnings.push_back(dataset.root.string() + ": " + sentence);
  };
  if (undecided > 0) {
    say(std::to_string(undecided) + " masks have a name that more than one image could mean and are not used, " +
        example + "; put masks into the folders that the images are in (masks/train for train)");
  }
  pair_masks(dataset, root, nobodys);
  say_unread_masks(dataset, root);
  say_other_masks(dataset, root);
  std::size_t without = 0;
  for (const View& view : dataset.views) without += view.mask_path.empty() ? 1 : 0;
  if (without > 0 && without < dataset.views.size()) {
    say(std::to_string(without) + " of " + std::to_string(dataset.views.size()) +
        " images have no mask and are used whole");
  }
}

}  // namespace detail
}  // namespace compmark
