// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// With odr_second.cpp: the umbrella header in two translation units of one program defines nothing twice.
#include <compmark/compmark.hpp>

const char* second_version();

int main() { return compmark::version == nullptr || second_version() == nullptr ? 1 : 0; }
