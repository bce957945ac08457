// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A hook of the wrong signature would never be called, in silence: it hides the empty one of its name instead, and does not compile.
// message: no matching (member )?function for call to .*image
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/pipeline.hpp"

using namespace compmark;

struct Mine : Stage<Mine> {
#ifdef COMPMARK_MUST_FAIL
  template <class Pass>
  static void image(const Pass&) {}
#else
  template <class Pass>
  static void image(const Pass&, const StageOf<Mine>&) {}
#endif
};
struct Recipe_ : recipes::Scaffold {
  using Stages = StageList<Mine>;
};

void render(const Model<Recipe_>& model, const Camera<double>& camera, Pipeline<Recipe_>::Context& context) {
  SerialExecutor executor;
  static_cast<void>(Pipeline<Recipe_>().forward(model, camera, 0, context, executor));
}
