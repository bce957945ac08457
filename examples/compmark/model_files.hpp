// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Opens models by path for the commands: compmark/app with as many threads as --threads says.
#pragma once

#include <compmark/app/any_model.hpp>
#include <compmark/app/model_source.hpp>
#include <compmark/core/result.hpp>
#include <compmark/io/splat/splat_file.hpp>
#include <cstddef>
#include <filesystem>

namespace tool {

/// What a splat file holds and the model does not, on the error stream.
void tell_notes(const compmark::SplatFile& file);
/// A model file or a .cmk, of whichever recipe, or a splat file, whose notes are told.
compmark::Result<compmark::AnyModel> load_model(const std::filesystem::path& path, std::size_t threads = 0);
/// The same file before its recipe is chosen.
compmark::Result<compmark::ModelSource> open_source(const std::filesystem::path& path, std::size_t threads = 0);

}  // namespace tool
