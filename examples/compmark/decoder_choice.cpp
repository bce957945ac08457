// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "decoder_choice.hpp"

#include <system_error>
#include <utility>

namespace tool {

using namespace compmark;
namespace fs = std::filesystem;

Result<fs::path> shipped_decoder() {
  constexpr const char* name = "universal3_64.safetensors";
  std::error_code status;
  const fs::path program = fs::read_symlink("/proc/self/exe", status);
  const fs::path installed = program.parent_path().parent_path() / "share/compmark/weights" / name;
  for (const fs::path& path : {installed, fs::path(COMPMARK_WEIGHTS_DIR) / name}) {
    if (fs::exists(path, status)) return path;
  }
  return Error{ErrorKind::unreadable, installed.string(), "--decoder",
               "is missing, and the decoder that belongs to this program is not there either",
               "install the program with its weights, or give --decoder"};
}

Result<Done> choose_decoder(MarkSettings& mark) {
  const bool fits = mark.decoder == fitted_decoder_word;
  if (fits) mark.decoder.clear();
  if (fits || !mark.decoder.empty() || mark.key.empty()) return Done{};
  Result<fs::path> shipped = shipped_decoder();
  if (!shipped) return shipped.error();
  mark.universal = std::move(*shipped);
  return Done{};
}

Result<Done> choose_decoder(fs::path& decoder, const fs::path& model) {
  if (!decoder.empty()) return Done{};
  std::error_code status;
  const fs::path beside = model.parent_path() / "decoder.safetensors";
  if (!model.empty() && fs::exists(beside, status)) {
    decoder = beside;
    return Done{};
  }
  Result<fs::path> shipped = shipped_decoder();
  if (!shipped) return shipped.error();
  decoder = std::move(*shipped);
  return Done{};
}

}  // namespace tool
