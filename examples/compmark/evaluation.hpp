// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Renders views of a model and measures them, all on images rounded to 8 bits.
#pragma once

#include <chrono>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/metric/lpips.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/metric/ssim.hpp>
#include <compmark/pipeline/pipeline.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "common.hpp"

namespace tool {

/// Weight files of LPIPS; empty: not measured.
struct LpipsFiles {
  std::filesystem::path alex;
  std::filesystem::path squeeze;
  bool family_range = false;  ///< feed [0, 1] as the 3DGS family does, instead of the [-1, 1] that LPIPS defines
};

struct ViewResult {
  std::string name;
  double psnr = 0;
  double ssim = 0;
  std::optional<double> lpips_alex;
  std::optional<double> lpips_squeeze;
  double milliseconds = 0;
  std::size_t gaussians = 0;
};

struct Evaluation {
  std::vector<ViewResult> views;

  template <class Member>
  [[nodiscard]] double mean(Member member) const {
    double sum = 0;
    for (const ViewResult& view : views) sum += member(view);
    return views.empty() ? 0 : sum / static_cast<double>(views.size());
  }
};

/// Calls keep(i, result, render, truth) for every view; images are 8-bit rounded and valid during the call.
template <class R, compmark::Executor E, class Keep>
compmark::Result<Evaluation> evaluate_views(const compmark::Model<R>& model, DatasetViews views,
                                            const LpipsFiles& lpips, E& executor, const Keep& keep) {
  using namespace compmark;
  std::optional<Lpips> alex;
  std::optional<Lpips> squeeze;
  for (const auto& [path, network, target] : {std::tuple(&lpips.alex, LpipsNetwork::alex, &alex),
                                              std::tuple(&lpips.squeeze, LpipsNetwork::squeeze, &squeeze)}) {
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
  const LpipsRange range = lpips.family_range ? LpipsRange::family_unit : LpipsRange::signed_unit;
  Lpips::Context lpips_context;
  const auto measure = [&](const std::optional<Lpips>& net, ImageView<const float> image, ImageView<const float> truth,
                           std::optional<double>& value) -> Result<Done> {
    if (!net) return Done{};
    const Result<LpipsReport> report = net->distance(image, truth, lpips_context, executor, range);
    if (!report) return report.error();
    value = report->value;
    return Done{};
  };

  Evaluation evaluation;
  const Pipeline<R> pipeline;
  typename Pipeline<R>::Context context;
  Buffer<float> truth_storage;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Camera<double> camera = views.camera(i);
    const auto begin = std::chrono::steady_clock::now();
    const ForwardReport forward = pipeline.forward(model, camera, 0, context, executor);
    const auto end = std::chrono::steady_clock::now();
    round_to_8bit<float>(context.image, context.image);
    truth_storage.resize(context.image.size());
    const ImageView<float> truth{truth_storage.data(), 3, camera.height, camera.width};
    if (Result<Done> loaded = views.load(i, truth); !loaded) return loaded.error();

    ViewResult result;
    result.name = views.dataset->views[views.index[i]].name;
    result.psnr = psnr(context.image, truth);
    result.ssim = ssim(context.image, truth);
    if (Result<Done> r = measure(alex, context.image, truth, result.lpips_alex); !r) return r.error();
    if (Result<Done> r = measure(squeeze, context.image, truth, result.lpips_squeeze); !r) return r.error();
    result.milliseconds = std::chrono::duration<double, std::milli>(end - begin).count();
    result.gaussians = forward.gaussians;
    keep(i, result, ImageView<const float>(context.image), ImageView<const float>(truth));
    evaluation.views.push_back(std::move(result));
  }
  return evaluation;
}

}  // namespace tool
