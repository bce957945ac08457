// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The exports of every recipe in the target compmark::app (app.cpp).
#if !defined(COMPMARK_APP_COMPILED)
#error "compile app*.cpp, and every file that includes headers of app, with -DCOMPMARK_APP_COMPILED"
#endif
#include "compmark/app/detail/export.hpp"
