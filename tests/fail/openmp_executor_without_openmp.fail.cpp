// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// message: needs OpenMP: link compmark::openmp
#ifdef COMPMARK_MUST_FAIL
#include "compmark/core/openmp_executor.hpp"
#endif
