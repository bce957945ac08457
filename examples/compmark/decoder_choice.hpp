// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which message decoder a command uses where --decoder names no file: the one that travels with the program, which
// reads every scene, or one that is fitted to the scene (--decoder fit).
#pragma once

#include <compmark/app/run/run_settings.hpp>
#include <compmark/core/result.hpp>
#include <filesystem>

namespace tool {

/// The word for --decoder that asks for one that is fitted to the scene.
inline constexpr const char* fitted_decoder_word = "fit";

inline constexpr const char* reading_decoder_text =
    "the message decoder, as a file (default: decoder.safetensors beside the model, else the one that comes with the "
    "program)";

/// The decoder for every scene: installed with the program, or in the folder that it was built from.
[[nodiscard]] compmark::Result<std::filesystem::path> shipped_decoder();

/// Whether the command may write a decoder; one that is named is only read.
[[nodiscard]] inline bool fits_decoder(const compmark::MarkSettings& mark) {
  return mark.decoder.empty() || mark.decoder == fitted_decoder_word;
}

/// Of a command that hides a message. Call it once the words were parsed.
[[nodiscard]] compmark::Result<compmark::Done> choose_decoder(compmark::MarkSettings& mark);

/// Of a command that reads one: where none is named, decoder.safetensors beside the model, as a run leaves it that fits
/// one, else the shipped one.
[[nodiscard]] compmark::Result<compmark::Done> choose_decoder(std::filesystem::path& decoder,
                                                              const std::filesystem::path& model);

}  // namespace tool
