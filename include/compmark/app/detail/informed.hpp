// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/informed.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/detail/reading.hpp"
#include "compmark/app/detail/spread.hpp"
#include "compmark/app/informed.hpp"
#include "compmark/app/register.hpp"
#include "compmark/math/area_resize.hpp"
#include "compmark/watermark/decoder/subject_box.hpp"
#include "compmark/watermark/proof/key.hpp"

namespace compmark {
namespace detail {

/// A picture beside what the unmarked model shows at its camera.
struct ComparedPicture {
  std::vector<float> picture, render;  ///< [3, height, width], the render in the picture's colours
  std::vector<float> weight;           ///< [height, width]
  std::vector<float> filled;           ///< the render, and the picture where the weight is 0
  Camera<double> camera;
};

/// weight [from_height, from_width] at another size: that of the nearest pixel.
inline std::vector<float> resized_weight(const std::vector<float>& from, int from_width, int from_height, int width,
                                         int height) {
  std::vector<float> to;
  to.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    const int row = std::min(from_height - 1, (2 * y + 1) * from_height / (2 * height));
    for (int x = 0; x < width; ++x) {
      const int column = std::min(from_width - 1, (2 * x + 1) * from_width / (2 * width));
      to.push_back(from[static_cast<std::size_t>(row) * static_cast<std::size_t>(from_width) +
                        static_cast<std::size_t>(column)]);
    }
  }
  return to;
}

/// Leaves a part of an image.
inline void cut_to(ReadImage& image, const PictureBox& box) {
  std::vector<float> part;
  part.reserve(3 * static_cast<std::size_t>(box.width) * static_cast<std::size_t>(box.height));
  for (int c = 0; c < 3; ++c) {
    for (int y = box.top; y < box.top + box.height; ++y) {
      const auto row = image.planes.begin() + (static_cast<std::ptrdiff_t>(c) * image.height + y) * image.width;
      part.insert(part.end(), row + box.left, row + box.left + box.width);
    }
  }
  image.planes = std::move(part);
  image.width = box.width;
  image.height = box.height;
}

inline Result<ComparedPicture> compare_picture(AnyModel& model, const Registration& found,
                                               ImageView<const float> picture, ThreadExecutor& executor) {
  ComparedPicture compared;
  const RegisterPicture small(picture, informed_side, executor);
  const int width = small.view.width, height = small.view.height;
  compared.picture = small.values;
  compared.camera = found.camera.resized(width, height);
  compared.weight = resized_weight(found.weight, found.fit_width, found.fit_height, width, height);
  // A picture that was made smaller is one of a larger render: of the size of the training, or several times larger
  // than the picture (app/register_render.hpp). The form that is most like the picture is taken.
  const double native = register_native_focal(model) / compared.camera.fx;
  std::vector<double> scales{1};
  if (native > 1.02) scales.push_back(native);
  if (std::floor(native + 0.8) > 1) scales.push_back(std::min(std::floor(native + 0.8), 4.0));
  double least = std::numeric_limits<double>::infinity();
  for (const double scale : scales) {
    const auto larger = [&](int side) { return std::max(side, static_cast<int>(std::lround(scale * side))); };
    const Result<RenderedView> render = model.render(compared.camera.resized(larger(width), larger(height)), executor);
    if (!render) return render.error();
    std::vector<float> shown(small.view.size());
    AreaResize<float>().forward(ImageView<const float>(render->image), ImageView<float>{shown.data(), 3, height, width},
                                executor);
    const std::size_t plane = shown.size() / 3;
    double error = 0;
    for (std::size_t i = 0; i < plane; ++i) {
      std::array<double, 3> color{};
      for (std::size_t c = 0; c < 3; ++c) color[c] = static_cast<double>(shown[c * plane + i]);
      for (std::size_t c = 0; c < 3; ++c) {
        shown[c * plane + i] = static_cast<float>(std::clamp(found.tone(c, color), 0.0, 1.0));
        const double d =
            static_cast<double>(shown[c * plane + i]) - static_cast<double>(compared.picture[c * plane + i]);
        error += static_cast<double>(compared.weight[i]) * d * d;
      }
    }
    if (!(error < least)) continue;
    least = error;
    compared.render = std::move(shown);
  }
  const std::size_t plane = compared.weight.size();
  compared.filled = compared.render;
  for (std::size_t i = 0; i < compared.filled.size(); ++i) {
    const float w = compared.weight[i % plane];
    compared.filled[i] = w * compared.filled[i] + (1 - w) * compared.picture[i];
  }
  return compared;
}

}  // namespace detail

COMPMARK_APP_INLINE Verification both_verdicts(Verification message, const SpreadEvidence& spread) {
  const double spread_p = std::fmin(1, spread.p_value * static_cast<double>(message.settings.tries));
  message.p_corrected = std::fmin(message.p_corrected, spread_p);
  if (message.p_corrected <= message.settings.false_positive_rate) {
    message.verdict = Verdict::detected;
  } else if (message.p_corrected <= message.settings.suspicion) {
    message.verdict = Verdict::inconclusive;
  }
  return message;
}

COMPMARK_APP_INLINE std::string informed_text(const InformedReport& report) {
  const auto number = [](double value, const char* format = "%.2g") { return detail::short_number(value, format); };
  std::string text;
  std::size_t found = 0;
  for (const InformedPicture& picture : report.pictures) {
    text += "picture     " + picture.name;
    if (picture.found) {
      ++found;
      text += ": camera found" + std::string(picture.mirrored ? ", mirrored" : "") + ", spread mark at " +
              number(picture.spread.deviations, "%.1f") + " deviations, p " + number(picture.spread.p_value) + "\n";
    } else {
      text += ": no camera of this scene shows it; its message is read blind\n";
    }
  }
  text += "spread      " + number(report.spread.deviations, "%.1f") + " deviations over " +
          std::to_string(report.spread.cells) + " cells in " + std::to_string(found) + " pictures together, p " +
          number(report.spread.p_value) + ": so likely, at most, a key drawn at random would agree as well\n";
  return text;
}

COMPMARK_APP_INLINE Result<InformedReport> verify_informed(const OwnerKey& key, const ReadingSettings& reading,
                                                           const VerifySettings& settings, ThreadExecutor& executor,
                                                           const WorkObserver& observer) {
  if (const Result<Done> checked = check_settings(settings); !checked) return checked.error();
  const Result<FileDecoder> decoder = open_decoder(reading.decoder, &key);
  if (!decoder) return decoder.error();
  const Result<std::string> decoder_digest = file_sha256(reading.decoder);
  if (!decoder_digest) return decoder_digest.error();
  Result<AnyModel> model = AnyModel::open(reading.unmarked, executor);
  if (!model) return model.error();
  const Result<std::string> digest = file_sha256(reading.unmarked);
  if (!digest) return digest.error();
  const auto of_model = [&](Error error) {
    if (error.file.empty()) error.file = reading.unmarked.string();
    return error;
  };
  Result<SpreadReader> spread = SpreadReader::make(*model, executor);
  if (!spread) return of_model(spread.error());
  RegisterSettings registration;
  registration.mirrored = reading.mirrored;
  const Result<std::vector<SearchPlace>> places = register_places(*model, registration, executor);
  if (!places) return of_model(places.error());
  Result<std::vector<std::filesystem::path>> files = image_files(reading.images);
  if (!files) return files.error();
  detail::keep_evenly(*files, reading.views);

  InformedReport result;
  ReportSources& sources = result.report.sources;
  sources.program = std::string("compmark ") + version;
  sources.decoder = reading.decoder.filename().string();
  sources.decoder_sha256 = *decoder_digest;
  sources.unmarked = reading.unmarked.filename().string();
  sources.unmarked_sha256 = *digest;
  sources.key_id = key.id();
  sources.key_commitment = key.commitment();
  sources.key_created = key.created;
  const std::vector<std::int8_t> signs = spread_signs(key, spread->cells());
  std::vector<double> all(signs.size(), 0.0);
  FileDecoder::Context context;
  ReadingSettings as_is = reading;
  as_is.mirrored = false;
  detail::ReadImage image;
  for (const std::filesystem::path& path : *files) {
    if (Result<Done> done = detail::read_planes(path, as_is, image); !done) return done.error();
    ImageView<float> planes{image.planes.data(), 3, image.height, image.width};
    Result<Registration> found =
        register_picture(*model, *places, ImageView<const float>(planes), registration, executor);
    // A page or a frame round the subject hides what it looks like: without flat lines, it is looked for again.
    const PictureBox box = subject_box(ImageView<const float>(planes), 64);
    if (found && !found->found && (box.height < image.height || box.width < image.width)) {
      detail::cut_to(image, box);
      planes = {image.planes.data(), 3, image.height, image.width};
      found = register_picture(*model, *places, ImageView<const float>(planes), registration, executor);
    }
    if (!found) {
      Error error = found.error();
      if (error.file.empty()) error.file = path.string();
      return error;
    }
    if (found->mirrored) {
      for (auto row = image.planes.begin(); row != image.planes.end(); row += image.width)
        std::reverse(row, row + image.width);
    }
    InformedPicture said{path.filename().string(),
                         found->found,
                         found->likeness,
                         found->found ? found->uncertainty_pixels : 0,
                         found->found && found->mirrored,
                         0,
                         {}};
    ImageView<const float> read(planes);
    detail::ComparedPicture compared;
    if (found->found) {
      Result<detail::ComparedPicture> both =
          detail::compare_picture(*model, *found, ImageView<const float>(planes), executor);
      if (!both) return both.error();
      compared = std::move(*both);
      read = {compared.picture.data(), 3, compared.camera.height, compared.camera.width};
      std::vector<double> sums(signs.size(), 0.0);
      const Result<double> blur = spread->add(read, {compared.render.data(), 3, read.height, read.width},
                                              compared.weight, compared.camera, executor, sums);
      if (!blur) return of_model(blur.error());
      said.blur = *blur;
      said.spread = spread_evidence(signs, sums);
      // Pictures weigh alike, as their views do in a message.
      double energy = 0;
      for (const double sum : sums) energy += sum * sum;
      if (energy > 0) {
        for (std::size_t c = 0; c < sums.size(); ++c) all[c] += sums[c] / std::sqrt(energy);
      }
    }
    Result<ViewLogits> view = read_logits(*decoder, read, path.string(), context, executor);
    if (!view) return view.error();
    if (found->found) {
      const Result<ViewLogits> unmarked =
          read_logits(*decoder, ImageView<const float>{compared.filled.data(), 3, read.height, read.width},
                      path.string(), context, executor);
      if (!unmarked) return unmarked.error();
      for (std::size_t bit = 0; bit < view->logits.size(); ++bit) view->logits[bit] -= unmarked->logits[bit];
    }
    view->name = said.name;
    view->sha256 = image.sha256;
    result.report.views.push_back(std::move(*view));
    result.pictures.push_back(std::move(said));
    if (Result<Done> on = detail::tell(observer, result.pictures.size(), files->size()); !on) return on.error();
  }
  result.spread = spread_evidence(signs, all);
  VerifySettings twice = settings;
  twice.tries *= 2;
  Result<Verification> message = verify_message(message_of(key), result.report.views, twice);
  if (!message) return message.error();
  result.report.verification = both_verdicts(std::move(*message), result.spread);
  return result;
}

}  // namespace compmark
