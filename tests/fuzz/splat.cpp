// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as a splat file of every format, by their content and by each ending that a name can have: an error in
// words, or a table of whole columns and unit rotations that can be drawn.
#include <compmark/io/splat/read_splat.hpp>

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "any_tensors.hpp"

using namespace compmark;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span<const std::uint8_t>(data, size));
  const auto judge = [](const Result<SplatFile>& file) {
    if (!file) {
      testing::require_words(file.error());
      return;
    }
    const SplatTable& table = file->table;
    if (table.count == 0) std::abort();
    detail::for_each_splat_column(table, [&](const std::string& name, const std::vector<float>& column) {
      if (column.size() != table.count) std::abort();
      const bool endless = name == "opacity" || name.starts_with("scale_");
      for (const float value : column) {
        if (endless ? std::isnan(value) : !std::isfinite(value)) std::abort();
      }
    });
    for (std::size_t i = 0; i < table.count; ++i) {
      double norm = 0;
      for (const std::vector<float>& column : table.rotation) norm += std::pow(static_cast<double>(column[i]), 2);
      if (!(std::abs(norm - 1) < 1e-5)) std::abort();
    }
  };
  for (const char* name : {"scene", "scene.splat", "scene.ksplat"}) judge(parse_splat(bytes, name));
  judge(parse_spz(bytes, "scene.spz"));  // without gzip too
  if (const Result<SplatTable> table = parse_ksplat(bytes, "scene.ksplat"); !table)
    testing::require_words(table.error());
  return 0;
}
