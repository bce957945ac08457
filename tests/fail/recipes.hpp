// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What recipe_*.fail.cpp include, for CMakeLists.txt beside it to precompile.
#include "compmark/anchor/frequency_growth.hpp"
#include "compmark/loss/frequency.hpp"
#include "compmark/pipeline/pipeline.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/testing/archetypes.hpp"
