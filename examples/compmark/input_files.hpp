// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recognises wrong files by their contents. An error names the kind of a wrong input and the command that takes it,
// before anything else is read, and names an existing file of another kind that an output would replace.
#pragma once

#include <compmark/core/result.hpp>

#include "file_use.hpp"

namespace tool {

/// An error if an input is a file of a known kind that its option does not take. Unknown contents are left to the
/// reader. Cost: the first 64 KiB of every file that is named.
compmark::Result<compmark::Done> check_input_kinds(const FileUse& use);
/// An error if an output would replace a file of another kind (an image by a report, a model by a PLY), or any owner's
/// key.
compmark::Result<compmark::Done> check_output_kinds(const FileUse& use);

}  // namespace tool
