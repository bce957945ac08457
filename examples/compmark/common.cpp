// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "common.hpp"

#include <compmark/io/atomic_file.hpp>
#include <compmark/io/sha256.hpp>
#include <cstdio>
#include <system_error>

namespace tool {

int fail(const compmark::Error& error) {
  std::fprintf(stderr, "compmark: error: %s\n", error.line().c_str());
  return failure;
}

void tell_threads(const compmark::ThreadExecutor& executor, std::size_t wanted) {
  static bool told = false;
  if (told || executor.concurrency() >= wanted) return;
  told = true;
  std::fprintf(stderr,
               "compmark: warning: the system allows %zu of the %zu threads that --threads asks "
               "for\n",
               executor.concurrency(), wanted);
}

std::string default_recipe(std::string_view profile) {
  if (profile == "official") return "compmark-host";
  if (profile == "paper") return "compmark-paper-host";
  return "scaffold";
}

compmark::Result<compmark::Done> DatasetViews::load(std::size_t i, compmark::ImageView<float> image) {
  return store->load(dataset->views[index[i]], image);
}

compmark::Result<compmark::Done> DatasetViews::load_planes(std::size_t i, std::array<float, 3> background,
                                                           compmark::TargetPlanes<float> planes) {
  return store->load_planes(index[i], background, planes.image, planes.alpha, planes.weight);
}

compmark::Result<std::string> file_sha256(const std::filesystem::path& path) {
  const compmark::Result<std::vector<std::byte>> bytes = compmark::read_file(path);
  if (!bytes) return bytes.error();
  return compmark::Sha256{}.update(*bytes).hex();
}

compmark::Result<compmark::Done> check_image_memory(const compmark::ImageInfo& info, const std::filesystem::path& path,
                                                    std::uint64_t bytes_a_pixel, std::size_t budget_mb) {
  const std::uint64_t pixels = static_cast<std::uint64_t>(info.width) * static_cast<std::uint64_t>(info.height);
  const std::uint64_t wanted = (pixels * bytes_a_pixel >> 20) + 1;
  if (wanted <= budget_mb) return compmark::Done{};
  return compmark::Error{compmark::ErrorKind::exhausted, path.string(), "--memory-budget",
                         "the image has " + std::to_string(info.width) + " x " + std::to_string(info.height) +
                             " pixels and takes about " + std::to_string(wanted) + " MiB to read, more than " +
                             std::to_string(budget_mb),
                         "scale it down, or give --memory-budget " + std::to_string(wanted)};
}

std::string base_name(const std::filesystem::path& path) {
  std::filesystem::path clean = path.lexically_normal();
  if (!clean.has_filename()) clean = clean.parent_path();
  return clean.filename().string();
}

compmark::Result<compmark::Done> make_folder(const std::filesystem::path& path) {
  std::error_code status;
  std::filesystem::create_directories(path, status);
  if (status || !std::filesystem::is_directory(path)) {
    return compmark::Error{compmark::ErrorKind::unwritable, path.string(), "--out",
                           "the folder cannot be created: " + status.message(), "choose a place you may write to"};
  }
  if (!compmark::AtomicFile::create(path / ".compmark-probe")) {  // never committed: nothing of it stays
    return compmark::Error{compmark::ErrorKind::unwritable, path.string(), "--out",
                           "no file can be written in this folder", "change its permissions or choose another"};
  }
  return compmark::Done{};
}

}  // namespace tool
