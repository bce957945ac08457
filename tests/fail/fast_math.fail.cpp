// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// -ffast-math removes the NaN tests that the library relies on; the library refuses it at the door.
// message: compmark needs IEEE arithmetic
#ifdef COMPMARK_MUST_FAIL
#define __FAST_MATH__ 1
#endif
#include "compmark/core/config.hpp"
