// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "file_use.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <compmark/io/file_identity.hpp>
#include <compmark/io/output_target.hpp>
#include <compmark/io/splat/read_splat.hpp>
#include <compmark/scene/open.hpp>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>

namespace tool {
namespace {

using namespace compmark;
namespace fs = std::filesystem;

/// The identity of a file, independent of its name.
struct Identity {
  dev_t device = 0;
  ino_t number = 0;
  auto operator<=>(const Identity&) const = default;
};
/// The identity of an existing file, links followed. Devices, pipes and sockets have nothing to lose and none.
std::optional<Identity> identity(const fs::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return std::nullopt;
  if (S_ISCHR(found.st_mode) || S_ISFIFO(found.st_mode) || S_ISSOCK(found.st_mode)) return std::nullopt;
  return Identity{found.st_dev, found.st_ino};
}
bool is_image_name(const fs::path& path) {
  const std::string extension = detail::lower(path.extension().string());
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

/// Whether a file in a capture's folder is one that this tool wrote there, by its name or by how it begins: JSON of
/// ours has a schema first.
bool is_ours(const fs::path& path) {
  static constexpr std::array<std::string_view, 8> endings{".safetensors", ".cmk",        ".html", ".jsonl",
                                                           ".lock",        ".checkpoint", ".key",  ".old"};
  const std::string extension = path.extension().string();
  if (std::find(endings.begin(), endings.end(), extension) != endings.end()) return true;
  std::string begin(400, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  begin.resize(static_cast<std::size_t>(file.gcount()));
  if (extension == ".csv") return begin.rfind("model,codec,", 0) == 0;
  if (extension == ".ply") return begin.find("\ncomment compmark") != std::string::npos;
  if (extension != ".json") return false;
  const std::size_t quote = begin.find('"');
  return quote != std::string::npos &&
         (begin.compare(quote, 9, "\"schema\":") == 0 || begin.compare(quote, 8, "\"codec\":") == 0);
}

/// The photographs and masks of a capture, by identity.
std::set<Identity> photographs(const fs::path& capture) {
  std::set<Identity> found;
  const Result<Dataset> dataset = open_dataset(capture, {});
  if (!dataset) return found;
  for (const View& view : dataset->views) {
    for (const fs::path& path : {view.image_path, view.mask_path}) {
      if (path.empty()) continue;
      if (const std::optional<Identity> id = identity(path)) found.insert(*id);
    }
  }
  return found;
}

/// Whether the name of a folder is one that captures give to their images, with a scale or without ("images_4").
bool is_capture_folder(const fs::path& folder) {
  static constexpr std::array<std::string_view, 11> names{"images", "masks", "input", "depth",  "train", "test",
                                                          "val",    "color", "rgb",   "depths", "image"};
  std::string name = folder.filename().string();
  name.resize(name.find_last_not_of("0123456789") + 1);
  if (!name.empty() && name.back() == '_') name.pop_back();
  return std::find(names.begin(), names.end(), detail::lower(name)) != names.end();
}

/// Files that are there and would be replaced, by identity.
using Replaced = std::map<Identity, const UsedFile*>;

Error overwritten(const UsedFile& output, const std::string& what) {
  return {ErrorKind::invalid, output.path.string(), output.said, what,
          "choose another file: this one would be overwritten"};
}

/// The first of `replaced` that lies in a folder that is read.
std::optional<Error> in_folder(const UsedFile& read, const Replaced& replaced) {
  const bool capture = read.kind == InputKind::dataset && !is_splat_file(read.path);
  std::error_code status;
  const fs::path root = fs::is_directory(read.path, status) ? read.path : read.path.parent_path();
  if (!capture && root != read.path) return std::nullopt;  // a file, which is compared as such
  std::optional<std::set<Identity>> images;
  std::set<Identity> entered;  // a link may lead back
  std::vector<fs::path> folders{root};
  for (std::size_t next = 0; next < folders.size(); ++next) {
    const fs::path folder = folders[next];
    const std::optional<Identity> self = identity(folder);
    if (!self || !entered.insert(*self).second) continue;
    for (fs::directory_iterator i(folder, status), end; !status && i != end; i.increment(status)) {
      std::error_code none;
      if (i->is_directory(none)) {
        if (capture) folders.push_back(i->path());
        continue;
      }
      const std::optional<Identity> id = identity(i->path());
      const auto output = id ? replaced.find(*id) : replaced.end();
      if (output == replaced.end()) continue;
      const bool image = is_image_name(i->path());
      if (!capture && !image) continue;
      if (capture && image && !is_capture_folder(folder)) {
        if (!images) images = photographs(read.path);
        if (images->count(*id) == 0) continue;  // renders that were written there
      } else if (capture && !image && is_ours(i->path())) {
        continue;
      }
      return overwritten(*output->second, "is a file of " + read.path.string() + ", which " + read.said + " reads");
    }
  }
  return std::nullopt;
}

}  // namespace

Result<Done> check_file_use(const FileUse& use) {
  std::vector<const UsedFile*> outputs;
  Replaced replaced;
  for (const UsedFile& output : use.writes) {
    if (is_stream_target(output.path)) continue;  // written through: nothing there can be lost
    for (const UsedFile& read : use.reads) {
      if (same_file(output.path, read.path)) return overwritten(output, "is the file that " + read.said + " reads");
    }
    if (const std::optional<Identity> there = identity(output.path)) replaced.emplace(*there, &output);
    outputs.push_back(&output);
  }
  for (const UsedFile& read : use.reads) {
    if (replaced.empty() || (read.kind != InputKind::dataset && read.kind != InputKind::images)) continue;
    if (std::optional<Error> error = in_folder(read, replaced)) return *error;
  }
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (same_file(outputs[i]->path, outputs[j]->path))
        return overwritten(*outputs[i], "is the file that " + outputs[j]->said + " writes");
    }
  }
  return Done{};
}

}  // namespace tool
