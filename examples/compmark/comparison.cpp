// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "comparison.hpp"

#include <algorithm>
#include <cstdio>

namespace tool {

void ShownModels::on_warning(const std::string& sentence) {
  std::fprintf(stderr, "compmark: warning: %s\n", sentence.c_str());
}

void ShownModels::on_model(const std::filesystem::path& /*path*/, std::size_t view_count) {
  count_ = view_count;
  pictures.emplace_back();
}

bool ShownModels::on_view(const compmark::SeenView& view) {
  const std::size_t shown = std::min(shown_, count_);
  for (std::size_t s = 0; s < shown; ++s) {
    if (view.index != s * count_ / shown) continue;
    pictures.back().push_back({view.result.name, make_report_image(view.truth), make_report_image(view.measured),
                               view.result.psnr, view.result.ssim, view.result.lpips_alex});
  }
  return true;
}

const char* split_name(compmark::Split split) { return split == compmark::Split::test ? "test" : "train"; }

}  // namespace tool
