// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The target compmark::app_run: the functions of app/run, compiled once for the shipped recipes (app/compiled.hpp). It
// is beside compmark::app because training of every recipe takes minutes of a compiler, and who only opens finished
// models needs none of it. Trainings for compression are in app_run_codecs.cpp beside this file, so that two processors
// share the time and neither takes 3 GB of memory (docs/notebook/measured.md). A program without CMake compiles both with its own flags.
#if !defined(COMPMARK_APP_COMPILED)
#error "compile app_run*.cpp, and every file that includes headers of app, with -DCOMPMARK_APP_COMPILED"
#endif
#include "compmark/app/run/detail/effect_choice.hpp"
#include "compmark/app/run/detail/embed.hpp"
#include "compmark/app/run/detail/fit_codec.hpp"
#include "compmark/app/run/detail/fit_decoder.hpp"
#include "compmark/app/run/detail/mark_record.hpp"
#include "compmark/app/run/detail/owner_keys.hpp"
#include "compmark/app/run/detail/run_any_scaffold.hpp"
#include "compmark/app/run/detail/run_folder.hpp"
#include "compmark/app/run/detail/run_results.hpp"
#include "compmark/app/run/detail/train.hpp"
