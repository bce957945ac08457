// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The ways in which a message is hidden in a finished model, by name: this library's, and the baselines that it is
// compared with (docs/baselines.md).
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace compmark {

enum class EmbedMethod {
  compmark,        ///< post-hoc embedding (watermark/embed/posthoc_embedding.hpp)
  waterf,          ///< everything trains on (watermark/baselines/waterf.hpp)
  guardsplat,      ///< free offsets beside frozen features (watermark/baselines/guardsplat.hpp)
  gaussianmarker,  ///< copies of uncertain anchors train (watermark/baselines/gaussianmarker.hpp)
  threedgsw        ///< pruned and split, then everything trains on (watermark/baselines/threedgsw.hpp)
};
inline constexpr std::array<std::string_view, 5> embed_method_names{"compmark", "waterf", "guardsplat",
                                                                    "gaussianmarker", "3dgsw"};

[[nodiscard]] constexpr std::string_view name_of(EmbedMethod method) {
  return embed_method_names[static_cast<std::size_t>(method)];
}
/// Nothing if no method has this name.
[[nodiscard]] constexpr std::optional<EmbedMethod> embed_method(std::string_view name) {
  for (std::size_t i = 0; i < embed_method_names.size(); ++i) {
    if (embed_method_names[i] == name) return static_cast<EmbedMethod>(i);
  }
  return std::nullopt;
}

}  // namespace compmark
