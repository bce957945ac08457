// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The places of a model that a picture is compared with when its camera is looked for (register.hpp): the cameras that
// the model stores, then drawn ones between and beyond them. Splats that came without cameras have some that were made
// up round them, about the usual up (scene/views_around.hpp). A picture is turned by at most 30 degrees in the search,
// so where no file says which way is up, there are places about each of the six axes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/area_resize.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/orbit_view.hpp"
#include "compmark/scene/register/camera_search.hpp"
#include "compmark/scene/up_axes.hpp"
#include "compmark/splat/training/model_info.hpp"

namespace compmark {

/// Likeness from which a picture is of the scene: docs/registration.md says how it was chosen.
inline constexpr double found_likeness = 0.45;
/// Likeness below which the camera of such a picture may be a wrong one. Wrong cameras of a scene of boxes reached 0.33,
/// of a splat scene 0.47 to 0.53, and right ones with noise of deviation 0.1 have 0.31 (128 pixels) to 0.61, clean ones
/// 0.67 and more: the two overlap, so this is said and decides nothing.
inline constexpr double sure_likeness = 0.6;

struct RegisterSettings {
  std::size_t places = 300;    ///< cameras that a picture is compared with: the model's, then drawn ones
  std::uint64_t seed = 0;      ///< of the drawn ones
  std::size_t candidates = 4;  ///< of each group of places (SearchPlace::group), fitted at the smallest size at most
  int finest = 400;            ///< longest side at which the picture is fitted last, pixels
  bool mirrored = false;       ///< look at the mirrored picture as well
  double enough = found_likeness;  ///< likeness from which a picture is of the scene
  /// Of splats that came without cameras, which way is up; nothing: as their file says, or any of the six axes. An error
  /// for a model that has cameras of its own.
  std::optional<std::array<double, 3>> up = {};
};

namespace detail {

/// A picture that was made smaller, to at most `longest` pixels a side.
struct RegisterPicture {
  std::vector<float> values;
  ImageView<float> view;

  RegisterPicture(ImageView<const float> picture, int longest, ThreadExecutor& executor) {
    const double scale = std::min(1.0, static_cast<double>(longest) / std::max(picture.width, picture.height));
    const int width = std::max(1, static_cast<int>(std::lround(scale * picture.width))),
              height = std::max(1, static_cast<int>(std::lround(scale * picture.height)));
    values.resize(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    view = {values.data(), 3, height, width};
    AreaResize<float>().forward(picture, view, executor);
  }
};

/// The cameras of a model in groups, drawn cameras lie between those of a group: one group, or one for each way that
/// may be up in splats without cameras. `up`, if any, is of length 1.
[[nodiscard]] inline std::vector<std::vector<Camera<double>>> register_groups(
    const ModelInfo& info, const std::optional<std::array<double, 3>>& up = {}) {
  std::vector<Camera<double>> stored;
  for (const StoredView& view : info.views) stored.push_back(view.camera);
  if (!cameras_are_made_up(info)) return {std::move(stored)};
  if (up) return {cameras_turned_up(stored, *up)};
  if (info.up) return {std::move(stored)};
  std::vector<std::vector<Camera<double>>> groups;
  for (const std::array<double, 3>& axis : up_axes) groups.push_back(cameras_turned_up(stored, axis));
  return groups;
}

}  // namespace detail

/// The places of a model that pictures are compared with: RegisterSettings::places of them, or as many as the model has
/// cameras; of splats whose up nobody said, a third of them about each of six axes. Error: the model has no stored cameras; RegisterSettings::up
/// is none, or the model has cameras of its own; one of AnyModel::render. Cost: a render of 144 pixels and its transform
/// a place.
[[nodiscard]] inline Result<std::vector<SearchPlace>> register_places(AnyModel& model, const RegisterSettings& settings,
                                                                      ThreadExecutor& executor) {
  if (model.info().views.empty())
    return Error{ErrorKind::unsupported, model.file().string(), "camera.table",
                 "the model stores no cameras, so there is nowhere to begin to look for one", "give a trained model"};
  std::optional<std::array<double, 3>> up;
  if (settings.up) {
    up = detail::unit(*settings.up);
    const bool of_splats = cameras_are_made_up(model.info());
    if (!up || !of_splats) {
      return Error{
          ErrorKind::invalid, model.file().string(), "--up",
          of_splats ? "is no direction" : "is given, and the model has cameras of its own, which say it",
          of_splats ? "give x, y, z, -x, -y or -z" : "leave it out: it is for splat files and what was made of them"};
    }
  }
  std::vector<SearchPlace> places;
  FieldTransform transform;
  const std::vector<std::vector<Camera<double>>> groups = detail::register_groups(model.info(), up);
  const std::size_t wanted = groups.size() > 1 ? settings.places / 3 : settings.places;
  for (std::size_t of = 0; of < groups.size(); ++of) {
    const std::vector<Camera<double>>& group = groups[of];
    const auto cameras = [&](std::size_t i) { return group[i]; };
    for (std::size_t i = 0; i < std::max(wanted, group.size()); ++i) {
      const Camera<double> camera =
          i < group.size() ? group[i]
                           : orbit_view_camera(cameras, group.size(), i % group.size(),
                                               Random(settings.seed, i, random_stage("app/register_places")));
      const Camera<double> small = search_camera(camera);
      const Result<RenderedView> render = model.render(small.resized(3 * small.width, 3 * small.height), executor);
      if (!render) return render.error();
      const detail::RegisterPicture shrunk(render->image, std::max(small.width, small.height), executor);
      places.push_back(search_place(camera, shrunk.view, transform));
      places.back().group = of;
    }
  }
  return places;
}

}  // namespace compmark
