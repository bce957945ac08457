// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/model_attack.hpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/detail/reading.hpp"
#include "compmark/app/model_attack.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/watermark/attack/model_attacks.hpp"

namespace compmark {
namespace detail {

/// Gaussians of an anchor.
[[nodiscard]] inline std::size_t slots_of_anchor(const ArenaLayout& layout) {
  const BlockHandle offset = layout.find("anchor.offset");
  return offset.valid() ? std::max<std::size_t>(1, layout.block(offset).columns / 3) : 1;
}

/// Why two models have no tensors in common, if so; rows of anchors may differ where `rows` is false.
[[nodiscard]] inline std::optional<Error> other_tensors(AnyModel& model, AnyModel& other, bool rows) {
  const auto differs = [&](const std::string& field, const std::string& problem) {
    return Error{ErrorKind::invalid, other.file().string(), field, problem + " than that of " + model.file().string(),
                 "give models that were made from the same one"};
  };
  if (model.info().recipe != other.info().recipe) return differs("recipe", "is another");
  if (model.info().unit != other.info().unit || model.info().origin != other.info().origin)
    return differs("unit", "is another, or the origin,");
  const auto blocks = model.arena().layout().blocks(), others = other.arena().layout().blocks();
  if (blocks.size() != others.size()) return differs("tensors", "are others");
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const bool same_rows = blocks[b].rows == others[b].rows || (!rows && blocks[b].kind == RowKind::anchor);
    if (blocks[b].name != others[b].name || blocks[b].columns != others[b].columns || !same_rows)
      return differs(others[b].name, "has another shape");
  }
  return std::nullopt;
}

}  // namespace detail

COMPMARK_APP_INLINE Result<AnchorEvidence> anchor_evidence(AnyModel& model, ThreadExecutor& executor,
                                                           const EvidenceSettings& settings) {
  std::vector<StoredView> views = model.info().views;
  // A compressed file keeps the test views alone unless it was told otherwise, and of a splat file no view trained.
  if (std::any_of(views.begin(), views.end(), [](const StoredView& view) { return !view.test; }))
    std::erase_if(views, [](const StoredView& view) { return view.test; });
  detail::keep_evenly(views, settings.views);
  if (views.empty()) {
    return Error{ErrorKind::invalid, model.file().string(), "views", "stores no camera",
                 "give a model of compmark train, or a file of it that keeps cameras"};
  }
  const std::size_t anchors = model.anchor_count(), k = detail::slots_of_anchor(model.arena().layout());
  std::vector<double> weight(anchors * k, 0.0), volume(anchors * k, 0.0), drawn(anchors * k, 0.0);
  std::vector<double> visits(anchors, 0.0), most(anchors, 0.0);
  AnchorEvidence evidence;
  evidence.opacity.assign(anchors, 0.0);
  for (const StoredView& view : views) {
    const Result<GaussianShares> shares = model.shares(view, executor);
    if (!shares) return shares.error();
    std::fill(most.begin(), most.end(), 0.0);
    for (std::size_t p = 0; p < shares->slot.size(); ++p) {
      const std::size_t slot = shares->slot[p];
      const auto side = [&](std::size_t axis) { return static_cast<double>(shares->drawn.scale[axis][p]); };
      weight[slot] += static_cast<double>(shares->weight[p]);
      volume[slot] += side(0) * side(1) * side(2);
      drawn[slot] += 1;
      most[slot / k] = std::max(most[slot / k], static_cast<double>(shares->drawn.opacity[p]));
    }
    for (std::size_t a = 0; a < anchors; ++a) {
      evidence.opacity[a] += most[a];
      visits[a] += most[a] > 0 ? 1 : 0;
    }
  }
  for (std::size_t a = 0; a < anchors; ++a) evidence.opacity[a] /= std::max(1.0, visits[a]);
  std::vector<double> volumes;
  for (std::size_t slot = 0; slot < volume.size(); ++slot) {
    if (drawn[slot] > 0) volumes.push_back(volume[slot] /= drawn[slot]);
  }
  double large = 0;
  if (!volumes.empty()) {
    const auto ninth = volumes.begin() + static_cast<std::ptrdiff_t>(volumes.size() * 9 / 10);
    std::nth_element(volumes.begin(), ninth, volumes.end());
    large = *ninth;
  }
  evidence.significance.assign(anchors, 0.0);
  for (std::size_t slot = 0; slot < weight.size(); ++slot) {
    const double size = large > 0 ? std::min(volume[slot] / large, 1.0) : 1.0;
    evidence.significance[slot / k] += weight[slot] * std::pow(size, settings.volume_power);
  }
  return evidence;
}

COMPMARK_APP_INLINE Result<Done> attack_any_model(AnyModel& model, std::string_view text, std::uint64_t seed,
                                                  ThreadExecutor& executor) {
  const auto of_file = [&](Error error) {
    if (error.file.empty()) error.file = model.file().string();
    return error;
  };
  const Result<bool> renders = needs_renders<ModelAttacks>(text);
  if (!renders) return renders.error();
  std::optional<AnchorEvidence> evidence;
  if (*renders) {
    Result<AnchorEvidence> found = anchor_evidence(model, executor);
    if (!found) return of_file(found.error());
    evidence = std::move(*found);
  }
  const Result<Done> attacked = attack_model<ModelAttacks>(text, model.arena(), seed, evidence ? &*evidence : nullptr);
  return attacked ? attacked : Result<Done>(of_file(attacked.error()));
}

COMPMARK_APP_INLINE Result<Done> average_models(AnyModel& model, const std::vector<std::filesystem::path>& copies,
                                                ThreadExecutor& executor) {
  const std::span<float> values = model.arena().all_values();
  std::vector<double> sum(values.begin(), values.end());
  const AnchorHandles handles = find_anchor_blocks(model.arena().layout());
  for (const std::filesystem::path& path : copies) {
    Result<AnyModel> copy = AnyModel::open(path, executor);
    if (!copy) return copy.error();
    if (std::optional<Error> other = detail::other_tensors(model, *copy, true)) return *other;
    if (handles.position.valid() && handles.scaling.valid()) {
      const MatrixView<float> position = model.arena().values(handles.position),
                              scaling = model.arena().values(handles.scaling),
                              theirs = copy->arena().values(handles.position);
      for (std::size_t row = 0; row < position.rows; ++row) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const double extent = std::exp(static_cast<double>(scaling(row, axis)));
          if (std::abs(static_cast<double>(position(row, axis)) - static_cast<double>(theirs(row, axis))) <=
              0.01 * extent)
            continue;
          return Error{ErrorKind::invalid, path.string(), "anchor.position",
                       "has anchor " + std::to_string(row) + " at another place than " + model.file().string(),
                       "average copies of one model, whose anchors are the same ones"};
        }
      }
    }
    const std::span<const float> more = copy->arena().all_values();
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += static_cast<double>(more[i]);
  }
  for (std::size_t i = 0; i < sum.size(); ++i)
    values[i] = static_cast<float>(sum[i] / static_cast<double>(1 + copies.size()));
  return Done{};
}

COMPMARK_APP_INLINE Result<Done> insert_model(AnyModel& scene, AnyModel& part) {
  if (&scene.arena() == &part.arena()) {
    return Error{ErrorKind::invalid, scene.file().string(), "part", "is the very model that it is to go into",
                 "open the file a second time and give that"};
  }
  if (std::optional<Error> other = detail::other_tensors(scene, part, false)) return *other;
  ParameterArena<float>& into = scene.arena();
  const ParameterArena<float>& from = part.arena();
  for (std::size_t b = 0; b < into.layout().blocks().size(); ++b) {
    const ArenaLayout::Block &block = into.layout().blocks()[b], &theirs = from.layout().blocks()[b];
    if (block.kind != RowKind::fixed || block.role != BlockRole::rendering) continue;
    const float* const mine = into.all_values().data() + block.offset;
    if (!std::equal(mine, mine + block.size(), from.all_values().data() + theirs.offset)) {
      return Error{ErrorKind::unsupported, part.file().string(), block.name,
                   "is a network of other weights than that of " + scene.file().string(),
                   "put explicit Gaussians together instead (compmark export)"};
    }
  }
  const std::size_t rows = scene.anchor_count(), added = part.anchor_count();
  std::vector<std::uint32_t> kept(rows);
  std::iota(kept.begin(), kept.end(), 0u);
  into.edit_rows({kept, added});
  for (std::size_t b = 0; b < into.layout().blocks().size(); ++b) {
    const ArenaLayout::Block &block = into.layout().blocks()[b], &theirs = from.layout().blocks()[b];
    if (block.kind != RowKind::anchor) continue;
    std::copy_n(from.all_values().data() + theirs.offset, theirs.size(),
                into.all_values().data() + block.offset + rows * block.columns);
  }
  return Done{};
}

}  // namespace compmark
