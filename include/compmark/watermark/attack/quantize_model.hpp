// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The paper's general quantization (docs/spec/method.md, 6, T8; docs/spec/watermark.md, 4) as an edit of a model. It
// rounds every tensor that a render reads, in place. Anchors and networks have a quantizer each, since anchors share a
// scale by columns and weights by rows. The paper does not name the tensors. Its fall from 26.6 to 21.7 dB happens only
// if positions get 8 bits too, so they are rounded by default. Masks, and tensors of a coder alone (hash grid,
// contexts, hyperpriors, distortion), stay. Cost: a copy of one tensor, three reads of each.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

struct QuantizeModelSettings {
  BlockHandle kept;  ///< a block that stays as it is: the positions (AnchorHandles), where they are not to be rounded
  bool networks = true;  ///< false: blocks of fixed rows stay as they are
};

/// The rounding error of one tensor.
struct QuantizedBlock {
  std::string name;
  std::size_t values = 0;
  double deviation = 0;  ///< of the values from their mean
  double rms_error = 0;
  double largest_error = 0;
};

/// Rounds the model in `arena`; an entry for each tensor that was. After an error (a value that is not finite) some
/// tensors are rounded and some are not. A quantizer has a Context and forward(values, out, context), as Int8Quantizer
/// does.
template <class T, class AnchorQuantizer, class NetworkQuantizer>
[[nodiscard]] Result<std::vector<QuantizedBlock>> quantize_model(ParameterArena<T>& arena,
                                                                 const AnchorQuantizer& anchors,
                                                                 const NetworkQuantizer& networks,
                                                                 const QuantizeModelSettings& settings = {}) {
  std::vector<QuantizedBlock> report;
  std::vector<T> before;
  typename AnchorQuantizer::Context anchor_context;
  typename NetworkQuantizer::Context network_context;
  for (const ArenaLayout::Block& block : arena.layout().blocks()) {
    const bool network = block.kind == RowKind::fixed;
    const bool kept = settings.kept.valid() && &block == &arena.layout().block(settings.kept);
    if (block.role != BlockRole::rendering || block.size() == 0 || (network && !settings.networks) || kept) continue;
    const MatrixView<T> values{arena.all_values().data() + block.offset, block.rows, block.columns};
    before.assign(values.data, values.data + values.size());
    const Result<Done> rounded =
        network ? networks.forward(values, values, network_context) : anchors.forward(values, values, anchor_context);
    if (!rounded) {
      Error error = rounded.error();
      error.field = block.name + ": " + error.field;
      return error;
    }
    QuantizedBlock entry{block.name, block.size()};
    const double count = static_cast<double>(block.size());
    double mean = 0;
    for (const T x : before) mean += static_cast<double>(x) / count;
    for (std::size_t i = 0; i < before.size(); ++i) {
      const double error = static_cast<double>(values.data[i]) - static_cast<double>(before[i]);
      const double distance = static_cast<double>(before[i]) - mean;
      entry.rms_error += error * error / count;
      entry.deviation += distance * distance / count;
      entry.largest_error = std::max(entry.largest_error, std::abs(error));
    }
    entry.rms_error = std::sqrt(entry.rms_error);
    entry.deviation = std::sqrt(entry.deviation);
    report.push_back(std::move(entry));
  }
  return report;
}

}  // namespace compmark
