// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The part that train and embed share to hide a message: the key's message, its decoder, and the measurement of the
// result.
#pragma once

#include <array>
#include <compmark/app/dataset_views.hpp>
#include <compmark/splat/training/settings.hpp>
#include <compmark/watermark/proof/message.hpp>
#include <compmark/watermark/proof/report.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common.hpp"
#include "model_files.hpp"
#include "options.hpp"
#include "reading.hpp"
#include "results.hpp"
#include "svg_plot.hpp"

namespace tool {

struct MarkOptions {
  std::size_t bits = 0;  ///< 0: the key's
  std::filesystem::path key;
  std::filesystem::path decoder;
  std::filesystem::path twin;              ///< unmarked model to compare with; may be empty
  std::optional<double> period, tone;      ///< of a decoder that is fitted on the way (DecoderFitSettings)
  std::optional<double> weight;            ///< of the message; not set: the profile's
  std::optional<double> margin;            ///< of the hinge, in logits
  std::optional<double> power;             ///< of the hinge
  std::optional<double> rate;              ///< at which the mark is learned; not set: that of the command
  std::optional<double> fidelity;          ///< of the marked renders to the unmarked ones; not set: that of the command
  std::optional<double> fall;              ///< power by which the fidelity falls with the distance from the photographs
  std::optional<double> by_cost;           ///< share of the draw of cameras that follows what the message costs there
  std::optional<std::int64_t> hold_steps;  ///< cadence of PosthocSettings::hold_steps_every
  std::int64_t message_every = 1;          ///< cadence
  bool for_compression = false;            ///< with the noise of quantization
  /// Whether any of them was given. A key without a decoder, or a decoder without a key, is an error and not an
  /// unmarked model.
  [[nodiscard]] bool wanted() const {
    return bits != 0 || !key.empty() || !decoder.empty() || !twin.empty() || period || tone || weight || margin ||
           power || rate || fidelity || fall || by_cost || hold_steps || message_every != 1 || for_compression;
  }
};
/// --bits, --key, --decoder, --period, --tone, --twin, --message-weight, --message-margin, --message-power,
/// --message-rate, --fidelity, --fidelity-fall, --draw-by-cost, --hold-steps, --message-every, --for-compression
void add_mark_options(Options& app, MarkOptions& options, bool required);

/// An error if options for fitting a decoder are given together with a finished decoder.
compmark::Result<compmark::Done> check_to_fit(const MarkOptions& options);

/// An error if options of post-hoc embedding are given with a `fidelity` of 0.
compmark::Result<compmark::Done> check_held(const MarkOptions& options, double fidelity);

struct MarkInput {
  compmark::OwnerKey key;
  Decoder decoder;
  compmark::Message message;
  std::vector<std::uint8_t> bits;  ///< the same, one a byte
  compmark::ReportSources sources;
  std::filesystem::path twin;
  std::filesystem::path coded_twin;  ///< of the compressed model; empty: `twin`
  double twin_unit = 1;              ///< as in the counterpart's ModelInfo, likewise the origin
  std::array<double, 3> twin_origin{0, 0, 0};
  std::filesystem::path key_file;
  std::string decoder_tensors;  ///< tensors_sha256 (mark_record.hpp)
  bool for_compression = false;
  bool read_only = false;  ///< the source model already holds the message: it is only read, and nothing trains for it
};
/// Whether a decoder was fitted to a scene: its cover interference is low there, and a mark costs less.
bool fitted_decoder(const std::filesystem::path& path);
/// The key of --key; its message must have the length of --bits, if that is given.
compmark::Result<compmark::OwnerKey> key_of(const MarkOptions& options);
/// Reads key and decoder, which must agree on the length, and sets the mark's numbers in the settings of the run.
compmark::Result<MarkInput> load_mark(const MarkOptions& options, compmark::TrainSettings& settings);

/// The measurement of a mark, for results.json.
struct MarkMeasurement {
  compmark::VerificationReport report;
  std::optional<double> unmarked_psnr;            ///< of the counterpart's renders against the photographs, mean, dB
  std::optional<double> psnr_marked_vs_unmarked;  ///< of the two renders, mean over the views, dB
};
/// Reads the message from every view of a marked model, as a verifier does: from renders rounded to 8 bits.
compmark::Result<MarkMeasurement> measure_mark(compmark::AnyModel& model, const MarkInput& mark,
                                               compmark::DatasetViews views, compmark::ThreadExecutor& executor);

/// The part of it that results.json holds.
WatermarkMetrics watermark_metrics(const compmark::Verification& verification);

}  // namespace tool
