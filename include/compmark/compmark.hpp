// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Everything but the testing kit and the executors and adaptors that need another library. For examples and quick
// starts: a program that cares about its compile time includes one wing (scene.hpp, splat.hpp, watermark.hpp, codec.hpp),
// or the headers it uses.
#pragma once

#include "compmark/version.hpp"

#include "compmark/codec.hpp"
#include "compmark/fwd.hpp"
#include "compmark/recipes/captures.hpp"
#include "compmark/recipes/context_gs.hpp"
#include "compmark/recipes/explicit.hpp"
#include "compmark/recipes/far_field.hpp"
#include "compmark/recipes/hac.hpp"
#include "compmark/recipes/marked.hpp"
#include "compmark/recipes/marked_codecs.hpp"
#include "compmark/recipes/recipe_stages.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/scene.hpp"
#include "compmark/splat.hpp"
#include "compmark/watermark.hpp"
