// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "coding.hpp"

#include <chrono>
#include <compmark/app/any_model.hpp>
#include <compmark/app/compress.hpp>
#include <compmark/app/files.hpp>
#include <compmark/app/run/run_results.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/atomic_file.hpp>
#include <string>
#include <system_error>

#include "../compmark/svg_plot.hpp"

namespace fidelity {
namespace {

using compmark::AnyModel, compmark::ThreadExecutor;

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Of the model as a file without a codec: every array, network and setting is in it.
Result<std::string> digest_of(const AnyModel& model, const fs::path& scratch) {
  if (Result<Done> written = model.write(scratch); !written) return written.error();
  Result<std::string> digest = compmark::file_sha256(scratch);
  std::error_code status;
  fs::remove(scratch, status);
  return digest;
}

}  // namespace

Result<Done> code_trained(const Cell& cell, const Settings& settings, const fs::path& trained, const fs::path& folder) {
  const fs::path source = trained / "results.json", other = trained / "model.cmk", file = folder / "model.cmk";
  Result<compmark::RunResults> results = compmark::read_results(source);
  if (!results) return results.error();
  if (!results->compressed) {
    return Error{ErrorKind::malformed, source.string(), "compressed", "is missing", "remove the folder to train again"};
  }
  ThreadExecutor executor(settings.threads);
  const Result<AnyModel> model = AnyModel::open(trained / "model.safetensors", executor);
  if (!model) return model.error();
  compmark::CodedModelSettings coding;
  coding.intra = cell.codec == "hac_plus";
  const Result<compmark::CodecModel> coded = model->coded(coding);
  if (!coded) return coded.error();
  double from = seconds_now();
  const Result<compmark::CodecEncoded> encoded = compmark::write_coded(file, *coded, executor);
  if (!encoded) return encoded.error();
  compmark::CompressedMetrics& metrics = *results->compressed;
  metrics.encode_seconds = seconds_now() - from;
  from = seconds_now();
  const Result<AnyModel> decoded = AnyModel::open(file, executor);
  if (!decoded) return decoded.error();
  metrics.decode_seconds = seconds_now() - from;

  const Result<AnyModel> expected = AnyModel::open(other, executor);
  if (!expected) return expected.error();
  const Result<std::string> digest = digest_of(*decoded, folder / "decoded.safetensors");
  if (!digest) return digest.error();
  const Result<std::string> wanted = digest_of(*expected, folder / "decoded.safetensors");
  if (!wanted) return wanted.error();
  if (*digest != *wanted) {
    return Error{ErrorKind::malformed,
                 file.string(),
                 {},
                 "decodes to another model than " + other.string() + ", whose qualities it should have",
                 "remove both folders to train again"};
  }
  const compmark::CodecReport& report = encoded->report;
  const std::string told = tool::format_text("%s: %llu bytes; %s: %llu bytes, of the same model\n", cell.codec.c_str(),
                                             static_cast<unsigned long long>(report.total_bytes), metrics.codec.c_str(),
                                             static_cast<unsigned long long>(metrics.bytes));
  metrics.codec = cell.codec;
  metrics.bytes = report.total_bytes;
  metrics.anchors = report.anchors;
  metrics.sections = compmark::coded_sections(report);
  if (Result<Done> written = compmark::write_file(folder / "compress.txt", told); !written) return written;
  return compmark::write_results(folder / "results.json", *results);
}

}  // namespace fidelity
