// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as a transforms file beside one image: what is accepted has finite cameras of the image's proportions.
#include <compmark/scene/transforms.hpp>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>

namespace {

std::filesystem::path folder_with_image() {
  std::string name = (std::filesystem::temp_directory_path() / "compmark_fuzz_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) std::abort();
  const compmark::ImageBytes image{4, 3, 3, std::vector<std::uint8_t>(36, 7)};
  if (!compmark::write_png(std::filesystem::path(name) / "a.png", image)) std::abort();
  return name;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace compmark;
  static const std::filesystem::path folder = folder_with_image();
  const Result<nlohmann::json> json =
      detail::parse_transforms(std::as_bytes(std::span<const std::uint8_t>(data, size)), "fuzz");
  if (!json) {
    if (json.error().problem.empty()) std::abort();
    return 0;
  }
  Dataset dataset;
  const std::filesystem::path file = folder / "transforms.json";
  std::vector<std::string> notes;
  const std::vector<detail::FoundImage> images = detail::find_frame_images(folder, detail::frame_names(*json), notes);
  const Result<Done> done = detail::append_frames(file, *json, Split::train, std::span(images), {}, dataset);
  if (!done) {
    if (done.error().line().empty()) std::abort();
    return 0;
  }
  for (const View& view : dataset.views) {
    if (!std::isfinite(view.camera.fx) || !(view.camera.fx > 0) || !std::isfinite(view.camera.center_world[0]))
      std::abort();
  }
  static_cast<void>(detail::leave_out_repeated(dataset, "fuzz"));
  static_cast<void>(detail::split_by_lists(file, *json, dataset));
  DatasetSettings few;
  few.random_points = 10;
  detail::finish_dataset(dataset, {}, few);
  return 0;
}
