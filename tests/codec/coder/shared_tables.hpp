// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The tables of the entropy coder, built once for all tests of a program.
#pragma once

#include "compmark/codec/coder/gaussian_tables.hpp"

namespace compmark::testing {

inline const GaussianTables& shared_tables() {
  static const GaussianTables tables;
  return tables;
}

}  // namespace compmark::testing
