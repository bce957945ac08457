// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// How the functions of this room are compiled: inline with whoever includes them, as everything of the library, or once. With
// COMPMARK_APP_COMPILED, which the target compmark::app defines for everybody who links it, the headers of app only declare, and app.cpp
// defines. One program has one of the two. It is worth it where more than one file includes app, or where one is changed often: the shipped
// recipes together take the better part of a minute to compile (docs/app.md).
#pragma once

#if defined(COMPMARK_APP_COMPILED)
#define COMPMARK_APP_INLINE
#else
#define COMPMARK_APP_INLINE inline
#endif
