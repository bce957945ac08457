// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a codec compresses, as plain vectors: anchors as voxels with feature, scales, offsets and offset masks, the
// context that predicts them, the networks that render them, and whatever else the owner wants to find again. No
// recipe, no rasterizer, no training: the pipeline turns its models into this and back. A decoded file is one of these
// too, with its context in whole numbers.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "compmark/codec/container/container.hpp"
#include "compmark/codec/context_gs/context_gs_integers.hpp"
#include "compmark/codec/integer/coarse_bins.hpp"
#include "compmark/codec/integer/integer_context.hpp"
#include "compmark/codec/integer/integer_quantize.hpp"
#include "compmark/codec/integer/intra_context.hpp"
#include "compmark/core/result.hpp"
#include "compmark/math/morton.hpp"

namespace compmark {

/// How a tensor of the rendering networks is stored: as float, as half, or as integers of some bits with a power of two
/// a row. Values that the chosen form cannot hold are stored in the next wider one.
enum class TensorStorage : std::uint8_t { single = 1, half = 2, integer = 3 };

struct CodecTensor {
  std::string name;
  std::vector<std::uint32_t> shape;
  std::vector<float> values;
  TensorStorage storage = TensorStorage::half;
  int bits = 10;  ///< of integers, sign included, 2 … 16

  friend bool operator==(const CodecTensor&, const CodecTensor&) = default;
};

using CodecValue = std::variant<std::int64_t, double, std::string>;

/// The context as training leaves it. Signs of the hash grid count, not its values.
struct TrainedContext {
  HashGridShape shape;
  std::array<float, 6> box{};       ///< minimum, maximum, world units
  std::vector<std::uint8_t> signs;  ///< of each entry: bit f is set where value f >= 0
  std::size_t hidden = 0;
  std::vector<float> weight1, bias1, weight2, bias2;  ///< row-major [out][in]
  std::vector<float> statistics;                      ///< [2][D + 6 + 3 K]: means, deviations
};

/// That of ContextGS.
struct TrainedContextGs {
  struct Network {
    std::vector<float> weight1, bias1, weight2, bias2;  ///< row-major [out][in]
  };
  AnchorCells cells;
  std::array<float, 6> box{};  ///< minimum, maximum, world units
  std::size_t hidden = 0;
  std::array<Network, 3> network;  ///< of level i
  std::vector<float> statistics;   ///< [2][D + 6 + 3 K]: means, deviations
  std::vector<double> prior;       ///< [channels of z][31] probabilities of -15 … 15
};

struct CodecModel {
  double voxel_size = 0;
  int feature_dim = 0;                             ///< D
  int offset_count = 0;                            ///< K, at most 32
  std::array<double, 3> base_step{1, 0.001, 0.2};  ///< Q0 of features, scales (world units), offsets
  int chunk_anchors = 4096;                        ///< anchors that are decoded together

  std::vector<Voxel> voxels;             ///< position = voxel_size * voxel
  std::vector<std::uint32_t> mask;       ///< bit k: offset k is unmasked; an anchor without any is not coded
  std::vector<float> feature;            ///< [N, D]
  std::vector<float> scale;              ///< [N, 6], not their logarithms
  std::vector<float> offset;             ///< [N, 3 K]; of masked offsets decoding makes zeros
  std::vector<std::int32_t> hyperprior;  ///< ContextGS: [N, channels] symbols of z

  /// Exactly one of the four is set in a model. Encoding makes the integer context from the trained one; an integer
  /// context that is there is used unchanged.
  std::optional<TrainedContext> trained;  ///< HAC
  std::optional<IntegerContext> context;
  std::optional<TrainedContextGs> trained_gs;  ///< ContextGS
  std::optional<IntegerContextGs> context_gs;
  /// Beside the first or the second: the codec is HAC-plus. Without weights, encoding finds them.
  std::optional<IntraContext> intra;
  /// HAC-plus: the file begins with a coarse level of all anchors, a model by itself. None: it has one level.
  std::optional<CoarseSteps> first_level;

  std::vector<CodecTensor> networks;  ///< what renders, by name
  std::map<std::string, CodecValue> metadata;
  std::vector<Section> extra;  ///< sections of a file that this version does not know and need not: they are kept

  [[nodiscard]] std::size_t anchors() const { return voxels.size(); }
  [[nodiscard]] ContextHeads heads() const { return {feature_dim, 6, 3 * offset_count}; }
  [[nodiscard]] ContainerProfile profile() const {
    if (intra) return ContainerProfile::hac_plus;
    return trained_gs || context_gs ? ContainerProfile::context_gs : ContainerProfile::hac;
  }
};

struct CodecLimits {
  static constexpr int feature_dim = 4096, offset_count = 32;
  static constexpr int least_chunk = 16, greatest_chunk = 65'536;
  static constexpr std::uint64_t anchors = std::uint64_t{1} << 28;
  static constexpr std::uint32_t text = 1u << 20;  ///< bytes of a metadata text
  static constexpr double least_step = 1e-12, greatest_step = 1e9;
  static constexpr double least_voxel = 1e-20, greatest_voxel = 1e20;
};

namespace detail {

/// The error in the numbers that a model and a file both begin with; none if they are in order.
[[nodiscard]] inline Result<Done> check_codec_numbers(const CodecModel& model) {
  const auto fail = [](std::string field, std::string problem) {
    return Error{ErrorKind::invalid, "", std::move(field), std::move(problem), "it cannot be coded"};
  };
  if (!(model.voxel_size >= CodecLimits::least_voxel && model.voxel_size <= CodecLimits::greatest_voxel)) {
    return fail("voxel_size", "must be in 1e-20 to 1e20");  // its products with 32-bit voxels are finite floats
  }
  if (model.feature_dim < 1 || model.feature_dim > CodecLimits::feature_dim) {
    return fail("feature_dim", std::to_string(model.feature_dim) + " is not in 1 to 4096");
  }
  if (model.offset_count < 1 || model.offset_count > CodecLimits::offset_count) {
    return fail("offset_count", std::to_string(model.offset_count) + " is not in 1 to 32");
  }
  if (model.chunk_anchors < CodecLimits::least_chunk || model.chunk_anchors > CodecLimits::greatest_chunk) {
    return fail("chunk_anchors", std::to_string(model.chunk_anchors) + " is not in 16 to 65536");
  }
  for (const double step : model.base_step) {
    if (!(step >= CodecLimits::least_step && step <= CodecLimits::greatest_step)) {
      return fail("base_step", "must be in 1e-12 to 1e9");
    }
  }
  return Done{};
}

/// The error in a model before it is encoded.
[[nodiscard]] inline Result<Done> check_codec_model(const CodecModel& model) {
  const Result<Done> numbers = check_codec_numbers(model);
  if (!numbers) return numbers.error();
  const auto fail = [](std::string field, std::string problem) {
    return Error{ErrorKind::invalid, "", std::move(field), std::move(problem),
                 "it cannot be coded; was the training stable?"};
  };
  const std::size_t n = model.anchors(), d = static_cast<std::size_t>(model.feature_dim),
                    k = static_cast<std::size_t>(model.offset_count);
  if (n > CodecLimits::anchors) return fail("anchors", std::to_string(n) + " are more than 2^28");
  if (model.mask.size() != n || model.feature.size() != n * d || model.scale.size() != 6 * n ||
      model.offset.size() != 3 * k * n || (n > 0 ? model.hyperprior.size() % n != 0 : !model.hyperprior.empty())) {
    return fail("anchors", "the attributes are not those of " + std::to_string(n) + " anchors");
  }
  for (std::size_t i = 0; i < n; ++i) {
    const std::string row = "[" + std::to_string(i) + "]";
    if (k < 32 && model.mask[i] >> k != 0) return fail("mask" + row, "names an offset that does not exist");
    if (model.mask[i] == 0) continue;  // not coded
    for (std::size_t c = 0; c < d; ++c) {
      if (!std::isfinite(model.feature[i * d + c])) return fail("feature" + row, "is not finite");
    }
    for (std::size_t c = 0; c < model.hyperprior.size() / n; ++c) {
      const std::int32_t z = model.hyperprior[i * (model.hyperprior.size() / n) + c];
      if (z < -HyperpriorFormat::greatest || z > HyperpriorFormat::greatest)
        return fail("hyperprior" + row, "is beyond 1e6");
    }
    for (std::size_t c = 0; c < 6; ++c) {
      const float scale = model.scale[6 * i + c];
      if (!std::isfinite(scale)) return fail("scale" + row, "is not finite");
      if (scale < 0) return fail("scale" + row, "is negative");
    }
    for (std::size_t c = 0; c < 3 * k; ++c) {
      if ((model.mask[i] >> (c / 3) & 1u) != 0 && !std::isfinite(model.offset[3 * k * i + c])) {
        return fail("offset" + row, "is not finite");
      }
    }
  }
  for (const CodecTensor& tensor : model.networks) {
    std::uint64_t count = 1;
    for (const std::uint32_t extent : tensor.shape) {
      if (!checked_product(count, extent, count)) return fail(tensor.name, "the product of its shape overflows");
    }
    if (count != tensor.values.size()) return fail(tensor.name, "its values do not fill its shape");
    if (count == 0) return fail(tensor.name, "is empty");
    if (tensor.bits < 2 || tensor.bits > 16) return fail(tensor.name, "bits must be 2 to 16");
    if (tensor.name.size() > 255 || tensor.shape.size() > 8)
      return fail(tensor.name, "has a name or a shape that is too long");
    for (const float value : tensor.values) {
      if (!std::isfinite(value)) return fail(tensor.name, "holds a value that is not finite");
    }
  }
  for (const auto& [key, value] : model.metadata) {
    const auto* text = std::get_if<std::string>(&value);
    if (key.empty() || key.size() > 255 || (text != nullptr && text->size() > CodecLimits::text)) {
      return Error{ErrorKind::invalid, "", "metadata." + key, "its key is empty, or key or text are too long",
                   "leave it out (cameras: store fewer of them)"};
    }
  }
  return Done{};
}

}  // namespace detail

}  // namespace compmark
