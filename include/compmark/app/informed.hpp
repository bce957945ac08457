// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Informed reading: pictures of unknown camera, read by who has the unmarked model (docs/informed_reading.md). The
// camera and the tone of each picture are found (register.hpp), the unmarked model is rendered as the picture would
// show it, and what the picture says beyond that is read twice: as a spread-spectrum mark (spread.hpp), and as a
// message, whose logits of the unmarked render are subtracted. Both tests are exact; as there are two, each counts
// twice. A picture whose camera is not found says nothing to the first, and is read blind by the second.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "compmark/app/compiled.hpp"
#include "compmark/app/observer.hpp"
#include "compmark/app/reading.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/watermark/proof/report.hpp"
#include "compmark/watermark/proof/spread_evidence.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

/// Of one picture.
struct InformedPicture {
  std::string name;
  bool found = false;             ///< its camera
  double likeness = 0;            ///< to the render at that camera, at most 1
  double uncertainty_pixels = 0;  ///< of that camera
  bool mirrored = false;
  double blur = 0;        ///< that made the render as soft as the picture, pixels
  SpreadEvidence spread;  ///< of this picture alone, for information
};

struct InformedReport {
  /// As that of verify_files, of the message alone; its verification counts twice the tries, since there are two tests.
  VerificationReport report;
  /// The same with the verdict and the corrected p-value of both tests together: what was found.
  Verification together;
  std::vector<InformedPicture> pictures;
  SpreadEvidence spread;  ///< of all pictures together
};

/// The longest side at which a picture is compared with the unmarked render, pixels.
inline constexpr int informed_side = 800;

/// Told of every picture whose camera was found: its name, the picture as it is compared (turned back if it is
/// mirrored, at most informed_side), and the unmarked render of that camera in the picture's colours; both
/// [3, height, width], for the time of the call.
using ComparedObserver =
    std::function<void(const std::string& name, ImageView<const float> picture, ImageView<const float> render)>;

/// Reads the images of `reading` by its unmarked model. Errors are those of verify_files and of register_picture; a
/// model whose anchors have no features. Cost: mostly to find the camera; 2 to 26 s a picture of 400 x 400 were
/// measured on two threads, beside other work.
[[nodiscard]] Result<InformedReport> verify_informed(const OwnerKey& key, const ReadingSettings& reading,
                                                     const VerifySettings& settings, ThreadExecutor& executor,
                                                     const WorkObserver& observer = {},
                                                     const ComparedObserver& compared = {});

/// What was read of each picture, in lines, and of all together.
[[nodiscard]] std::string informed_text(const InformedReport& report);

/// What both tests say together, in a line; it stands between the evidence of the message and the verdict.
[[nodiscard]] std::string together_text(const InformedReport& report);

/// The entry "informed" of a report.
template <class Json>
[[nodiscard]] Json informed_json(const InformedReport& report) {
  const auto spread_json = [](const SpreadEvidence& spread) {
    return Json{{"deviations", spread.deviations},
                {"p_value", spread.p_value},
                {"cells", spread.cells},
                {"most_deviations", spread.most_deviations}};
  };
  Json json;
  json["spread"] = spread_json(report.spread);
  json["message"] = Json{{"verdict", std::string(verdict_name(report.report.verification.verdict))},
                         {"p_corrected", report.report.verification.p_corrected}};
  json["pictures"] = Json::array();
  for (const InformedPicture& picture : report.pictures) {
    json["pictures"].push_back(Json{{"name", picture.name},
                                    {"found", picture.found},
                                    {"likeness", picture.likeness},
                                    {"uncertainty_pixels", picture.uncertainty_pixels},
                                    {"mirrored", picture.mirrored},
                                    {"blur_pixels", picture.blur},
                                    {"spread", spread_json(picture.spread)}});
  }
  return json;
}

/// Both tests as one verdict: `message` was made with settings.tries already doubled; the spread evidence is multiplied
/// by the same here. Inconclusive for want of bits is only what the spread mark could not decide either, had every cell
/// agreed (SpreadEvidence::least_p_value).
[[nodiscard]] Verification both_verdicts(Verification message, const SpreadEvidence& spread);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/informed.hpp"
#endif
