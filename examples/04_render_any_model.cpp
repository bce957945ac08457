// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Renders a camera that is stored in any model, trained or compressed, to a PNG: 04_render_any_model MODEL PICTURE.png
// [VIEW]
#include <compmark/app/any_model.hpp>
#include <compmark/io/image_file.hpp>
#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
  if (argc < 3) return std::fprintf(stderr, "usage: %s MODEL PICTURE.png [VIEW]\n", argv[0]), 2;
  compmark::ThreadExecutor threads;
  compmark::Result<compmark::AnyModel> model = compmark::AnyModel::open(argv[1], threads);
  if (!model) return std::fprintf(stderr, "%s\n", model.error().line().c_str()), 1;
  const std::size_t view = argc > 3 ? std::strtoul(argv[3], nullptr, 10) : 0;
  if (view >= model->info().views.size()) return std::fprintf(stderr, "the model stores no camera %zu\n", view), 1;
  const auto render = model->render(model->info().views[view], threads);
  if (!render) return std::fprintf(stderr, "%s\n", render.error().line().c_str()), 1;
  const auto written = compmark::write_png(argv[2], render->image);
  if (!written) return std::fprintf(stderr, "%s\n", written.error().line().c_str()), 1;
  std::printf("%s, %zu anchors: %s\n", model->info().recipe.c_str(), model->anchor_count(), argv[2]);
  return 0;
}
