// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recognises captures of formats that are not read here, and names the program that converts them
// (docs/capture_formats.md). Used only after no reader knew the folder. Cost: names of the folder and the first bytes
// of a few files.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/image_folder.hpp"
#include "compmark/scene/path_key.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {

/// A capture format that is not read. It is recognised by a file name and by a text near the beginning of that file.
struct ForeignCapture {
  std::string_view name;   ///< in small letters; ".xml" is any file that ends so
  std::string_view holds;  ///< in the file's first 4,096 bytes, in small letters; empty: the name is enough
  std::string_view what;
  std::string_view remedy;
};

inline constexpr std::array<ForeignCapture, 24> foreign_captures{{
    {"keyframes", "", "a raw capture of Polycam", "convert it with ns-process-data polycam (nerfstudio)"},
    {"mesh_info.json", "", "a raw capture of Polycam", "convert it with ns-process-data polycam (nerfstudio)"},
    {"metadata.json", "\"poses\"", "a capture of Record3D", "convert it with ns-process-data record3d (nerfstudio)"},
    {".r3d", "", "a capture of Record3D", "unpack it and convert it with ns-process-data record3d (nerfstudio)"},
    {".psx", "", "a project of Metashape", "export its cameras as COLMAP (File > Export > Export Cameras)"},
    {".xml", "<chunk", "an export of Metashape's cameras",
     "export the cameras as COLMAP (File > Export > Export Cameras), or convert them with ns-process-data metashape"},
    {".csv", "#cameras", "a registration of RealityCapture",
     "export the registration as COLMAP, or convert it with ns-process-data realitycapture"},
    {".csv", "#name", "a registration of RealityCapture",
     "export the registration as COLMAP, or convert it with ns-process-data realitycapture"},
    {".rcproj", "", "a project of RealityCapture", "export the registration as COLMAP"},
    {".rsproj", "", "a project of RealityScan", "export the registration as COLMAP"},
    {".xmp", "xcr:", "a registration of RealityCapture in sidecar files", "export the registration as COLMAP"},
    {"reconstruction.json", "", "a reconstruction of OpenSfM or ODM", "export it as COLMAP (opensfm export_colmap)"},
    {"sfm_data.json", "", "a reconstruction of OpenMVG", "export it as COLMAP (openMVG_main_openMVG2Colmap)"},
    {"cameras.sfm", "", "a reconstruction of Meshroom", "export it as COLMAP"},
    {"sfm.json", "", "a reconstruction of Meshroom", "export it as COLMAP"},
    {".nvm", "nvm_v", "a model of VisualSFM", "compute the cameras with COLMAP"},
    {"bundle.out", "", "a model of Bundler", "compute the cameras with COLMAP"},
    {"cameras.json", "\"img_name\"", "a list of cameras of a finished training", "give the folder that was trained on"},
    {".db", "sqlite format 3", "a database of COLMAP without a model",
     "run colmap mapper with --output_path sparse, which writes sparse/0"},
    {".mp4", "", "a video without cameras",
     "choose frames and compute cameras: sh examples/capture.sh --video FILE --out FOLDER (docs/capture.md)"},
    {".mov", "", "a video without cameras",
     "choose frames and compute cameras: sh examples/capture.sh --video FILE --out FOLDER (docs/capture.md)"},
    {".zip", "", "a packed file", "unpack it and give the folder inside"},
    {".blend", "", "a scene of Blender", "render photographs and transforms_train.json with the add-on BlenderNeRF"},
    {".ply", "", "points or a finished splat without photographs",
     "give the folder with the photographs and their cameras, or the splat file itself to train --data or adopt "
     "--splat "
     "(compmark info says what it is)"},
}};

namespace detail {

/// The first bytes of a file, or all of a shorter one.
[[nodiscard]] inline std::string first_text(const std::filesystem::path& file, std::size_t bytes) {
  std::string begin(bytes, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  begin.resize(static_cast<std::size_t>(stream.gcount()));
  return begin;
}

[[nodiscard]] inline bool is_foreign(const std::filesystem::path& file, const ForeignCapture& kind) {
  const std::string name = folded(file.filename().string());
  const bool named =
      kind.name.front() == '.' ? name.size() > kind.name.size() && name.ends_with(kind.name) : name == kind.name;
  if (!named || kind.holds.empty()) return named;
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return false;
  return folded(first_text(file, 4096)).find(kind.holds) != std::string::npos;
}

/// The format of a folder or a file that no reader knows; nothing if it is unknown here too.
[[nodiscard]] inline std::optional<Error> foreign_capture(const std::filesystem::path& place) {
  std::vector<std::filesystem::path> entries, folders;
  std::error_code status;
  for (std::filesystem::directory_iterator i(place, status), end; !status && i != end; i.increment(status)) {
    (folder_exists(i->path()) ? folders : entries).push_back(i->path());
  }
  if (!folder_exists(place)) entries = {place};
  std::sort(entries.begin(), entries.end());
  std::sort(folders.begin(), folders.end());
  entries.insert(entries.end(), folders.begin(), folders.end());
  for (const ForeignCapture& kind : foreign_captures) {
    for (const std::filesystem::path& entry : entries) {
      if (!is_foreign(entry, kind)) continue;
      const std::string field = entry == place ? std::string() : entry.filename().string();
      return Error{ErrorKind::unsupported, place.string(), field,
                   "is " + std::string(kind.what) + ", which is not read", std::string(kind.remedy)};
    }
  }
  return std::nullopt;
}

}  // namespace detail
}  // namespace compmark
