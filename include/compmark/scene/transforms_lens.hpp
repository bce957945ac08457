// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The lens of a frame of transforms*.json, in all dialects (docs/spec/formats.md, 4): k1 … k6 p1 p2, or
// distortion_params [k1 k2 k3 k4 p1 p2], of the camera_model (OPENCV if not named). nerfstudio's names of perspective
// cameras are one model there, so coefficients beside PINHOLE count. What cannot be used is refused and never dropped:
// a lens that is ignored looks like a bad reconstruction.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "compmark/core/result.hpp"
#include "compmark/scene/lens_model.hpp"
#include "compmark/scene/transforms_camera.hpp"
#include "compmark/scene/transforms_json.hpp"

namespace compmark {
namespace detail {

/// Nothing if the file asks for no lens that only other programs know: instant-ngp's f-theta polynomial and its maps of
/// the sphere.
template <class Json>
[[nodiscard]] Result<Done> no_foreign_lens(const TransformsFields<Json>& fields) {
  for (const std::string& key : fields.keys_from("ftheta_")) {
    if (!switched_off(*fields.find(key.c_str())))
      return fields.error(ErrorKind::unsupported, key.c_str(), "belongs to an f-theta lens, which is not read",
                          "undistort the images, or fit a camera of the model OPENCV_FISHEYE to them");
  }
  for (const char* key : {"latlong", "equirectangular", "orthographic"}) {
    const Json* value = fields.find(key);
    if (value != nullptr && !switched_off(*value))
      return fields.error(ErrorKind::unsupported, key, "says that the images have no perspective",
                          "export perspective or fisheye images (cut panoramas into perspective views)");
  }
  return Done{};
}

/// Coefficients by name, or by their place in distortion_params where they have no field of their own.
struct TransformsCoefficients {
  static constexpr std::array<const char*, 8> names{"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"};
  std::array<double, 8> value{};
  std::array<const char*, 8> field{names};  ///< where each came from
};

template <class Json>
[[nodiscard]] Result<TransformsCoefficients> transforms_coefficients(const TransformsFields<Json>& fields) {
  constexpr std::array<std::size_t, 6> order{0, 1, 2, 3, 6, 7};
  TransformsCoefficients k;
  if (const Json* list = fields.find("distortion_params"); list != nullptr && !list->is_null()) {
    if (!list->is_array() || list->size() > order.size())
      return fields.error(ErrorKind::malformed, "distortion_params", "is not a list of up to 6 numbers",
                          "give [k1, k2, k3, k4, p1, p2]");
    for (std::size_t i = 0; i < list->size(); ++i) {
      const std::optional<double> value = finite_number((*list)[i]);
      if (!value)
        return fields.error(ErrorKind::invalid, "distortion_params", "holds something that is not a finite number",
                            "give [k1, k2, k3, k4, p1, p2]");
      k.value[order[i]] = *value;
      k.field[order[i]] = "distortion_params";
    }
  }
  for (std::size_t i = 0; i < k.names.size(); ++i) {
    const auto value = fields.number(k.names[i], -1e6, 1e6, "is not a distortion coefficient", "give a finite number");
    if (!value) return value.error();
    if (!*value) continue;
    k.value[i] = **value;
    k.field[i] = k.names[i];
  }
  return k;
}

/// The lens of a frame.
template <class Json>
[[nodiscard]] Result<Lens> transforms_lens(const TransformsFields<Json>& fields) {
  if (const Result<Done> ours = no_foreign_lens(fields); !ours) return ours.error();
  std::string model = "OPENCV";
  if (const Json* named = fields.find("camera_model"); named != nullptr) {
    if (!named->is_string())
      return fields.error(ErrorKind::malformed, "camera_model", "is not a name",
                          "use \"OPENCV\" or \"OPENCV_FISHEYE\"");
    model = named->template get<std::string>();
  }
  const Result<TransformsCoefficients> coefficients = transforms_coefficients(fields);
  if (!coefficients) return coefficients.error();
  const std::array<double, 8>& k = coefficients->value;

  const auto one_of = [&](const auto& names) { return std::find(names.begin(), names.end(), model) != names.end(); };
  constexpr std::array<std::string_view, 6> perspective{"OPENCV",         "PERSPECTIVE",   "PINHOLE",
                                                        "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"};
  constexpr std::array<std::string_view, 3> fisheye{"OPENCV_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE"};
  if (const Json* flag = fields.find("is_fisheye"); flag != nullptr) {
    if (!flag->is_boolean())
      return fields.error(ErrorKind::malformed, "is_fisheye", "is neither true nor false", "write true or false");
    if (flag->template get<bool>()) {
      if (model == "FULL_OPENCV")
        return fields.error(ErrorKind::invalid, "is_fisheye", "is true, but camera_model is FULL_OPENCV",
                            "correct one of the two");
      if (one_of(perspective)) model = "OPENCV_FISHEYE";
    }
  }
  const auto without = [&](const auto& places, const char* remedy) -> Result<Done> {
    for (const std::size_t i : places) {
      if (k[i] != 0) {
        const std::string name = coefficients->names[i], field = coefficients->field[i];
        return fields.error(
            ErrorKind::unsupported, field.c_str(),
            (field == name ? "is" : "holds " + name + ",") + " not a coefficient of the camera model " + model, remedy);
      }
    }
    return Done{};
  };
  if (one_of(fisheye)) {
    const Result<Done> clean =
        without(std::array<std::size_t, 4>{4, 5, 6, 7}, "set it to 0 if the lens has none, or undistort the images");
    if (!clean) return clean.error();
    return Lens{LensModel::opencv_fisheye, {k[0], k[1], k[2], k[3]}};
  }
  if (model == "FULL_OPENCV") return Lens{LensModel::full_opencv, {k[0], k[1], k[6], k[7], k[2], k[3], k[4], k[5]}};
  if (one_of(perspective)) {
    const Result<Done> clean =
        without(std::array<std::size_t, 3>{3, 4, 5},
                "name the camera_model (OPENCV_FISHEYE or FULL_OPENCV), or undistort the images");
    if (!clean) return clean.error();
    if (k[2] != 0) return Lens{LensModel::full_opencv, {k[0], k[1], k[6], k[7], k[2]}};
    const Lens lens{LensModel::opencv, {k[0], k[1], k[6], k[7]}};
    return is_pinhole(lens) ? Lens{} : lens;
  }
  return fields.error(ErrorKind::unsupported, "camera_model",
                      "\"" + model + "\" is no lens that can be brought to a pinhole",
                      "export perspective or fisheye images (cut panoramas into perspective views)");
}

}  // namespace detail
}  // namespace compmark
