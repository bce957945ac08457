// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "codec_file.hpp"

#include <compmark/codec/cmk.hpp>

namespace tool {

using namespace compmark;

Result<CodecEncoded> encode_codec(const CodecModel& model, ThreadExecutor& executor) {
  return encode_cmk(model, CodecEncodeSettings{}, executor);
}
Result<CodecEncoded> write_codec_file(const std::filesystem::path& path, const CodecModel& model,
                                      ThreadExecutor& executor) {
  return write_cmk(path, model, CodecEncodeSettings{}, executor);
}
Result<CodecDecoded> read_codec_file(const std::filesystem::path& path, const CodecDecodeSettings& settings,
                                     ThreadExecutor& executor) {
  return read_cmk(path, settings, executor);
}
Result<CodecDecoded> decode_codec_file(std::span<const std::byte> bytes, const std::string& name,
                                       ThreadExecutor& executor) {
  return decode_cmk(bytes, name, CodecDecodeSettings{}, executor);
}
const char* codec_file_name(ContainerProfile profile) { return codec_name(profile); }

}  // namespace tool
