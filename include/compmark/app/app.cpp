// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The target compmark::app: everything of app, compiled once for the shipped recipes (compiled.hpp). A program without
// CMake compiles this file with its own flags and all of its files with -DCOMPMARK_APP_COMPILED.
#if !defined(COMPMARK_APP_COMPILED)
#error "compile app.cpp, and every file that includes headers of app, with -DCOMPMARK_APP_COMPILED"
#endif
#include "compmark/app/detail/any_model.hpp"
#include "compmark/app/detail/capture.hpp"
#include "compmark/app/detail/compare.hpp"
#include "compmark/app/detail/compress.hpp"
#include "compmark/app/detail/evaluate.hpp"
#include "compmark/app/detail/export.hpp"
#include "compmark/app/detail/files.hpp"
#include "compmark/app/detail/informed.hpp"
#include "compmark/app/detail/interference.hpp"
#include "compmark/app/detail/lpips_nets.hpp"
#include "compmark/app/detail/model_attack.hpp"
#include "compmark/app/detail/model_source.hpp"
#include "compmark/app/detail/picture.hpp"
#include "compmark/app/detail/proof.hpp"
#include "compmark/app/detail/reading.hpp"
#include "compmark/app/detail/robustness.hpp"
#include "compmark/app/detail/splat_capture.hpp"
#include "compmark/app/detail/spread.hpp"
#include "compmark/app/detail/verify.hpp"

namespace compmark {

// Every recipe of with_reading_recipe: one that is missing here does not link.
#define COMPMARK_APP_LOADS(name) template Result<LoadedModel<recipes::name>> ModelSource::load<recipes::name>() const
COMPMARK_APP_LOADS(Scaffold);
COMPMARK_APP_LOADS(ScaffoldAntiAliased);
COMPMARK_APP_LOADS(ScaffoldLens);
COMPMARK_APP_LOADS(ScaffoldFisheye);
COMPMARK_APP_LOADS(ScaffoldExposure);
COMPMARK_APP_LOADS(ScaffoldFarField);
COMPMARK_APP_LOADS(ScaffoldFarFieldExposure);
COMPMARK_APP_LOADS(Explicit);
COMPMARK_APP_LOADS(CompMarkBase);
COMPMARK_APP_LOADS(CompMarkPaperBase);
COMPMARK_APP_LOADS(HacScaffold);
COMPMARK_APP_LOADS(HacExposure);
COMPMARK_APP_LOADS(HacFitted);
COMPMARK_APP_LOADS(HacFittedExposure);
COMPMARK_APP_LOADS(ContextGsScaffold);
COMPMARK_APP_LOADS(ContextGsExposure);
COMPMARK_APP_LOADS(ContextGsFitted);
COMPMARK_APP_LOADS(ContextGsFittedExposure);
#undef COMPMARK_APP_LOADS

}  // namespace compmark
