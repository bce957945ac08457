// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Chooses how the functions of app are compiled: inline in every file that includes them, as everywhere in the library,
// or once. The target compmark::app defines COMPMARK_APP_COMPILED for everything that links it: then the headers of app
// only declare, and app.cpp defines. A program uses one of the two. The second saves time where several files include
// app, or where one changes often: the shipped recipes together take the better part of a minute to compile
// (docs/app.md).
#pragma once

#if defined(COMPMARK_APP_COMPILED)
#define COMPMARK_APP_INLINE
#else
#define COMPMARK_APP_INLINE inline
#endif
