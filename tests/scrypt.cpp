// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Keys derive through scrypt, which takes a third of a second with optimisation and seconds without. Modules without
// numbers are compiled without (CMakeLists.txt): of an inline function that several files compile the linker keeps the
// copy of the first, which is this one.
#include <compmark/io/scrypt.hpp>

/// What has an address outside of this file is compiled.
decltype(&compmark::scrypt) compmark_tests_scrypt();
decltype(&compmark::scrypt) compmark_tests_scrypt() { return &compmark::scrypt; }
