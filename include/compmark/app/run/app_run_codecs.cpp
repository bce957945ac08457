// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The trainings for compression in the target compmark::app_run (app_run.cpp).
#if !defined(COMPMARK_APP_COMPILED)
#error "compile app_run*.cpp, and every file that includes headers of app, with -DCOMPMARK_APP_COMPILED"
#endif
#include "compmark/app/run/detail/run_any_codecs.hpp"
