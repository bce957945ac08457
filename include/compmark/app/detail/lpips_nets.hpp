// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/lpips_nets.hpp.
#pragma once

#include <tuple>
#include <utility>

#include "compmark/app/lpips_nets.hpp"
#include "compmark/io/safetensors.hpp"

namespace compmark {

COMPMARK_APP_INLINE Result<LpipsNets> LpipsNets::open(const LpipsFiles& files) {
  LpipsNets nets;
  for (const auto& [path, network, target] : {std::tuple(&files.alex, LpipsNetwork::alex, &nets.alex_),
                                              std::tuple(&files.squeeze, LpipsNetwork::squeeze, &nets.squeeze_)}) {
    if (path->empty()) continue;
    const Result<SafetensorsFile> file = read_safetensors(*path);
    if (!file) return file.error();
    Result<Lpips> loaded = Lpips::load(*file);
    if (!loaded) return loaded.error();
    if (loaded->network() != network) {
      return Error{ErrorKind::invalid, path->string(), "features", "holds the weights of the other network",
                   "swap --lpips-alex and --lpips-squeeze"};
    }
    *target = std::move(*loaded);
  }
  nets.range_ = files.family_range ? LpipsRange::family_unit : LpipsRange::signed_unit;
  return nets;
}

COMPMARK_APP_INLINE Result<LpipsNets::Distances> LpipsNets::between(ImageView<const float> image,
                                                                    ImageView<const float> reference,
                                                                    ThreadExecutor& executor) {
  Distances found;
  for (const auto& [net, value] : {std::pair(&alex_, &found.alex), std::pair(&squeeze_, &found.squeeze)}) {
    if (!*net) continue;
    const Result<LpipsReport> report = (*net)->distance(image, reference, context_, executor, range_);
    if (!report) return report.error();
    *value = report->value;
  }
  return found;
}

}  // namespace compmark
