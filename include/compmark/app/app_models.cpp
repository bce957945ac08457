// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The models of every recipe in the target compmark::app (app.cpp): opened, rendered, written.
#if !defined(COMPMARK_APP_COMPILED)
#error "compile app*.cpp, and every file that includes headers of app, with -DCOMPMARK_APP_COMPILED"
#endif
#include "compmark/app/detail/any_model.hpp"
#include "compmark/app/detail/model_source.hpp"

namespace compmark {

// Every recipe of with_reading_recipe: one that is missing here does not link.
#define COMPMARK_APP_LOADS(name) template Result<LoadedModel<recipes::name>> ModelSource::load<recipes::name>() const
COMPMARK_APP_LOADS(Scaffold);
COMPMARK_APP_LOADS(ScaffoldAntiAliased);
COMPMARK_APP_LOADS(ScaffoldLens);
COMPMARK_APP_LOADS(ScaffoldFisheye);
COMPMARK_APP_LOADS(ScaffoldExposure);
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
