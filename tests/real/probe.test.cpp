// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>
#include <compmark/scene/probe.hpp>

#include "support/data.hpp"

using namespace compmark;

TEST_CASE("real/probe: what the shared captures call for") {
  const auto data = testing::data_dir();
  if (!data) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  struct Expected {
    const char* scene;
    const char* effects;
  };
  // Fox's principal point is 3.6 pixels off the centre. In the photographs of gerrard_hall and king the brightness of
  // the same features differs by 14 % and 10 % from one to the next, in those of cup by 6 %.
  for (const Expected& expected : {Expected{"blender/lego", "alpha "}, Expected{"blender/chair", "alpha "},
                                   Expected{"transforms_fox", "principal_point lens_distortion "},
                                   Expected{"llff_fern", "lens_distortion forward_facing "},
                                   Expected{"colmap_gerrard_hall", "exposure far_field "},
                                   Expected{"colmap_cup", "exposure "}, Expected{"colmap_king", "exposure "}}) {
    CAPTURE(expected.scene);
    const Result<Dataset> dataset = open_dataset(*data / expected.scene, {});
    REQUIRE(dataset.ok());
    const Result<std::vector<ProbedEffect>> effects = probe_scene(*dataset);
    REQUIRE(effects.ok());
    std::string names;
    for (const ProbedEffect& e : *effects) {
      names += std::string(effect_name(e.effect)) + " ";
      MESSAGE(std::string(expected.scene) << ": " << e.evidence);
    }
    CHECK(names == expected.effects);
  }
}
