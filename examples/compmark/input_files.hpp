// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The wrong file is named for what it is: an input with the command that takes it, before anything is read of it, and
// an output that would replace something else than its like.
#pragma once

#include <compmark/core/result.hpp>

#include "file_use.hpp"

namespace tool {

/// An error if an input is a file of a known kind that its option does not take. What tells no kind is left to its
/// reader. Cost: the first 64 KiB of every file that is named.
compmark::Result<compmark::Done> check_input_kinds(const FileUse& use);
/// An error if an output would replace a file of a kind that cannot be meant: a report an image, a PLY a model;
/// whatever it is, an owner's key.
compmark::Result<compmark::Done> check_output_kinds(const FileUse& use);

}  // namespace tool
