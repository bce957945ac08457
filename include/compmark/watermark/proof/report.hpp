// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// From images to a report: the reading of each image, the verdict of verify.hpp, and both as JSON and as sentences for
// people who know no statistics. With the key, another person can check the report: it has logits in full precision,
// thresholds that were chosen before, and hashes of the images. It holds nothing secret of the key; but the bits that
// were read from a marked model are its message (docs/verification.md). Any JSON class with nlohmann's interface does:
// report_json<nlohmann::ordered_json>(report). Cost: a forward pass of the decoder an image.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/number_text.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/proof/message.hpp"
#include "compmark/watermark/proof/recipient_report.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

/// What a decoder reads from an RGB image in [0, 1]. Round renders to 8 bits before: others have only such images.
/// `name` is for the report.
template <MessageDecoder D, Executor E>
[[nodiscard]] Result<ViewLogits> read_logits(const D& decoder, ImageView<const typename D::Scalar> image,
                                             std::string name, typename D::Context& context, E& executor) {
  using T = typename D::Scalar;
  if (image.channels != 3 || std::min(image.height, image.width) < decoder.minimum_size()) {
    return Error{
        ErrorKind::invalid, std::move(name), "image size",
        "is " + std::to_string(image.width) + " x " + std::to_string(image.height) + " pixels of " +
            std::to_string(image.channels) + " channels",
        "the decoder reads RGB images of at least " + std::to_string(decoder.minimum_size()) + " pixels a side"};
  }
  std::vector<T> logits(static_cast<std::size_t>(decoder.bits()));
  decoder.forward(image, std::span<T>(logits), context, executor);
  ViewLogits view{std::move(name), {}, {logits.begin(), logits.end()}};
  for (const double z : view.logits) {
    if (!std::isfinite(z))
      return Error{ErrorKind::invalid, view.name, "logits", "are not finite", "check the image and the decoder"};
  }
  return view;
}

/// Accuracy of single views: results.json's bit_accuracy. For information: the verdict is that of the fused logits.
struct BitAccuracy {
  double mean = 0;
  double min = 0;
  std::size_t views = 0;
  double largest_p = 1;  ///< p-value of the worst view
};
[[nodiscard]] inline BitAccuracy bit_accuracy(const Verification& verification) {
  BitAccuracy accuracy;
  accuracy.views = verification.views.size();
  if (accuracy.views == 0) return accuracy;
  std::size_t sum = 0, least = verification.bits;
  accuracy.largest_p = 0;
  for (const Evidence& view : verification.views) {
    sum += view.matches;
    least = std::min(least, view.matches);
    accuracy.largest_p = std::max(accuracy.largest_p, view.p_value);
  }
  const double bits = static_cast<double>(verification.bits);
  accuracy.mean = static_cast<double>(sum) / bits / static_cast<double>(accuracy.views);
  accuracy.min = static_cast<double>(least) / bits;
  return accuracy;
}

/// Where the numbers come from; what does not apply stays empty.
struct ReportSources {
  std::string program;  ///< name and version
  std::string key_id, key_commitment, key_created;
  std::string decoder, decoder_sha256;
  std::string model, model_sha256;                ///< empty if images were given
  std::string unmarked, unmarked_sha256;          ///< the model whose logits were subtracted, if any were
  std::string interference, interference_sha256;  ///< the file of what was subtracted, if anything was
};

/// A model that was put back together by the unmarked one before it was read (restored_features.hpp).
struct RestoredFeatures {
  std::size_t anchors = 0;  ///< of the unmarked model
  std::size_t found = 0;    ///< of those, in the suspected one
  double raised = 1;        ///< how many times the differences of their features were raised

  friend bool operator==(const RestoredFeatures&, const RestoredFeatures&) = default;
};

struct VerificationReport {
  ReportSources sources;
  std::vector<ViewLogits> views;
  Verification verification;
  std::optional<bool> mirrored{};         ///< whether the images read better mirrored; empty: that was not tried
  std::optional<double> missing_share{};  ///< of the anchors, that the model reads best as lacking; empty: not tried
  std::optional<RestoredFeatures> restored{};  ///< ReadingSettings::restored
};

[[nodiscard]] constexpr std::string_view verdict_name(Verdict verdict) {
  return verdict == Verdict::detected ? "detected" : verdict == Verdict::not_detected ? "not_detected" : "inconclusive";
}
[[nodiscard]] constexpr std::string_view fusion_name(FusionRule rule) {
  return rule == FusionRule::scaled ? "scaled" : rule == FusionRule::tanh ? "tanh" : "majority";
}

namespace detail {
template <class Json>
[[nodiscard]] Json text_or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}
}  // namespace detail

/// Decoder, model and key of a report or an extraction; entries that are empty are null. `unmarked` and
/// `interference` are there only if something was subtracted.
template <class Json>
void add_sources(Json& json, const ReportSources& s) {
  json["program"] = s.program;
  json["key"] = {{"id", detail::text_or_null<Json>(s.key_id)},
                 {"commitment", detail::text_or_null<Json>(s.key_commitment)},
                 {"created", detail::text_or_null<Json>(s.key_created)}};
  json["decoder"] = {{"file", detail::text_or_null<Json>(s.decoder)},
                     {"sha256", detail::text_or_null<Json>(s.decoder_sha256)}};
  json["model"] = {{"file", detail::text_or_null<Json>(s.model)},
                   {"sha256", detail::text_or_null<Json>(s.model_sha256)}};
  if (!s.unmarked.empty()) json["unmarked"] = {{"file", s.unmarked}, {"sha256", s.unmarked_sha256}};
  if (!s.interference.empty()) json["interference"] = {{"file", s.interference}, {"sha256", s.interference_sha256}};
}

/// Schema "compmark.verification.1" (docs/verification.md).
template <class Json>
[[nodiscard]] Json report_json(const VerificationReport& report) {
  const Verification& v = report.verification;
  const BitAccuracy accuracy = bit_accuracy(v);
  Json json;
  json["schema"] = "compmark.verification.1";
  json["verdict"] = std::string(verdict_name(v.verdict));
  json["bits"] = v.bits;
  json["matches"] = v.evidence.matches;
  json["p_value"] = v.evidence.p_value;
  json["p_corrected"] = v.p_corrected;
  json["bit_accuracy"] = {{"mean", accuracy.mean}, {"min", accuracy.min}, {"views", accuracy.views}};
  Json test;
  test["null_hypothesis"] =
      "the key was drawn at random, independently of the images and of the decoder: matches are Binomial(bits, 1/2)";
  test["false_positive_rate"] = v.settings.false_positive_rate;
  test["tests_counted"] = v.settings.tries;
  test["correction"] = "Bonferroni";
  // With recipients bits are weighted, and no number of matches decides.
  test["threshold_matches"] = v.threshold && !v.recipients ? Json(*v.threshold) : Json(nullptr);
  test["inconclusive_up_to"] = v.settings.suspicion;
  test["fusion"] = std::string(fusion_name(v.settings.fusion));
  if (v.recipients) {
    test["null_hypothesis"] =
        "the key was drawn at random, independently of the images and of the decoder: shared bits and the message of "
        "any copy are fair coins; p_value is of both tests";
    json["recipients"] = recipients_json<Json>(*v.recipients);
  }
  json["test"] = std::move(test);
  if (report.mirrored) json["mirrored"] = *report.mirrored;
  if (report.restored) {
    json["restored"] = {
        {"anchors", report.restored->anchors}, {"found", report.restored->found}, {"raised", report.restored->raised}};
  }
  if (report.missing_share) json["missing_share"] = *report.missing_share;
  json["read"] = {{"hex", v.read.hex()}, {"fused_logits", v.fused}};
  add_sources(json, report.sources);
  json["views"] = Json::array();
  for (std::size_t i = 0; i < report.views.size(); ++i) {
    const ViewLogits& view = report.views[i];
    Json entry;
    entry["name"] = view.name;
    entry["sha256"] = detail::text_or_null<Json>(view.sha256);
    if (view.part) {
      entry["part"] = {{"left", view.part->left},
                       {"top", view.part->top},
                       {"width", view.part->width},
                       {"height", view.part->height}};
    }
    entry["matches"] = v.views[i].matches;
    entry["p_value"] = v.views[i].p_value;
    entry["logits"] = view.logits;
    json["views"].push_back(std::move(entry));
  }
  return json;
}

/// What was read and how likely chance reads it, for whoever has to decide: all lines of a report but the verdict. Each
/// ends with '\n'.
[[nodiscard]] inline std::string evidence_text(const Verification& v) {
  const auto number = [](double x) { return detail::short_number(x); };
  const auto percent = [](double x) { return detail::fixed_number(100 * x, 1) + " %"; };
  const auto count = [](std::size_t n, const char* thing) {
    return std::to_string(n) + " " + thing + (n == 1 ? "" : "s");
  };
  const BitAccuracy accuracy = bit_accuracy(v);
  const std::string rate = number(v.settings.false_positive_rate);
  std::string text = "matches     " + std::to_string(v.evidence.matches) + " of " + count(v.bits, "bit") +
                     ", read from " + count(accuracy.views, "view") + " together\n";
  if (v.recipients) {
    text += detail::owner_lines(v);
  } else {
    text +=
        "p-value     " + number(v.evidence.p_value) +
        ": so likely a key drawn at random, without knowing the images and the decoder, would match at least as well\n";
  }
  if (v.settings.tries > 1) {
    text += "corrected   " + number(v.p_corrected) + ", for " +
            count(static_cast<std::size_t>(v.settings.tries), "test") + " that were or will be made (Bonferroni)\n";
  }
  if (v.recipients) {
    text += "needed      a p-value of " + rate + (v.settings.tries > 1 ? ", corrected\n" : "\n");
  } else {
    text += "needed      ";
    text += v.threshold ? std::to_string(*v.threshold) + " matches, for a false-positive rate of " + rate + "\n"
                        : count(v.bits, "bit") + " cannot reach a false-positive rate of " + rate + " with " +
                              count(static_cast<std::size_t>(v.settings.tries), "test") + "\n";
  }
  text += "each view   mean bit accuracy " + percent(accuracy.mean) + ", lowest " + percent(accuracy.min) + " (p " +
          number(accuracy.largest_p) + "); views of one scene are no independent proofs and are not multiplied\n";
  return v.recipients ? text + detail::recipient_lines(v) : text;
}

/// The verdict as one line, which ends with '\n'.
[[nodiscard]] inline std::string verdict_text(const Verification& v) {
  switch (v.verdict) {
    case Verdict::detected:
      return "DETECTED: these images carry the mark of this key; chance alone passes this test with a probability of "
             "at "
             "most " +
             detail::short_number(v.settings.false_positive_rate) + "\n";
    case Verdict::not_detected:
      return "NOT DETECTED: no evidence of this key's message. It does not prove that there never was one\n";
    case Verdict::inconclusive:
      break;
  }
  if (!v.threshold && !v.spread_could_decide)
    return "INCONCLUSIVE: no number of matches could decide at this rate. Use a longer message\n";
  return "INCONCLUSIVE: more than chance would suggest, less than the chosen rate asks for (p up to " +
         detail::short_number(v.settings.suspicion) + "). Read more views\n";
}

/// Both: the report in sentences.
[[nodiscard]] inline std::string report_text(const Verification& v) { return evidence_text(v) + verdict_text(v); }

}  // namespace compmark
