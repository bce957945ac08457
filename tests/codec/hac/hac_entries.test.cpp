// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/hac/hac_entries.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace {

using namespace compmark;

constexpr std::size_t entry_anchors = 1000, entry_offsets = 3;

/// A seventh of the anchors is masked, two of three are listed, in an order of their own.
struct EntriesScene {
  std::vector<float> mask;
  std::vector<std::uint32_t> rows;
  EntriesScene() : mask(entry_anchors * entry_offsets, 1.0f) {
    for (std::size_t r = 0; r < entry_anchors; r += 7) {
      for (std::size_t k = 0; k < entry_offsets; ++k) mask[r * entry_offsets + k] = -20.0f;
    }
    for (std::uint32_t r = entry_anchors; r-- > 0;) {
      if (r % 3 != 2) rows.push_back(r);
    }
  }
};

/// The rule, row by row.
struct PlainEntries {
  std::vector<std::uint32_t> light, full;
  std::size_t unmasked = 0, candidates = 0;
  PlainEntries(const EntriesScene& scene, const HacSample& sample, const RatePhase& phase) {
    const Random random(phase.seed, phase.iteration, random_stage("hac sample"));
    std::vector<bool> listed(entry_anchors), sampled(entry_anchors);
    for (const std::uint32_t r : scene.rows) listed[r] = true;
    for (std::size_t r = 0; r < entry_anchors; ++r) {
      if (sample.share <= 0 || (!sample.everywhere && !listed[r])) continue;
      ++candidates;
      const bool drawn = random.uniform(r) < sample.share, coded = r % 7 != 0;
      if (sample.masked ? drawn && coded : coded) ++unmasked;
      sampled[r] = drawn && (coded || sample.masked);
    }
    for (const std::uint32_t r : scene.rows) (sampled[r] ? full : light).push_back(r);
    for (std::uint32_t r = 0; r < entry_anchors; ++r) {
      if (sampled[r] && !listed[r]) full.push_back(r);
    }
  }
};

}  // namespace

TEST_CASE("hac/hac_entries: light and full entries, of all anchors or of the listed, with the masked or without") {
  const EntriesScene scene;
  const MatrixView<const float> mask{scene.mask.data(), entry_anchors, entry_offsets};
  HacEntries entries;
  std::size_t most_full = 0, outside = 0;
  for (const double share : {0.0, 0.05, 0.4, 1.0}) {
    for (const bool everywhere : {false, true}) {
      for (const bool masked : {false, true}) {
        const HacSample sample{share, everywhere, masked};
        const RatePhase phase{.context = true, .seed = 3, .iteration = 11};
        RateReport report;
        entries.draw<float>(scene.rows, sample, phase, mask, report);
        const PlainEntries plain(scene, sample, phase);
        REQUIRE(entries.light == plain.light.size());
        REQUIRE(entries.full == plain.full.size());
        CHECK(entries.first_full % HacEntries::panel == 0);
        CHECK(entries.first_full - entries.light < HacEntries::panel);
        CHECK(entries.capacity % HacEntries::panel == 0);
        CHECK(entries.capacity >= entries.first_full + entries.full);
        std::size_t wrong = 0;
        for (std::size_t e = 0; e < entries.light; ++e) wrong += entries.row[e] != plain.light[e] ? 1 : 0;
        for (std::size_t e = 0; e < entries.full; ++e) {
          const std::size_t at = entries.first_full + e;
          wrong += entries.row[at] != plain.full[e] ? 1 : 0;
          const bool listed = plain.full[e] % 3 != 2;
          wrong += entries.visible(at) != listed ? 1 : 0;
          outside += listed ? 0 : 1;
        }
        CHECK(wrong == 0);
        CHECK(report.sampled == plain.full.size());
        const std::size_t among = masked ? plain.full.size() : plain.candidates;
        const double unmasked_share = among == 0 ? 0 : static_cast<double>(plain.unmasked) / static_cast<double>(among);
        CHECK(report.unmasked_share == unmasked_share);
        most_full = std::max(most_full, entries.full);
      }
    }
  }
  CHECK(most_full == entry_anchors);
  CHECK(outside > 300);
}
