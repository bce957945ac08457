// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Helpers that the subcommands of the tool share: one error line, a dataset as training views.
#pragma once

#include <array>
#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/core/views.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/pipeline/training_views.hpp>
#include <compmark/scene/dataset.hpp>
#include <compmark/scene/image_store.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// Exit codes of the tool.
enum : int { success = 0, not_detected = 1, failure = 2, inconclusive = 3, salvaged = 4, interrupted_exit = 130 };

/// Prints "compmark: error: <line>" and returns the exit code.
int fail(const compmark::Error& error);

/// Calls a generic lambda with the recipe of a name (compmark/app/recipe_list.hpp). The lambda returns an exit code; a
/// name that is in no list gives an error.
template <class F>
struct ExitCode : F {
  explicit ExitCode(F f) : F(f) {}
  using F::operator();
  [[nodiscard]] int unknown(const compmark::Error& error) const { return fail(error); }
};

/// Warns, once, if there are fewer threads than `wanted` (0 asks for no number).
void tell_threads(const compmark::ThreadExecutor& executor, std::size_t wanted);

/// Recipe that a profile runs with unless --recipe says otherwise.
std::string default_recipe(std::string_view profile);
/// Whether a profile is one of the published method, whose mark trains with the scene.
inline bool is_published_profile(std::string_view profile) { return profile == "official" || profile == "paper"; }

/// Some views of a dataset, decoded on demand by the store.
struct DatasetViews {
  const compmark::Dataset* dataset = nullptr;
  compmark::ImageStore* store = nullptr;
  std::vector<std::size_t> index;

  [[nodiscard]] std::size_t size() const { return index.size(); }
  [[nodiscard]] compmark::Camera<double> camera(std::size_t i) const { return dataset->views[index[i]].camera; }
  /// The lens that view i is rendered through; none if it was removed from the image, or is ignored.
  [[nodiscard]] compmark::Lens lens(std::size_t i) const {
    const compmark::View& view = dataset->views[index[i]];
    return view.lens_treatment == compmark::LensTreatment::keep ? view.lens : compmark::Lens{};
  }
  [[nodiscard]] compmark::Result<compmark::Done> load(std::size_t i, compmark::ImageView<float> image);
  /// Colours over another background, coverage and weights: what recipes with effects train on.
  [[nodiscard]] compmark::Result<compmark::Done> load_planes(std::size_t i, std::array<float, 3> background,
                                                             compmark::TargetPlanes<float> planes);
};

/// Adds the file name to an Error of a function that does not know it.
[[nodiscard]] inline compmark::Error in_file(compmark::Error error, const std::filesystem::path& file) {
  error.file = file.string();
  return error;
}
/// SHA-256 of a file, 64 hexadecimal digits.
compmark::Result<std::string> file_sha256(const std::filesystem::path& path);
/// Checks, before an image is decoded, that there is memory for it: a small file may hold a very large image.
compmark::Result<compmark::Done> check_image_memory(const compmark::ImageInfo& info, const std::filesystem::path& path,
                                                    std::uint64_t bytes_a_pixel, std::size_t budget_mb);
/// The last name of a path, also of "scene/": the name of a dataset.
std::string base_name(const std::filesystem::path& path);
/// Creates a folder and checks that files can be written in it.
compmark::Result<compmark::Done> make_folder(const std::filesystem::path& path);

}  // namespace tool
