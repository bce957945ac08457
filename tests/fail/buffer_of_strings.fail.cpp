// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// message: Buffer holds plain values
#include "compmark/core/buffer.hpp"

#include <string>

#ifdef COMPMARK_MUST_FAIL
compmark::Buffer<std::string> buffer(1);
#else
compmark::Buffer<float> buffer(1);
#endif
