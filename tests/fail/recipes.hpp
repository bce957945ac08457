// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What recipe_*.fail.cpp include, for CMakeLists.txt beside it to precompile.
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/anchor/frequency_growth.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/testing/archetypes.hpp"
#include "compmark/watermark/loss/frequency.hpp"
