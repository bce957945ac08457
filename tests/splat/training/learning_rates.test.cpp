// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which block trains how fast, and which does not.
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/recipes/context_gs.hpp>
#include <compmark/recipes/hac.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/learning_rates.hpp>
#include <compmark/watermark/embed/residual.hpp>

using namespace compmark;

namespace {

/// The rate of a block of a recipe in a run of these settings.
template <class R>
struct Rates {
  TrainSettings settings;
  double extent = 1;
  Model<R> model;

  explicit Rates(const TrainSettings& of = {}, double scene_extent = 1) : settings(of), extent(scene_extent) {
    model.create(2, 3);
    set_schedules(model, settings);
  }
  [[nodiscard]] double operator()(const char* name, std::int64_t t) const {
    const ArenaLayout& layout = model.arena.layout();
    REQUIRE(layout.find(name).valid());
    return learning_rate(layout.block(layout.find(name)).schedule, settings.iterations, extent, t);
  }
};

/// An embedder of one's own: the shipped one under another name, with a schedule of its own or that of the settings.
struct OwnEmbedder : ResidualFeature<float> {
  static Handles add_parameters(ParameterArena<float>& arena, std::size_t rows, std::size_t columns) {
    return {arena.add("my.residual", rows, columns, RowKind::anchor, BlockRole::rendering,
                      LearningSchedule::constant(0.25))};
  }
};
struct OwnMarked : recipes::Scaffold {
  using Embedder = OwnEmbedder;
};

}  // namespace

TEST_CASE("training/learning_rates: log-linear between the published ends, offsets and masks in units of the extent") {
  const Rates<recipes::HacScaffold> rate({}, 3);
  // docs/spec/method.md, 3.2: 0.01 to 0.0001 times the extent; half-way in log space is the geometric mean.
  CHECK(rate("anchor.offset", 1) == doctest::Approx(0.03).epsilon(1e-3));
  CHECK(rate("anchor.offset", 15000) == doctest::Approx(0.003));
  CHECK(rate("anchor.offset", 30000) == doctest::Approx(0.0003));
  CHECK(rate("anchor.mask", 15000) == doctest::Approx(0.003));
  CHECK(rate("anchor.feature", 123) == 0.0075);
  CHECK(rate("mlp_color.0.weight", 30000) == doctest::Approx(0.00005));
}

TEST_CASE("training/learning_rates: the context trains from where it begins, its constants never; positions never") {
  const Rates<recipes::HacScaffold> hac;
  for (const char* name : {"hash_grid", "context.0.weight", "context.2.bias"}) {
    CAPTURE(name);
    CHECK(hac(name, 10000) == 0);
    CHECK(hac(name, 10001) > 0);
    CHECK(hac(name, 30000) == doctest::Approx(0.00001));
  }
  for (const char* name : {"context.box", "context.statistics", "anchor.position"}) CHECK(hac(name, 20000) == 0);
  const Rates<recipes::ContextGsScaffold> context_gs;
  for (const char* name : {"context_gs.0.0.weight", "context_gs.2.2.bias", "context_gs.prior", "anchor.hyperprior"}) {
    CAPTURE(name);
    CHECK(context_gs(name, 10000) == 0);
    CHECK(context_gs(name, 10001) > 0);
  }
  CHECK(context_gs("anchor.hyperprior", 30000) == 0.0075);
  CHECK(context_gs("context_gs.cells", 20000) == 0);
}

TEST_CASE("training/learning_rates: what a block is declared with are the defaults of the settings") {
  const auto same = [](auto& model) {
    const ArenaLayout declared = model.arena.layout();
    set_schedules(model, TrainSettings{});
    for (std::size_t b = 0; b < declared.blocks().size(); ++b) {
      CAPTURE(declared.blocks()[b].name);
      CHECK(model.arena.layout().blocks()[b].schedule == declared.blocks()[b].schedule);
    }
  };
  Model<recipes::HacExposure> hac;
  Model<recipes::ContextGsScaffold> context_gs;
  Model<recipes::MarkedForCompression<recipes::Scaffold, NoMessageDecoder>> marked;
  hac.create(2, 3), context_gs.create(2, 3), marked.create(2, 3);
  same(hac), same(context_gs), same(marked);
}

TEST_CASE("training/learning_rates: a residual trains under any name, from where the settings let it begin") {
  TrainSettings settings;
  settings.iterations = 300;
  settings.mark.residual.after = 15000;
  settings.mark.residual.learning_rate = 0.002;
  settings.mark.residual.decay = 0.5;
  const Rates<OwnMarked> own(settings);
  CHECK(own("my.residual", 150) == 0);
  CHECK(own("my.residual", 151) == doctest::Approx(0.002).epsilon(0.01));
  CHECK(own("my.residual", 300) == doctest::Approx(0.001));
  // Without settings: what it was declared with.
  Model<OwnMarked> model;
  model.create(2, 3);
  const LearningSchedule& declared =
      model.arena.layout().block(model.template blocks<EmbedderStage>().residual).schedule;
  CHECK(learning_rate(declared, 300, 1, 7) == 0.25);
}
