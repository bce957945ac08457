// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "model_files.hpp"

#include <compmark/core/thread_executor.hpp>
#include <cstdio>

#include "common.hpp"

namespace tool {

using namespace compmark;

Result<ModelSource> open_source(const std::filesystem::path& path, std::size_t threads) {
  ThreadExecutor executor(threads);
  if (is_coded_file(path)) tell_threads(executor, threads);  // who only reads a table needs none
  return ModelSource::open(path, executor);
}

void tell_notes(const SplatFile& file) {
  for (const std::string& note : file.notes) std::fprintf(stderr, "compmark: note: %s\n", note.c_str());
  if (file.antialiased)
    std::fprintf(stderr, "compmark: note: the splats were trained with the mip filter, and are drawn without\n");
}

Result<AnyModel> load_model(const std::filesystem::path& path, std::size_t threads) {
  const Result<ModelSource> source = open_source(path, threads);
  if (!source) return source.error();
  if (source->splats) tell_notes(*source->splats);
  return AnyModel::load(*source);
}

}  // namespace tool
