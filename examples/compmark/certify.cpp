// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark certify: a verification as a record for somebody else: one folder with the report, a page, the images as
// they were read, the claim and its time stamp, a soft binding of C2PA, and the SHA-256 of each of them.
#include <algorithm>
#include <compmark/app/files.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/number_text.hpp>
#include <compmark/io/read_file.hpp>
#include <compmark/io/sha256.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/metric/ssim.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <compmark/watermark/proof/soft_binding.hpp>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "common.hpp"
#include "decoder_choice.hpp"
#include "mark_plot.hpp"
#include "report.hpp"
#include "shell_word.hpp"
#include "verification.hpp"

namespace tool {
namespace {

using namespace compmark;
namespace fs = std::filesystem;

constexpr std::size_t largest_copy = std::size_t{1} << 30;

struct Certify : VerifyOptions {
  fs::path out;
};

/// Writes files of the folder and remembers their SHA-256, for `sha256sum -c SHA256SUMS`.
class RecordFolder {
 public:
  explicit RecordFolder(fs::path folder) : folder_(std::move(folder)) {}
  Result<Done> write(const std::string& name, std::span<const std::byte> bytes) {
    const fs::path path = folder_ / name;
    std::error_code failed;
    fs::create_directories(path.parent_path(), failed);
    if (failed)
      return Error{ErrorKind::unwritable, path.parent_path().string(), "", failed.message(), "choose another folder"};
    if (Result<Done> written = write_file(path, bytes); !written) return written;
    sums_ += Sha256().update(bytes).hex() + "  " + name + "\n";
    return Done{};
  }
  Result<Done> write(const std::string& name, const std::string& text) {
    return write(name, std::as_bytes(std::span(text)));
  }
  Result<Done> copy(const fs::path& from, const std::string& name) {
    const Result<std::vector<std::byte>> bytes = read_file(from, largest_copy);
    if (!bytes) return bytes.error();
    return write(name, std::span(*bytes));
  }
  [[nodiscard]] Result<Done> finish() const { return write_file(folder_ / "SHA256SUMS", sums_); }

 private:
  fs::path folder_;
  std::string sums_;
};

/// Whether a decoder is the one that a reader has with the program.
bool is_shipped(const fs::path& decoder) {
  const Result<fs::path> shipped = shipped_decoder();
  if (!shipped) return false;
  const Result<std::string> own = file_sha256(decoder), there = file_sha256(*shipped);
  return own && there && *own == *there;
}

/// Names of the files that command_line reads and the folder does not have: whoever repeats it puts them there.
std::vector<std::string> files_beside(const Certify& options) {
  const ReadingOptions& reading = options.reading;
  std::vector<std::string> names;
  for (const fs::path* path :
       {&options.key, &reading.decoder, &reading.model, &reading.unmarked, &reading.interference}) {
    if (path->empty() || (path == &reading.decoder && is_shipped(*path))) continue;
    names.push_back(path->filename().string());
  }
  return names;
}

/// As --up has it.
std::string axis_word(const std::array<double, 3>& up) {
  const std::size_t axis = up[0] != 0 ? 0 : up[1] != 0 ? 1 : 2;
  return (up[axis] < 0 ? "-" : "") + std::string(1, "xyz"[axis]);
}

/// The line that repeats the verification in the folder. What the folder does not have is named by its file alone.
std::string command_line(const Certify& options) {
  const auto file = [](const fs::path& path) { return shell_word(path.filename()); };
  const ReadingOptions& reading = options.reading;
  std::string line = "compmark verify --key " + file(options.key);
  if (!is_shipped(reading.decoder)) line += " --decoder " + file(reading.decoder);
  line +=
      reading.model.empty() ? " --images images" : " --model " + file(reading.model) + " --split " + reading.split_word;
  if (!reading.model.empty() && reading.views != 0) line += " --views " + std::to_string(reading.views);
  if (!reading.unmarked.empty()) line += " --unmarked " + file(reading.unmarked);
  if (!reading.interference.empty()) line += " --interference " + file(reading.interference);
  if (reading.behind != "black") line += " --background " + reading.behind;
  if (reading.whole_images) line += " --whole-images";
  if (options.mirrored) line += " --mirrored";
  if (options.pruned) line += " --pruned";
  if (reading.restored) line += " --restored";
  if (reading.up) line += " --up=" + axis_word(*reading.up);
  if (!options.proof.claim.empty()) line += " --claim owner.claim";
  if (!options.proof.time_stamp.empty()) line += " --time-stamp owner.tsr";
  if (options.any_decoder) line += " --any-decoder";
  line += " --alpha " + compmark::detail::exact_text(options.alpha);
  if (options.recipient_alpha != VerifySettings{}.recipient_rate)
    line += " --recipient-alpha " + compmark::detail::exact_text(options.recipient_alpha);
  return line + " --tests " + std::to_string(options.tests);
}

/// What the record does not say, for whoever has to weigh it.
std::vector<std::pair<std::string, std::string>> limits(const Verified& verified) {
  std::vector<std::pair<std::string, std::string>> rows{
      {"who",
       "The mark shows that these pictures come from a scene that was marked with this key. Who may use the "
       "scene, and who made it, it does not say."},
      {"when", verified.basis.dated.empty()
                   ? "Nothing here dates the claim. The date in the key file is what its owner wrote."
                   : "The claim existed at " + verified.basis.dated +
                         ", if the signature of the time stamp holds. It is checked by: openssl ts -verify -data "
                         "owner.claim -in owner.tsr -CAfile AUTHORITY.pem"},
      {"chance",
       "The p-value is the chance of a key drawn at random, independently of pictures and decoder. Choosing "
       "among keys, pictures or decoders raises it; --tests counts the choices."},
      {"views",
       "Views of one scene are no independent proofs. Their p-values are for information and are not "
       "multiplied."},
      {"absence", "A mark that is not found does not prove that there never was one."},
      {"the key",
       "Whoever checks needs the key, and can mark with it afterwards. The bits that were read are in this "
       "record."}};
  rows.push_back({"origin",
                  "Where the pictures or the model come from, it does not say. Take them from the accused, and "
                  "all there are: who chooses among pictures of many scenes can choose what they say."});
  if (!verified.basis.claimed)
    rows.insert(rows.begin(), {"claim",
                               "No claim was given: nothing shows that key and decoder are older than the "
                               "pictures."});
  return rows;
}

ReportInput page_of(const Certify& options, const Verified& verified, std::vector<ReportView> views) {
  const Verification& v = verified.report.verification;
  const auto number = [](double value) { return detail::short_number(value); };
  ReportInput page;
  page.title = "Record of a verification";
  page.subtitle = verified.report.sources.program + ", key " + verified.key.id();
  const bool no_proof = verified.standing.kind == StandingKind::not_a_proof;
  std::string verdict = no_proof ? "not a proof" : std::string(verdict_name(verified.verdict.verdict));
  std::replace(verdict.begin(), verdict.end(), '_', ' ');
  page.headline = {{verdict, "verdict"},
                   {std::to_string(v.evidence.matches) + " of " + std::to_string(v.bits), "bits of the key, all views"},
                   {number(verified.verdict.p_corrected), "p-value, corrected for every test"}};
  page.words.push_back({"The verdict", verified_text(verified)});
  page.plots.push_back(logit_plot(message_of(verified.key), v, "Bits of all views together"));
  page.views = std::move(views);
  page.renders = "the unmarked model at the camera that was found, in the picture's tone";
  ReportGrid grid{"Views", {"picture", "SHA-256", "matches", "p-value"}, {}};
  if (verified.informed) grid.columns.insert(grid.columns.end(), {"camera", "deviations of the spread mark", "its p"});
  for (std::size_t i = 0; i < verified.report.views.size(); ++i) {
    const ViewLogits& view = verified.report.views[i];
    grid.rows.push_back({view.name, view.sha256, std::to_string(v.views[i].matches), number(v.views[i].p_value)});
    if (!verified.informed) continue;
    const InformedPicture& picture = verified.informed->pictures[i];
    grid.rows.back().insert(grid.rows.back().end(),
                            {picture.found ? "found" : "not found", detail::fixed_number(picture.spread.deviations, 1),
                             number(picture.spread.p_value)});
  }
  page.grids.push_back(std::move(grid));
  const ReportSources& from = verified.report.sources;
  ReportTable sources{"What was used",
                      {{"commitment of the key", from.key_commitment},
                       {"decoder", from.decoder},
                       {"its SHA-256", from.decoder_sha256}}};
  const auto add = [&](const char* what, const std::string& name, const std::string& sha256) {
    if (!name.empty()) sources.rows.insert(sources.rows.end(), {{what, name}, {"its SHA-256", sha256}});
  };
  add("model", from.model, from.model_sha256);
  add("subtracted model", from.unmarked, from.unmarked_sha256);
  add("subtracted file", from.interference, from.interference_sha256);
  if (verified.basis.claimed) sources.rows.emplace_back("SHA-256 of the claim", verified.basis.claim_sha256);
  if (!verified.basis.dated.empty()) sources.rows.emplace_back("its time stamp", verified.basis.dated);
  page.tables.push_back(std::move(sources));
  std::string beside;
  for (const std::string& name : files_beside(options)) beside += (beside.empty() ? "" : ", ") + name;
  page.tables.push_back(
      {"What was tested",
       {{"null hypothesis", "the key was drawn at random, independently of the images and of the decoder: " +
                                (v.recipients ? "shared bits and the message of any copy are fair coins"
                                              : "matches are Binomial(" + std::to_string(v.bits) + ", 1/2)")},
        {"false-positive rate", number(v.settings.false_positive_rate) + ", chosen before"},
        {"tests counted", std::to_string(v.settings.tries) + " (Bonferroni)"},
        {"matches needed", v.recipients  ? "none: bits are weighted, and the p-value decides"
                           : v.threshold ? std::to_string(*v.threshold)
                                         : "no number is enough"},
        {"p-value", number(v.evidence.p_value)},
        {"to repeat it, put into the folder", beside},
        {"and run there", command_line(options)},
        {"to check the files", "sha256sum -c SHA256SUMS"}}});
  page.tables.push_back({"Limits", limits(verified)});
  return page;
}

int run(const Certify& options) {
  std::error_code failed;
  if (fs::exists(options.out, failed) &&
      !(fs::is_directory(options.out, failed) && fs::is_empty(options.out, failed))) {
    return fail(Error{ErrorKind::invalid, options.out.string(), "--out", "is there already, and not empty",
                      "name a new folder: a record is never replaced"});
  }
  // Every picture beside the unmarked model's render, where a camera was found.
  std::vector<ReportView> views;
  const ComparedObserver compared = [&](const std::string& name, ImageView<const float> picture,
                                        ImageView<const float> render) {
    views.push_back({name,
                     make_report_image(picture),
                     make_report_image(render),
                     psnr(render, picture),
                     ssim(render, picture),
                     {},
                     {}});
  };
  const Result<Verified> verified = verify_by(options, compared);
  if (!verified) return fail(verified.error());

  RecordFolder folder(options.out);
  std::vector<fs::path> files;
  if (options.reading.model.empty()) {
    Result<std::vector<fs::path>> images = image_files(options.reading.images);
    if (!images) return fail(images.error());
    files = std::move(*images);
  }
  // Those that were read, by their SHA-256 (--views reads some); numbered, since names of two folders may be equal.
  std::size_t copied = 0;
  for (const fs::path& file : files) {
    if (copied == verified->report.views.size()) break;
    const Result<std::string> sha256 = file_sha256(file);
    if (!sha256) return fail(sha256.error());
    if (*sha256 != verified->report.views[copied].sha256) continue;
    char number[24];
    std::snprintf(number, sizeof number, "images/%04zu_", ++copied);
    if (Result<Done> done = folder.copy(file, number + file.filename().string()); !done) return fail(done.error());
  }
  if (!files.empty() && copied != verified->report.views.size()) {
    return fail(Error{ErrorKind::invalid, options.reading.images.front().string(), "--images",
                      "changed while they were read", "run it again, and leave the images alone meanwhile"});
  }
  nlohmann::ordered_json json = verified_json(*verified);
  json["repeat"] = command_line(options);
  json["repeat_needs"] = files_beside(options);
  json["limits"] = nlohmann::ordered_json::object();
  for (const auto& [name, text] : limits(*verified)) json["limits"][name] = text;
  const Verification& v = verified->report.verification;
  const std::vector<std::byte> binding = soft_binding_cbor(
      {soft_binding_algorithm(verified->report.sources.decoder, v.bits), v.read.hex(), "mark of a Gaussian splat"});
  Result<Done> written = folder.write("record.json", json.dump(2) + "\n");
  if (written) written = folder.write("record.html", make_report(page_of(options, *verified, std::move(views))));
  if (written && v.verdict == Verdict::detected) written = folder.write("soft_binding.cbor", std::span(binding));
  if (written && !options.proof.claim.empty()) written = folder.copy(options.proof.claim, "owner.claim");
  if (written && !options.proof.time_stamp.empty()) written = folder.copy(options.proof.time_stamp, "owner.tsr");
  if (written) written = folder.finish();
  if (!written) return fail(written.error());
  std::fputs(verified_text(*verified).c_str(), stdout);
  std::printf("%s: the record, with %zu images; its page is record.html\n", options.out.string().c_str(), copied);
  return verified_code(*verified);
}

}  // namespace

Command add_certify(Options& app) {
  auto options = std::make_shared<Certify>();
  add_verify_options(app, options);
  app.writes_into("--out", options->out, "new folder for the record")->required();
  app.footer(
      "Exit codes, as of verify: 0 detected; 1 not detected; 2 error; 3 inconclusive, or no proof. The folder has "
      "record.html, record.json, the images as they were read, claim "
      "and\n"
      "time stamp, a soft-binding assertion of C2PA where the mark was detected (soft_binding.cbor), and SHA256SUMS. "
      "It\n"
      "tells the bits that were read, and nothing else of the key.");
  return [options]() -> int { return with_decoder(*options, run); };
}

}  // namespace tool
