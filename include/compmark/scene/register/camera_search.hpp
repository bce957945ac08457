// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Where in a scene a picture could have been taken: cameras whose small renders look like it, up to a turn, a scale and
// a shift in the plane of the picture. A picture that was cut out, enlarged, turned about its axis or framed is a
// picture of another camera at the same place: its roll, focal length and principal point. So each place needs one
// render, and the picture is compared with it turned and scaled in a few ways and at every shift (gradient_field.hpp).
// Cost: a render of 48 pixels and 0.2 ms a place, once; 0.1 ms a place, turn and scale of a picture.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/area_resize.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/register/gradient_field.hpp"
#include "compmark/scene/register/picture_likeness.hpp"

namespace compmark {

/// A place to compare with, and its small render's field, transformed.
struct SearchPlace {
  Camera<double> camera;  ///< as it was given, at its own size
  ComplexField field;
  std::size_t group = 0;  ///< of places that were made on one assumption, such as which way is up
};

struct SearchSettings {
  std::array<double, 5> turns_degrees{0, -15, 15, -30, 30};
  std::array<double, 5> scales{1, .85, .7, .55, 1.2};  ///< size of the picture's content in the place's render
};

struct SearchMatch {
  Camera<double> camera;  ///< of the picture's size
  double likeness = 0;    ///< of the fields, at most about 1
  std::size_t place = 0;
};

namespace detail {

/// Pixels of a camera's picture per pixel of its field.
[[nodiscard]] inline double field_scale(int width, int height) {
  return static_cast<double>(std::max(width, height)) / field_picture;
}

/// A grey picture turned by `angle` and scaled about its middle into the middle of the square, by bilinear samples of a
/// copy that was shrunk by area before.
[[nodiscard]] inline ComplexField turned_field(const std::vector<float>& grey, int width, int height, double angle,
                                               double scale) {
  constexpr std::size_t count = static_cast<std::size_t>(field_side) * field_side;
  std::vector<float> square(count, 0.0f);
  std::vector<char> inside(count, 0);
  const double c = std::cos(angle) / scale, s = std::sin(angle) / scale;
  for (int y = 0; y < field_side; ++y) {
    for (int x = 0; x < field_side; ++x) {
      const double dx = x + 0.5 - field_side / 2.0, dy = y + 0.5 - field_side / 2.0;
      const double u = c * dx + s * dy + width / 2.0 - 0.5, v = -s * dx + c * dy + height / 2.0 - 0.5;
      if (!(u >= 0 && v >= 0 && u <= width - 1 && v <= height - 1)) continue;
      const int left = std::min(static_cast<int>(u), width - 2), top = std::min(static_cast<int>(v), height - 2);
      const auto fx = static_cast<float>(u - left), fy = static_cast<float>(v - top);
      const float* const row = grey.data() + static_cast<std::size_t>(top) * static_cast<std::size_t>(width) +
                               static_cast<std::size_t>(left);
      const std::size_t place = static_cast<std::size_t>(y) * field_side + static_cast<std::size_t>(x);
      square[place] = (1 - fy) * ((1 - fx) * row[0] + fx * row[1]) + fy * ((1 - fx) * row[width] + fx * row[width + 1]);
      inside[place] = 1;
    }
  }
  return gradient_field(square, inside, field_side, field_side, 0, 0);
}

/// The camera of a picture [width, height] whose point at (u, v) of its field, measured from its middle, lies at
/// scale * R(angle) (u, v) + shift of the place's field, measured from the middle of the place's picture.
[[nodiscard]] inline Camera<double> matched_camera(const Camera<double>& place, int width, int height, double angle,
                                                   double scale, double shift_x, double shift_y) {
  const double from = field_scale(place.width, place.height), to = field_scale(width, height);
  const double zoom = to / (from * scale), c = std::cos(angle), s = std::sin(angle);
  Camera<double> camera = place;
  camera.width = width;
  camera.height = height;
  const std::array<double, 9>& r = place.rotation_camera_world;
  for (std::size_t k = 0; k < 3; ++k) {
    camera.rotation_camera_world[k] = c * r[k] + s * r[3 + k];
    camera.rotation_camera_world[3 + k] = -s * r[k] + c * r[3 + k];
  }
  const double x = place.cx - place.width / 2.0 - shift_x * from, y = place.cy - place.height / 2.0 - shift_y * from;
  camera.fx = place.fx * zoom;
  camera.fy = place.fy * zoom;
  camera.cx = width / 2.0 + zoom * (c * x + s * y);
  camera.cy = height / 2.0 + zoom * (-s * x + c * y);
  return camera;
}

}  // namespace detail

/// The size at which a place is rendered for the search.
[[nodiscard]] inline Camera<double> search_camera(const Camera<double>& camera) {
  const double scale = detail::field_scale(camera.width, camera.height);
  return camera.resized(std::max(4, static_cast<int>(std::lround(camera.width / scale))),
                        std::max(4, static_cast<int>(std::lround(camera.height / scale))));
}

/// A place from the render of search_camera(camera), [3, height, width].
template <class T>
[[nodiscard]] SearchPlace search_place(const Camera<double>& camera, ImageView<const float> render,
                                       BasicFieldTransform<T>& transform) {
  SearchPlace place{camera,
                    gradient_field(detail::grey_of(render), {}, render.width, render.height,
                                   (field_side - render.width) / 2, (field_side - render.height) / 2),
                    0};
  transform.forward(place.field);
  return place;
}

/// The `wanted` most alike places for a picture [3, height, width], best first, each with its best turn, scale and
/// shift; none for a picture of one colour. Ties go to the earlier place; same order at any thread count.
template <Executor E>
[[nodiscard]] std::vector<SearchMatch> search_cameras(std::span<const SearchPlace> places,
                                                      ImageView<const float> picture, const SearchSettings& settings,
                                                      std::size_t wanted, E& executor) {
  // Shrunk to twice the field's size, so that turning samples little more than a pixel.
  const double shrink = std::max(1.0, detail::field_scale(picture.width, picture.height) / 1.5);
  const int width = std::max(4, static_cast<int>(std::lround(picture.width / shrink))),
            height = std::max(4, static_cast<int>(std::lround(picture.height / shrink)));
  std::vector<float> small(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const ImageView<float> view{small.data(), 3, height, width};
  AreaResize<float> resize;
  if (width > picture.width || height > picture.height) return {};
  resize.forward(picture, view, executor);
  const std::vector<float> grey = detail::grey_of(view);
  const double fields = detail::field_scale(width, height);

  struct Variant {
    double angle, scale;
    ComplexField field;
  };
  std::vector<Variant> variants;
  FieldTransform transform;
  for (const double turn : settings.turns_degrees) {
    for (const double scale : settings.scales) {
      const double angle = turn * std::numbers::pi / 180;
      variants.push_back({angle, scale, detail::turned_field(grey, width, height, angle, scale / fields)});
      transform.forward(variants.back().field);
    }
  }
  std::vector<SearchMatch> best(places.size());
  executor.for_chunks(places.size(), 8, [&](std::size_t begin, std::size_t end, std::size_t) {
    FieldTransform own;
    for (std::size_t p = begin; p < end; ++p) {
      for (const Variant& variant : variants) {
        const FieldTransform::Peak peak = own.peak(variant.field, places[p].field);
        if (!(peak.value > best[p].likeness)) continue;
        // A place's render of an odd side lies half a pixel beside the middle of the square (search_place).
        const Camera<double> drawn = search_camera(places[p].camera);
        best[p] = {detail::matched_camera(places[p].camera, picture.width, picture.height, variant.angle, variant.scale,
                                          peak.x + 0.5 * (drawn.width & 1), peak.y + 0.5 * (drawn.height & 1)),
                   peak.value, p};
      }
    }
  });
  // A picture without an edge is like no place.
  std::erase_if(best, [](const SearchMatch& match) { return !(match.likeness > 0); });
  std::stable_sort(best.begin(), best.end(),
                   [](const SearchMatch& a, const SearchMatch& b) { return a.likeness > b.likeness; });
  best.resize(std::min(best.size(), wanted));
  return best;
}

}  // namespace compmark
