// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The target compmark::app: everything of app, compiled once for the shipped recipes (compiled.hpp); what every recipe
// has a copy of is in app_models.cpp and app_export.cpp beside this file. A program without CMake compiles the three
// with its own flags and all of its files with -DCOMPMARK_APP_COMPILED.
#if !defined(COMPMARK_APP_COMPILED)
#error "compile app*.cpp, and every file that includes headers of app, with -DCOMPMARK_APP_COMPILED"
#endif
#include "compmark/app/detail/capture.hpp"
#include "compmark/app/detail/compare.hpp"
#include "compmark/app/detail/compress.hpp"
#include "compmark/app/detail/evaluate.hpp"
#include "compmark/app/detail/files.hpp"
#include "compmark/app/detail/informed.hpp"
#include "compmark/app/detail/interference.hpp"
#include "compmark/app/detail/lpips_nets.hpp"
#include "compmark/app/detail/model_attack.hpp"
#include "compmark/app/detail/picture.hpp"
#include "compmark/app/detail/proof.hpp"
#include "compmark/app/detail/reading.hpp"
#include "compmark/app/detail/robustness.hpp"
#include "compmark/app/detail/splat_capture.hpp"
#include "compmark/app/detail/spread.hpp"
#include "compmark/app/detail/verify.hpp"
