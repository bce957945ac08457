// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Solids with exact ray intersections for the built-in scene: sphere, box turned about z, capped cylinder along z,
// torus about z. All but the torus are closed forms; the torus is found by marching its exact distance function (Hart
// 1996) to 1e-9.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

namespace compmark {

/// Three doubles with the arithmetic of vectors; products are component by component.
struct Vector3 {
  double x = 0, y = 0, z = 0;

  constexpr double operator[](std::size_t i) const { return i == 0 ? x : i == 1 ? y : z; }
  friend constexpr Vector3 operator+(const Vector3& a, const Vector3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend constexpr Vector3 operator-(const Vector3& a, const Vector3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend constexpr Vector3 operator*(const Vector3& a, const Vector3& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  friend constexpr Vector3 operator*(const Vector3& a, double s) { return {a.x * s, a.y * s, a.z * s}; }
};
[[nodiscard]] constexpr double dot(const Vector3& a, const Vector3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
[[nodiscard]] constexpr Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
[[nodiscard]] inline Vector3 normalized(const Vector3& a) { return a * (1 / std::sqrt(dot(a, a))); }

struct SolidHit {
  double distance = 0;
  Vector3 normal;  ///< outward, unit
};

class Solid {
 public:
  [[nodiscard]] static Solid sphere(const Vector3& center, double radius) {
    return Solid(Kind::sphere, center, {radius, 0, 0}, 0, radius, radius);
  }
  /// Half sizes along its own axes, turned by `angle` about z.
  [[nodiscard]] static Solid box(const Vector3& center, const Vector3& half, double angle) {
    return Solid(Kind::box, center, half, angle, std::sqrt(dot(half, half)), std::min({half.x, half.y, half.z}) * 1.2);
  }
  [[nodiscard]] static Solid cylinder(const Vector3& center, double radius, double half_height) {
    return Solid(Kind::cylinder, center, {radius, half_height, 0}, 0, std::hypot(radius, half_height),
                 std::min(radius, half_height) * 1.1);
  }
  [[nodiscard]] static Solid torus(const Vector3& center, double ring, double tube) {
    return Solid(Kind::torus, center, {ring, tube, 0}, 0, ring + tube, tube);
  }

  [[nodiscard]] const Vector3& center() const { return center_; }
  [[nodiscard]] double bounding_radius() const { return bound_; }
  /// A sphere of roughly this size stands for the solid where only its bulk matters.
  [[nodiscard]] double inner_radius() const { return inner_; }
  /// A world point in the solid's own axes.
  [[nodiscard]] Vector3 to_local(const Vector3& point) const { return turn(point - center_, -sine_); }

  /// First hit with 0 < distance < limit of a ray with unit direction that starts outside.
  [[nodiscard]] std::optional<SolidHit> intersect(const Vector3& origin, const Vector3& direction, double limit) const {
    const Vector3 to = origin - center_;
    const double along = dot(to, direction);
    const double discriminant = bound_ * bound_ - (dot(to, to) - along * along);
    if (discriminant <= 0) return std::nullopt;
    const double half_chord = std::sqrt(discriminant);
    if (-along + half_chord <= 0 || -along - half_chord >= limit) return std::nullopt;
    if (kind_ == Kind::sphere) {
      const double t = -along - half_chord;
      if (t <= 0) return std::nullopt;
      return SolidHit{t, (to + direction * t) * (1 / bound_)};
    }
    const Vector3 o = turn(to, -sine_);
    const Vector3 d = turn(direction, -sine_);
    std::optional<SolidHit> hit = kind_ == Kind::box ? hit_box(o, d)
                                  : kind_ == Kind::cylinder
                                      ? hit_cylinder(o, d)
                                      : hit_torus(o, d, std::max(0.0, -along - half_chord), -along + half_chord);
    if (!hit || hit->distance >= limit) return std::nullopt;
    hit->normal = turn(hit->normal, sine_);
    return hit;
  }

 private:
  enum class Kind { sphere, box, cylinder, torus };
  Solid(Kind kind, const Vector3& center, const Vector3& size, double angle, double bound, double inner)
      : kind_(kind),
        center_(center),
        size_(size),
        cosine_(std::cos(angle)),
        sine_(std::sin(angle)),
        bound_(bound),
        inner_(inner) {}

  [[nodiscard]] Vector3 turn(const Vector3& v, double sine) const {
    return {cosine_ * v.x - sine * v.y, sine * v.x + cosine_ * v.y, v.z};
  }

  [[nodiscard]] std::optional<SolidHit> hit_box(const Vector3& o, const Vector3& d) const {
    double enter = 0;
    double leave = 1e30;
    Vector3 normal;
    bool outside = false;
    for (std::size_t c = 0; c < 3; ++c) {
      const double inverse = 1 / (d[c] != 0 ? d[c] : 1e-300);
      const double near = (-std::copysign(size_[c], d[c]) - o[c]) * inverse;
      const double far = (std::copysign(size_[c], d[c]) - o[c]) * inverse;
      if (near > enter) {
        enter = near;
        outside = true;
        const double sign = d[c] > 0 ? -1 : 1;
        normal = {c == 0 ? sign : 0, c == 1 ? sign : 0, c == 2 ? sign : 0};
      }
      leave = std::min(leave, far);
    }
    if (!outside || enter >= leave) return std::nullopt;
    return SolidHit{enter, normal};
  }

  [[nodiscard]] std::optional<SolidHit> hit_cylinder(const Vector3& o, const Vector3& d) const {
    const double radius = size_.x;
    const double half = size_.y;
    const double a = d.x * d.x + d.y * d.y;
    const double b = o.x * d.x + o.y * d.y;
    const double discriminant = b * b - a * (o.x * o.x + o.y * o.y - radius * radius);
    if (a > 1e-18 && discriminant > 0) {
      const double t = (-b - std::sqrt(discriminant)) / a;
      const double z = o.z + t * d.z;
      if (t > 0 && std::abs(z) <= half) return SolidHit{t, Vector3{o.x + t * d.x, o.y + t * d.y, 0} * (1 / radius)};
    }
    if (d.z == 0) return std::nullopt;
    const double t = (-std::copysign(half, d.z) - o.z) / d.z;
    const double x = o.x + t * d.x;
    const double y = o.y + t * d.y;
    if (t <= 0 || x * x + y * y > radius * radius) return std::nullopt;
    return SolidHit{t, {0, 0, d.z > 0 ? -1.0 : 1.0}};
  }

  [[nodiscard]] std::optional<SolidHit> hit_torus(const Vector3& o, const Vector3& d, double begin, double end) const {
    double t = begin;
    for (int step = 0; step < 4000 && t < end;
         ++step) {  // ~10 steps as a rule; thousands for a ray that grazes the surface
      const Vector3 p = o + d * t;
      const double in_plane = std::sqrt(p.x * p.x + p.y * p.y);
      const double off_ring = in_plane - size_.x;
      const double distance = std::sqrt(off_ring * off_ring + p.z * p.z) - size_.y;
      if (distance < 1e-9) {
        if (t == 0) return std::nullopt;  // starts on the surface: a shadow ray leaving it
        const double towards = in_plane > 0 ? off_ring / in_plane : 0;
        return SolidHit{t, normalized(Vector3{p.x * towards, p.y * towards, p.z})};
      }
      t += distance;
    }
    return std::nullopt;
  }

  Kind kind_;
  Vector3 center_;
  Vector3 size_;
  double cosine_;
  double sine_;
  double bound_;
  double inner_;
};

}  // namespace compmark
