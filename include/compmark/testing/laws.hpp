// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The laws that no compiler checks, as functions an embedder calls on policies of his own, with any test framework.
// Each returns text: empty when the laws hold, else one line for every violation.
#pragma once

#include "compmark/testing/executor_laws.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/testing/raster_laws.hpp"
