// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The few macros of the library and nothing else. No macro selects a feature: behaviour is chosen by types.
#pragma once

#include <cassert>

#if defined(__FAST_MATH__)
#error "compmark needs IEEE arithmetic (NaN tests, exact rounding): build without -ffast-math (-fno-math-errno is fine)"
#endif

/// Programmer errors only (a wrong shape, an index out of range). Data errors come back as Result or in a report.
/// An embedding program may define it before the first include, for instance to throw.
#ifndef COMPMARK_ASSERT
#define COMPMARK_ASSERT(condition, message) assert((condition) && (message))
#endif

/// Of a function that runs once in a run or an iteration and computes little: it opens a file, it words an error. It is
/// compiled for size, and whatever leads to it is taken for unlikely: no kernel calls one. The code of app_run became a
/// twentieth smaller (docs/notebook/measured.md).
#define COMPMARK_ONCE __attribute__((cold))

/// Kernels are written once as small functions and must be inlined into one loop to be fast.
#define COMPMARK_INLINE inline __attribute__((always_inline))

/// Before a loop: g++ unrolls loops over packs at -O2 when it is told how far; clang++ does by itself.
#define COMPMARK_PRAGMA(text) _Pragma(#text)
#if defined(__clang__)
#define COMPMARK_GCC_UNROLL(count)
#else
#define COMPMARK_GCC_UNROLL(count) COMPMARK_PRAGMA(GCC unroll count)
#endif

/// One machine code of a function, whatever its callers know of the arguments: two copies may fuse multiply-adds
/// differently.
#if defined(__clang__)
#define COMPMARK_ONE_COPY __attribute__((noinline))
#else
#define COMPMARK_ONE_COPY __attribute__((noipa))
#endif
