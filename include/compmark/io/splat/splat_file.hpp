// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What every reader of a splat file gives, and what they share (docs/splat_formats.md): explicit Gaussians in the frame
// that they were trained in (that of the standard PLY: x right, y down, z forward where the capture was upright), with
// rotations of norm 1. Values that no renderer can use are refused with the splat that has them.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/math/spherical_harmonics.hpp"
#include "compmark/scene/splat_table.hpp"

namespace compmark {

enum class SplatFormat { ply, compressed_ply, splat, ksplat, spz, sog, glb };

/// How people call it, with its article.
[[nodiscard]] inline std::string_view splat_format_name(SplatFormat format) {
  constexpr std::array<std::string_view, 7> names{"a 3DGS PLY",  "a compressed PLY", "a .splat file", "a .ksplat file",
                                                  "an SPZ file", "a SOG file",       "a .glb file"};
  return names[static_cast<std::size_t>(format)];
}

/// A splat file that was read.
struct SplatFile {
  SplatTable table;  ///< rotations of norm 1; every number is finite but for log scales of -inf and logits of +-inf
  SplatFormat format = SplatFormat::ply;
  int version = 0;                          ///< of SPZ and SOG; the compression level of a .ksplat; 0 for the others
  bool antialiased = false;                 ///< it says that it was trained with the mip filter
  std::optional<std::array<double, 3>> up;  ///< of length 1, where the file says so (splat_up_comment)
  std::vector<std::string> notes;           ///< what the file holds and the table does not, a sentence each
};

namespace detail {

/// Error of a splat file, in one line of the readers.
[[nodiscard]] inline Error splat_error(ErrorKind kind, const std::string& file, std::string field, std::string problem,
                                       std::string remedy = "copy or export it again") {
  return {kind, file, std::move(field), std::move(problem), std::move(remedy)};
}

/// f_dc of a colour in [0, 1], as it is seen without the other harmonics.
[[nodiscard]] inline float dc_of_color(double color) { return static_cast<float>((color - 0.5) / sh_constant); }

/// The logit of an opacity; 0 and 1 become 1e-6 and 1 - 1e-6, as all converters have it (+-13.8155).
[[nodiscard]] inline float logit_of_opacity(double opacity) {
  const double inside = std::fmin(std::fmax(opacity, 1e-6), 1 - 1e-6);
  return static_cast<float>(std::log(inside / (1 - inside)));
}
/// Of all opacities that a byte holds.
[[nodiscard]] inline std::array<float, 256> byte_logits() {
  std::array<float, 256> logits{};
  for (std::size_t i = 0; i < logits.size(); ++i) logits[i] = logit_of_opacity(static_cast<double>(i) / 255);
  return logits;
}

/// A unit quaternion from its components without the largest, which is positive, in their order.
[[nodiscard]] inline std::array<double, 4> with_largest(std::size_t largest, const std::array<double, 3>& others) {
  std::array<double, 4> q{};
  double left = 1;
  for (std::size_t i = 0, k = 0; i < 4; ++i) {
    if (i == largest) continue;
    q[i] = others[k++];
    left -= q[i] * q[i];
  }
  q[largest] = std::sqrt(std::fmax(0.0, left));
  return q;
}

/// The columns of a table beside their names in the standard PLY, in its order; normals are missing here.
template <class Table, class F>
void for_each_splat_column(Table& table, const F& f) {
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (std::size_t i = 0; i < 3; ++i) f(axes[i], table.mean[i]);
  for (std::size_t c = 0; c < 3; ++c) f("f_dc_" + std::to_string(c), table.color(c, 0));
  const std::size_t rest = table.coefficients() - 1;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < rest; ++i) f("f_rest_" + std::to_string(c * rest + i), table.color(c, i + 1));
  }
  f("opacity", table.opacity);
  for (std::size_t i = 0; i < 3; ++i) f("scale_" + std::to_string(i), table.log_scale[i]);
  for (std::size_t i = 0; i < 4; ++i) f("rot_" + std::to_string(i), table.rotation[i]);
}

/// The norm of a row's rotation.
[[nodiscard]] inline double rotation_norm(const SplatTable& table, std::size_t row) {
  double square = 0;
  for (const std::vector<float>& column : table.rotation)
    square += static_cast<double>(column[row]) * static_cast<double>(column[row]);
  return std::sqrt(square);
}

/// Checks every number. Error: the first value of a column that is NaN or infinite (a log scale may be -infinity: flat;
/// a logit +-infinity: opaque, unseen), or a rotation of norm zero, and the splat that has it. Cost: a pass over the
/// table.
[[nodiscard]] inline Result<Done> check_splats(const SplatTable& table, const std::string& file) {
  std::optional<Error> failure;
  constexpr const char* remedy = "remove such splats first, for instance with splat-transform --filter-nan";
  for_each_splat_column(table, [&](const std::string& name, const std::vector<float>& column) {
    if (failure) return;
    const bool logit = name == "opacity", scale = name.starts_with("scale_");
    for (std::size_t i = 0; i < column.size(); ++i) {
      const float value = column[i];
      if (std::isfinite(value) || (logit && !std::isnan(value)) || (scale && value < 0)) continue;
      failure = splat_error(
          ErrorKind::invalid, file, name,
          "is " + std::string(std::isnan(value) ? "NaN" : "infinite") + " in splat " + std::to_string(i), remedy);
      return;
    }
  });
  if (failure) return *failure;
  for (std::size_t i = 0; i < table.count; ++i) {
    if (!(rotation_norm(table, i) > 0))
      return splat_error(ErrorKind::invalid, file, "rot_0", "the rotation of splat " + std::to_string(i) + " is zero",
                         remedy);
  }
  return Done{};
}

/// Checks every number (check_splats) and normalises the rotations.
[[nodiscard]] inline Result<Done> finish_splats(SplatTable& table, const std::string& file) {
  if (const Result<Done> usable = check_splats(table, file); !usable) return usable.error();
  for (std::size_t i = 0; i < table.count; ++i) {
    const double norm = rotation_norm(table, i);
    for (std::vector<float>& column : table.rotation)
      column[i] = static_cast<float>(static_cast<double>(column[i]) / norm);
  }
  return Done{};
}

/// Signs of the axes of a frame against that of training.
using AxisSigns = std::array<int, 3>;

/// What a change of the signs of the axes does to the numbers of a splat: each is multiplied by 1 or -1.
struct SplatSigns {
  std::array<float, 3> mean{1, 1, 1};
  std::array<float, 4> rotation{1, 1, 1, 1};  ///< w x y z
  std::array<float, 16> harmonics{};          ///< all 1 in the frame of training
};

/// x' = S x, R' = S R S, and every harmonic by its parity.
[[nodiscard]] inline SplatSigns splat_signs(const AxisSigns& axes) {
  // The axes that occur an odd number of times in harmonic i: bit 0 is x.
  constexpr std::array<unsigned, 16> odd{0, 2, 4, 1, 3, 6, 0, 5, 0, 2, 7, 2, 4, 1, 4, 1};
  const auto sign_of = [&](unsigned of) {
    int sign = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) sign *= (of >> axis & 1u) != 0 ? axes[axis] : 1;
    return static_cast<float>(sign);
  };
  SplatSigns signs;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    signs.mean[axis] = sign_of(1u << axis);
    // The axis of a rotation is a pseudovector: its component along an axis turns with the other two.
    signs.rotation[axis + 1] = sign_of(7u & ~(1u << axis));
  }
  for (std::size_t i = 0; i < odd.size(); ++i) signs.harmonics[i] = sign_of(odd[i]);
  return signs;
}

/// Turns (or mirrors) the table by the signs of its axes.
inline void change_axes(SplatTable& table, const AxisSigns& axes) {
  const SplatSigns signs = splat_signs(axes);
  const auto turn = [](std::vector<float>& column, float sign) {
    if (sign > 0) return;
    for (float& value : column) value = -value;
  };
  for (std::size_t axis = 0; axis < 3; ++axis) turn(table.mean[axis], signs.mean[axis]);
  for (std::size_t k = 1; k < 4; ++k) turn(table.rotation[k], signs.rotation[k]);
  for (std::size_t i = 1; i < table.coefficients(); ++i) {
    for (std::size_t channel = 0; channel < 3; ++channel) turn(table.color(channel, i), signs.harmonics[i]);
  }
}

}  // namespace detail

}  // namespace compmark
