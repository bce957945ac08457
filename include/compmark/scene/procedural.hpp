// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The built-in scene: a still life of textured solids on a turntable, ray-traced from formulas, so that everything can
// be tried and measured without any data. It is made to be informative: fine textures (checker, stripes, veins, ticks)
// beside smooth ones, saturated colours beside greys, soft shadows, and a weak highlight that depends on the view.
// Geometry and cameras are exact. World frame: z up, everything within radius 1.3 of the origin. Colours are computed
// linearly and stored as sRGB.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/scene/solid.hpp"
#include "compmark/scene/value_noise.hpp"

namespace compmark {

/// What a surface point looks like.
enum class Texture { plain, checker, stripes, marble, turntable, chart, wood, bands };

struct Material {
  Texture texture = Texture::plain;
  Vector3 first{0.5, 0.5, 0.5};   ///< linear RGB
  Vector3 second{0.1, 0.1, 0.1};  ///< the other colour of a pattern
  double frequency = 10;          ///< repeats per unit length (or per turn)
  double specular = 0.1;          ///< strength of the highlight
  double shininess = 40;          ///< Blinn-Phong exponent
};

struct SceneObject {
  Solid solid;
  Material material;
};

/// Nearest intersection of a ray with the scene.
struct SceneHit {
  double distance = 0;
  Vector3 point;
  Vector3 normal;
  std::size_t object = 0;
};

/// The scene of a seed: seeds differ in the pattern of the veins and in nothing else. Cost of a ray: ~0.15 us with its
/// shadow.
class ProceduralScene {
 public:
  static constexpr std::size_t light_samples = 16;

  explicit ProceduralScene(std::uint64_t seed = 0) : noise_(Random(seed, 0, random_stage("procedural texture"))) {
    build();
  }

  /// Lattice cells of the noise: marble has five octaves, wood three and its grain, the cloth two. The colours are the
  /// same with a new memory for every sample and with one for a whole picture. Belongs to one thread.
  using NoiseMemory = std::array<ValueNoise::Cell, 11>;

  [[nodiscard]] const std::vector<SceneObject>& objects() const { return objects_; }

  [[nodiscard]] std::optional<SceneHit> trace(const Vector3& origin, const Vector3& direction) const {
    return trace(origin, direction, ~std::uint32_t{0});
  }

  /// The same among the objects whose bit is set in `candidates`.
  [[nodiscard]] std::optional<SceneHit> trace(const Vector3& origin, const Vector3& direction,
                                              std::uint32_t candidates) const {
    SceneHit hit;
    hit.distance = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < objects_.size(); ++i) {
      if ((candidates >> i & 1u) == 0) continue;
      const std::optional<SolidHit> found = objects_[i].solid.intersect(origin, direction, hit.distance);
      if (!found) continue;
      hit = {found->distance, origin + direction * found->distance, found->normal, i};
    }
    if (hit.distance == std::numeric_limits<double>::infinity()) return std::nullopt;
    return hit;
  }

  /// Bit i is set if object i may be hit by a ray from `origin` that leaves `direction` by at most `spread` (a tangent,
  /// small).
  [[nodiscard]] std::uint32_t candidates(const Vector3& origin, const Vector3& direction, double spread) const {
    static_assert(sizeof(std::uint32_t) * 8 >= object_count, "one bit for each object");
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < objects_.size(); ++i) {
      const Vector3 to = objects_[i].solid.center() - origin;
      const double along = dot(to, direction);
      const double bound = objects_[i].solid.bounding_radius();
      const double reach = bound + (std::abs(along) + bound) * spread;
      if (dot(to, to) - along * along <= reach * reach) bits |= std::uint32_t{1} << i;
    }
    return bits;
  }

  /// Whether anything stands within 10 units of a ray with unit direction. The bounding spheres of all objects are
  /// tried first, as lanes.
  [[nodiscard]] bool occluded(const Vector3& origin, const Vector3& direction) const {
    std::array<double, object_count> near;
    for (std::size_t i = 0; i < object_count; ++i) {
      const double x = origin.x - centers_[0][i], y = origin.y - centers_[1][i], z = origin.z - centers_[2][i];
      const double along = x * direction.x + y * direction.y + z * direction.z;
      const double distance2 = x * x + y * y + z * z;
      // In front, or the ray starts within. The margin lets no hit go by that Solid::intersect would find.
      const double ahead = along < 0 ? along * along : 0.0;
      near[i] = bound2_[i] * (1 + 1e-9) + 1e-9 - (distance2 - ahead);
    }
    for (std::size_t i = 0; i < object_count; ++i) {
      if (near[i] > 0 && objects_[i].solid.intersect(origin, direction, 10.0)) return true;
    }
    return false;
  }

  /// Linear radiance at a hit towards `direction` reversed. `light_sample` in [0, light_samples) picks a place on the
  /// lamp's disc, so that the samples of one pixel together make a soft shadow.
  [[nodiscard]] Vector3 shade(const SceneHit& hit, const Vector3& direction, std::size_t light_sample) const {
    NoiseMemory memory;
    return shade(hit, direction, light_sample, memory);
  }

  /// The same with a memory, which is for this scene alone.
  [[nodiscard]] Vector3 shade(const SceneHit& hit, const Vector3& direction, std::size_t light_sample,
                              NoiseMemory& memory) const {
    const SceneObject& object = objects_[hit.object];
    const Vector3 albedo = color(object, hit, memory);
    const Vector3 to_lamp = lamp_[light_sample % light_samples] - hit.point;
    const Vector3 light = normalized(to_lamp);
    const double facing = dot(hit.normal, light);
    const bool lit = facing > 0 && !occluded(hit.point + hit.normal * 1e-6, light);
    const double sky = 0.5 + 0.5 * hit.normal[2];
    Vector3 radiance =
        albedo * (Vector3{0.42, 0.46, 0.54} * sky + Vector3{0.19, 0.17, 0.15} * (1 - sky)) * ambient_occlusion(hit);
    if (lit) {
      radiance = radiance + albedo * Vector3{0.82, 0.77, 0.70} * facing;
      const double towards = dot(hit.normal, normalized(light - direction));
      if (towards > 0 && object.material.specular > 0)
        radiance =
            radiance + Vector3{1, 1, 1} * (object.material.specular * std::pow(towards, object.material.shininess));
    }
    return radiance;
  }

 private:
  static constexpr double table = -0.55;  // height of the turntable's top
  static constexpr std::size_t object_count = 12;

  void add(const Solid& solid, const Material& material) {
    const std::size_t i = objects_.size();
    objects_.push_back({solid, material});
    for (std::size_t c = 0; c < 3; ++c) centers_[c][i] = solid.center()[c];
    bound2_[i] = solid.bounding_radius() * solid.bounding_radius();
    inner2_[i] = solid.inner_radius() * solid.inner_radius();
  }

  void build() {
    for (std::size_t sample = 0; sample < light_samples; ++sample) lamp_[sample] = lamp_position(sample);
    add(Solid::cylinder({0, 0, table - 0.05}, 1.12, 0.05),
        {Texture::turntable, {0.42, 0.40, 0.37}, {0.25, 0.24, 0.235}, 72, 0.03, 20});
    add(Solid::sphere({-0.40, 0.42, table + 0.40}, 0.40),
        {Texture::marble, {0.72, 0.74, 0.78}, {0.03, 0.07, 0.26}, 3.2, 0.25, 90});
    add(Solid::sphere({0.60, -0.40, table + 0.21}, 0.21), {Texture::plain, {0.72, 0.02, 0.025}, {}, 0, 0.35, 120});
    add(Solid::cylinder({0.44, 0.44, table + 0.36}, 0.22, 0.36),
        {Texture::checker, {0.85, 0.55, 0.02}, {0.015, 0.013, 0.012}, 12, 0.08, 30});
    add(Solid::sphere({0.44, 0.44, table + 0.72 + 0.15}, 0.15), {Texture::plain, {0.18, 0.18, 0.18}, {}, 0, 0.15, 50});
    add(Solid::torus({-0.62, -0.32, table + 0.095}, 0.24, 0.095),
        {Texture::bands, {0.80, 0.17, 0.01}, {0.01, 0.26, 0.30}, 6, 0.2, 60});
    add(Solid::box({-0.02, -0.12, table + 0.20}, {0.20, 0.15, 0.20}, 0.5),
        {Texture::stripes, {0.70, 0.70, 0.68}, {0.02, 0.10, 0.45}, 17, 0.05, 20});
    add(Solid::box({-0.02, -0.12, table + 0.40 + 0.11}, {0.11, 0.11, 0.11}, 1.1),
        {Texture::plain, {0.02, 0.36, 0.06}, {}, 0, 0.1, 30});
    add(Solid::box({0.02, -0.78, table + 0.02}, {0.30, 0.20, 0.02}, 0.0), {Texture::chart, {}, {}, 6, 0.0, 1});
    add(Solid::box({-0.08, 0.88, table + 0.24}, {0.07, 0.07, 0.24}, 0.3),
        {Texture::wood, {0.42, 0.20, 0.07}, {0.16, 0.06, 0.02}, 22, 0.05, 20});
    add(Solid::sphere({-0.98, 0.10, table + 0.06}, 0.06), {Texture::plain, {0.60, 0.01, 0.42}, {}, 0, 0.3, 80});
    add(Solid::sphere({0.93, 0.12, table + 0.08}, 0.08), {Texture::plain, {0.01, 0.42, 0.55}, {}, 0, 0.3, 80});
  }

  /// Sunflower points on a disc of radius 0.45 facing the scene.
  static Vector3 lamp_position(std::size_t sample) {
    const double k = static_cast<double>(sample % light_samples) + 0.5;
    const double radius = 0.45 * std::sqrt(k / static_cast<double>(light_samples));
    const double angle = k * 2.399963229728653;
    return Vector3{2.2, -2.6, 4.2} + Vector3{radius * std::cos(angle), radius * std::sin(angle), 0};
  }

  /// Smooth darkening near other solids, from their bounding spheres (exact for spheres above the horizon): 1 - sum cos
  /// (r / d)^2. The turntable, object 0, darkens nothing.
  [[nodiscard]] double ambient_occlusion(const SceneHit& hit) const {
    std::array<double, object_count> factors;
    for (std::size_t i = 0; i < object_count; ++i) {
      const double x = centers_[0][i] - hit.point.x, y = centers_[1][i] - hit.point.y, z = centers_[2][i] - hit.point.z;
      const double d2 = x * x + y * y + z * z;
      const double cosine = (hit.normal.x * x + hit.normal.y * y + hit.normal.z * z) / std::sqrt(d2);
      factors[i] = cosine > 0 ? 1 - 0.8 * cosine * std::min(1.0, inner2_[i] / d2) : 1.0;
    }
    double open = 1;
    for (std::size_t i = 1; i < object_count; ++i) open *= i == hit.object ? 1.0 : factors[i];
    return open;
  }

  [[nodiscard]] Vector3 color(const SceneObject& object, const SceneHit& hit, NoiseMemory& memory) const;

  /// Octave i remembers in memory[first + i].
  [[nodiscard]] double turbulence(Vector3 p, std::size_t octaves, NoiseMemory& memory, std::size_t first) const {
    double sum = 0;
    double amplitude = 0.5;
    for (std::size_t i = 0; i < octaves; ++i, amplitude *= 0.5, p = p * 2.03)
      sum += amplitude * noise_.at(p, memory[first + i]);
    return sum;
  }

  ValueNoise noise_;
  std::vector<SceneObject> objects_;
  std::array<Vector3, light_samples> lamp_;
  // Of the objects: centres by component, squared radii of the bounding spheres and of those that stand for the bulk.
  std::array<std::array<double, object_count>, 3> centers_{};
  std::array<double, object_count> bound2_{}, inner2_{};
};

namespace detail {
[[nodiscard]] inline Vector3 mix(const Vector3& a, const Vector3& b, double t) { return a * (1 - t) + b * t; }
[[nodiscard]] inline double smoothstep(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}
[[nodiscard]] inline bool odd(double x) { return std::fmod(std::abs(std::floor(x)), 2.0) == 1.0; }
}  // namespace detail

inline Vector3 ProceduralScene::color(const SceneObject& object, const SceneHit& hit, NoiseMemory& memory) const {
  using std::numbers::pi;
  const Material& m = object.material;
  const Vector3 local = object.solid.to_local(hit.point);
  const auto angle = [&] { return std::atan2(local[1], local[0]) / (2 * pi); };  // turns
  switch (m.texture) {
    case Texture::plain:
      return m.first;
    case Texture::checker: {  // around the side by angle, on the lid by plane coordinates
      const bool lid = std::abs(hit.normal[2]) > 0.5;
      const double u = lid ? local[0] * m.frequency : angle() * 2 * m.frequency;
      const double v = (lid ? local[1] : local[2]) * m.frequency * (lid ? 1 : 1.45);
      return detail::odd(u) != detail::odd(v) ? m.first : m.second;
    }
    case Texture::stripes:
      return detail::odd((local[0] + local[1] + local[2]) * m.frequency) ? m.first : m.second;
    case Texture::bands:
      return detail::mix(m.first, m.second, 0.5 + 0.5 * std::sin(2 * pi * m.frequency * angle()));
    case Texture::marble: {
      const double vein =
          std::sin(pi * m.frequency * (local[0] + local[2] + 1.9 * turbulence(local * 4.1, 5, memory, 0)));
      return detail::mix(m.second, m.first, std::pow(std::abs(vein), 0.55));
    }
    case Texture::wood: {
      const double ring = std::hypot(local[0] + 0.15, local[1] - 0.1) +
                          0.05 * turbulence({local[0] * 9, local[1] * 9, local[2] * 1.7}, 3, memory, 5);
      const double t = ring * m.frequency - std::floor(ring * m.frequency);
      return detail::mix(m.first, m.second, t * t) *
             (0.8 + 0.4 * noise_.at({local[0] * 60, local[1] * 60, local[2] * 5}, memory[8]));
    }
    case Texture::turntable: {  // degree marks at the rim, a fine checker in the middle, speckled cloth between
      const double radius = std::hypot(local[0], local[1]);
      const double speckle = 0.88 + 0.24 * turbulence(local * 38.0, 2, memory, 9);
      if (radius > 0.985 && radius < 1.09) {
        const double turn = angle() * m.frequency;
        const double tick = std::abs(turn - std::nearbyint(turn));
        const bool major = std::fmod(std::abs(std::nearbyint(turn)), 6.0) == 0.0;
        if (tick < (major ? 0.13 : 0.07) && radius > (major ? 1.0 : 1.04)) return {0.03, 0.03, 0.035};
        return Vector3{0.62, 0.60, 0.56} * speckle;
      }
      const bool fine = radius < 0.97 && detail::odd(local[0] * 8 + 100) != detail::odd(local[1] * 8 + 100);
      return (fine ? m.first : m.second) * speckle;
    }
    case Texture::chart: {  // six hues, their pale versions, six greys
      static constexpr std::array<std::array<double, 3>, 6> hues{{{0.75, 0.02, 0.02},
                                                                  {0.78, 0.34, 0.01},
                                                                  {0.72, 0.66, 0.02},
                                                                  {0.04, 0.48, 0.06},
                                                                  {0.02, 0.12, 0.62},
                                                                  {0.40, 0.03, 0.45}}};
      const double u = (local[0] + 0.30) / 0.60 * 6;
      const double v = (local[1] + 0.20) / 0.40 * 3;
      const double edge = std::min(std::abs(u - std::nearbyint(u)), std::abs(v - std::nearbyint(v)));
      if (edge < 0.07 || hit.normal[2] < 0.5) return {0.012, 0.012, 0.013};
      const std::size_t column = static_cast<std::size_t>(std::clamp(u, 0.0, 5.99));
      const Vector3 hue{hues[column][0], hues[column][1], hues[column][2]};
      if (v >= 2) return hue;
      if (v >= 1) return detail::mix(hue, {0.75, 0.75, 0.75}, 0.6);
      const double grey = std::pow(0.5, static_cast<double>(column)) * 0.85;
      return {grey, grey, grey};
    }
  }
  return m.first;
}

}  // namespace compmark
