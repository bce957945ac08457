// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// run_any.hpp for who calls it: with the loops of all trainings, unless these are compiled elsewhere
// (compmark/app/compiled.hpp).
#pragma once

#include "compmark/app/run/detail/run_any.hpp"

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/run/detail/run_any_codecs.hpp"
#include "compmark/app/run/detail/run_any_scaffold.hpp"
#endif
