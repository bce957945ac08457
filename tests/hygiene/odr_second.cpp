// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <compmark/compmark.hpp>

const char* second_version();
const char* second_version() { return compmark::version; }
