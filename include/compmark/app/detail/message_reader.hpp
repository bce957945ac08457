// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Who reads a message while models are compared: decoder, key and what is subtracted, opened once.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "compmark/app/compare.hpp"
#include "compmark/app/detail/reading.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/proof/key.hpp"

namespace compmark::detail {

/// Who reads the message, if anybody.
struct MessageReader {
  FileDecoder decoder;
  Message message;
  FileDecoder::Context context;
  std::optional<CoverInterference> interference;

  [[nodiscard]] Result<ViewLogits> read(ImageView<const float> image, const std::string& name,
                                        ThreadExecutor& executor) {
    return read_less(decoder, interference ? &*interference : nullptr, image, name, context, executor);
  }
};
[[nodiscard]] inline Result<std::unique_ptr<MessageReader>> open_reader(const CompareSettings& settings) {
  if (settings.key.empty() && settings.decoder.empty()) {
    if (settings.interference.empty()) return std::unique_ptr<MessageReader>();
    return Error{ErrorKind::invalid, settings.interference.string(), "--interference",
                 "is given, and no message is read", "give --key as well"};
  }
  if (settings.key.empty() || settings.decoder.empty()) {
    return Error{ErrorKind::invalid,
                 {},
                 settings.key.empty() ? "--key" : "--decoder",
                 "is missing",
                 "--key and --decoder are needed together to read a message"};
  }
  Result<OwnerKey> key = open_key(settings.key);
  if (key) key = for_recipient(*key, settings.key, settings.recipient);
  if (!key) return key.error();
  Result<FileDecoder> decoder = open_decoder(settings.decoder, &*key);
  if (!decoder) return decoder.error();
  auto reader = std::make_unique<MessageReader>();
  reader->decoder = std::move(*decoder);
  reader->message = message_of(*key);
  if (!settings.interference.empty()) {
    Result<CoverInterference> interference = open_interference(settings.interference, settings.decoder, &*key);
    if (!interference) return interference.error();
    reader->interference = std::move(*interference);
  }
  return reader;
}

}  // namespace compmark::detail
