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
#include "compmark/io/number_text.hpp"
#include "compmark/math/area_resize.hpp"
#include "compmark/math/mirror.hpp"
#include "compmark/watermark/decoder/subject_box.hpp"
#include "compmark/watermark/proof/recipients.hpp"

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
    apply_tone(found.tone, ImageView<float>{shown.data(), 3, height, width});
    const std::size_t plane = compared.weight.size();
    double error = 0;
    for (std::size_t i = 0; i < shown.size(); ++i) {
      const double d = static_cast<double>(shown[i]) - static_cast<double>(compared.picture[i]);
      error += static_cast<double>(compared.weight[i % plane]) * d * d;
    }
    if (!(error < least)) continue;
    least = error;
    compared.render = std::move(shown);
  }
  if (compared.render.empty()) {
    return Error{ErrorKind::invalid, model.file().string(), "render", "is not finite at the camera of the picture",
                 "check the unmarked model"};
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
  const double tries = static_cast<double>(message.settings.tries);
  const double spread_p = std::fmin(1, spread.p_value * tries);
  message.spread_could_decide = tries * spread.least_p_value() <= message.settings.false_positive_rate;
  message.p_corrected = std::fmin(message.p_corrected, spread_p);
  if (message.p_corrected <= message.settings.false_positive_rate) {
    message.verdict = Verdict::detected;
  } else if (message.p_corrected <= message.settings.suspicion) {
    message.verdict = Verdict::inconclusive;
  } else if (message.spread_could_decide) {
    message.verdict = Verdict::not_detected;  // however short the message is: the other test found nothing
  }
  return message;
}

COMPMARK_APP_INLINE std::string informed_text(const InformedReport& report) {
  const auto number = [](double value) { return detail::short_number(value); };
  std::string text;
  std::size_t found = 0;
  for (const InformedPicture& picture : report.pictures) {
    text += "picture     " + picture.name;
    if (picture.found) {
      ++found;
      text += ": camera found" + std::string(picture.mirrored ? ", mirrored" : "") + ", spread mark at " +
              detail::fixed_number(picture.spread.deviations, 1) + " deviations, p " + number(picture.spread.p_value) +
              "\n";
    } else {
      text += ": no camera of this scene shows it; its message is read blind\n";
    }
  }
  text += "spread      " + detail::fixed_number(report.spread.deviations, 1) + " deviations over " +
          std::to_string(report.spread.cells) + " cells in " + std::to_string(found) + " pictures together, p " +
          number(report.spread.p_value) + ": so likely, at most, a key drawn at random would agree as well\n";
  return text;
}

COMPMARK_APP_INLINE std::string together_text(const InformedReport& report) {
  return "together    " + detail::short_number(report.together.p_corrected) +
         ": the smaller p-value of message and spread mark, corrected for both tests\n";
}

COMPMARK_APP_INLINE Result<InformedReport> verify_informed(const OwnerKey& key, const ReadingSettings& reading,
                                                           const VerifySettings& settings, ThreadExecutor& executor,
                                                           const WorkObserver& observer, const ComparedObserver& each) {
  if (const Result<Done> checked = check_settings(settings, 2); !checked) return checked.error();
  if (!reading.model.empty() || !reading.interference.empty()) {
    return Error{ErrorKind::invalid, reading.unmarked.string(),
                 reading.model.empty() ? "--interference, --unmarked" : "--model, --images", "do not go together here",
                 reading.model.empty() ? "give one: both subtract what the unmarked model says"
                                       : "give images alone, or read the model less the unmarked one (read_messages)"};
  }
  if (reading.images.empty() && reading.pictures.empty())
    return Error{ErrorKind::invalid, {}, "--images", "is missing", "give the pictures to read"};
  std::string decoder_sha256;
  const Result<FileDecoder> decoder = open_decoder(reading.decoder, &key, &decoder_sha256);
  if (!decoder) return decoder.error();
  std::string unmarked_sha256;
  Result<AnyModel> model = AnyModel::open(reading.unmarked, executor, &unmarked_sha256);
  if (!model) return model.error();
  const auto of_model = [&](const Error& error) { return detail::named(error, reading.unmarked); };
  Result<SpreadReader> spread = SpreadReader::make(*model, executor);
  if (!spread) return of_model(spread.error());
  RegisterSettings registration;
  registration.mirrored = reading.mirrored;
  registration.up = reading.up;
  const Result<std::vector<SearchPlace>> places = register_places(*model, registration, executor);
  if (!places) return of_model(places.error());
  Result<std::vector<std::filesystem::path>> files = image_files(reading.images);
  if (!files) return files.error();
  detail::keep_evenly(*files, reading.views);

  InformedReport result;
  result.report.sources = detail::sources_of(reading.decoder, decoder_sha256, &key);
  result.report.sources.unmarked = reading.unmarked.filename().string();
  result.report.sources.unmarked_sha256 = std::move(unmarked_sha256);
  const std::vector<std::int8_t> signs = spread_signs(key, spread->cells());
  std::vector<double> all(signs.size(), 0.0);
  FileDecoder::Context context;
  PictureSettings as_is = reading;
  as_is.mirrored = false;
  const std::size_t count = files->size() + reading.pictures.size();
  for (std::size_t p = 0; p < count; ++p) {
    const bool in_memory = p >= files->size();
    const std::filesystem::path path =
        in_memory ? std::filesystem::path(reading.pictures[p - files->size()].name) : (*files)[p];
    const auto open = [&](const PictureSettings& how) {
      return in_memory ? open_picture(reading.pictures[p - files->size()], how) : open_picture(path, how);
    };
    Result<OpenPicture> opened = open(as_is);
    if (!opened) return opened.error();
    OpenPicture& image = *opened;
    ImageView<float> planes{image.planes.data(), 3, image.height, image.width};
    const auto look = [&](ImageView<const float> picture) -> Result<Registration> {
      if (std::min(picture.width, picture.height) < register_least_side) return Registration{};
      Result<Registration> found = register_picture(*model, *places, picture, registration, executor);
      return found ? std::move(found) : Result<Registration>(detail::named(found.error(), path));
    };
    Result<Registration> found = look(ImageView<const float>(planes));
    // What was taken for the picture on a page may be none.
    if (found && !found->found && image.part) {
      PictureSettings whole = as_is;
      whole.pages = false;
      Result<OpenPicture> uncut = open(whole);
      if (!uncut) return uncut.error();
      found = look(uncut->image());
      if (found && found->found) {
        image = std::move(*uncut);
        planes = {image.planes.data(), 3, image.height, image.width};
      }
    }
    // A page or a frame round the subject hides what it looks like: without flat lines, it is looked for again.
    const PictureBox box = subject_box(ImageView<const float>(planes), 64);
    if (found && !found->found && (box.height < image.height || box.width < image.width)) {
      OpenPicture part = part_of(image, box);
      found = look(part.image());
      if (found && found->found) {
        image = std::move(part);
        planes = {image.planes.data(), 3, image.height, image.width};
      }
    }
    if (!found) return found.error();
    // A picture without a camera is read as it is.
    if (found->found && found->mirrored) mirror_rows(planes);
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
      if (each) each(said.name, read, {compared.render.data(), 3, read.height, read.width});
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
    view->part = image.part;
    result.report.views.push_back(std::move(*view));
    result.pictures.push_back(std::move(said));
    if (Result<Done> on = detail::tell(observer, result.pictures.size(), count); !on) return on.error();
  }
  result.spread = spread_evidence(signs, all);
  VerifySettings twice = settings;
  twice.tries *= 2;
  Result<Verification> message = verify_key(key, result.report.views, twice);
  if (!message) return message.error();
  result.report.verification = std::move(*message);
  result.together = both_verdicts(result.report.verification, result.spread);
  if (result.together.recipients && result.together.verdict == Verdict::detected) {
    result.together.recipients->owner_proven = true;
    result.report.verification.recipients->owner_proven = true;
  }
  return result;
}

}  // namespace compmark
