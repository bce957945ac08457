// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The encoder's report on a compressed file, for people and for programs.
#pragma once

#include <compmark/app/compress.hpp>
#include <compmark/codec/container/cmk.hpp>
#include <compmark/codec/container/encoding.hpp>
#include <nlohmann/json.hpp>
#include <string>

namespace tool {

std::string coded_text(const compmark::CodecReport& report);
nlohmann::ordered_json coded_json(const compmark::CodecReport& report);

}  // namespace tool
