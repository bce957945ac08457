// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/app/run/embed.hpp>
#include <compmark/app/run/fit_decoder.hpp>
#include <compmark/app/run/mark_record.hpp>
#include <compmark/app/run/run_results.hpp>
#include <compmark/app/run/train.hpp>
#include <compmark/app/spread.hpp>
#include <compmark/app/verify.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/io/splat/read_splat.hpp>
#include <compmark/splat/anchor/explicit_decoder.hpp>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "app/run/small_run.hpp"
#include "io/splat_writers.hpp"
#include "support/damage.hpp"

namespace {

using namespace compmark;
using testing::KeepingObserver;

/// An unmarked model, a key and a decoder of eight bits that is fitted to it in a second.
struct Unmarked {
  testing::SmallCapture scene;
  ThreadExecutor executor{2};
  KeepingObserver told;
  std::filesystem::path model, decoder = scene.folder.path / "decoder.safetensors";
  OwnerKey key = scene.make_key();
  std::size_t anchors = 0;

  explicit Unmarked(const std::string& name) : scene(name) {
    TrainSceneSettings training = scene.training("unmarked");
    training.iterations = 60;
    const Result<RunOutcome> trained = train_scene(training, executor, told);
    REQUIRE(trained.ok());
    anchors = trained->results.anchors;
    model = training.out / "model.safetensors";
    DecoderFileSettings fit;
    fit.model = model;
    fit.data = scene.data;
    fit.out = decoder;
    fit.fit.bits = 8;
    fit.fit.features = 24;
    fit.fit.statistics_views = 96;
    fit.fit.gradient_views = 2;
    REQUIRE(fit_decoder_file(fit, executor, told).ok());
  }
  [[nodiscard]] EmbedSettings embedding(const std::string& out) const {
    EmbedSettings settings;
    settings.data = scene.data;
    settings.out = scene.folder.path / out;
    settings.model = model;
    settings.mark.key = scene.key;
    settings.mark.decoder = decoder;
    settings.iterations = 150;
    return settings;
  }
};

TEST_CASE("app/run/embed: the message of the key is in the renders, and was not before") {
  Unmarked unmarked("compmark-run-embed");
  const EmbedSettings settings = unmarked.embedding("marked");
  const Result<RunOutcome> outcome = embed_message(settings, unmarked.executor, unmarked.told);
  REQUIRE(outcome.ok());
  CHECK(outcome->results.method == "compmark");
  REQUIRE(outcome->results.watermark.has_value());
  REQUIRE(outcome->verification.has_value());
  ReadingSettings reading;
  reading.decoder = unmarked.decoder;
  reading.model = outcome->model;
  const auto with_mark = verify_files(unmarked.key, reading, {}, unmarked.executor);
  reading.model = unmarked.model;
  const auto without = verify_files(unmarked.key, reading, {}, unmarked.executor);
  REQUIRE(with_mark.ok());
  REQUIRE(without.ok());
  // How far all bits together lean towards the message. So brief a mark need not turn every one of them.
  const auto signal = [&](const Verification& verification) {
    const Message message = message_of(unmarked.key);
    double sum = 0;
    for (std::size_t b = 0; b < 8; ++b) sum += (message[b] ? 1 : -1) * verification.fused[b] / 8;
    return sum;
  };
  CAPTURE(signal(with_mark->verification));
  CAPTURE(signal(without->verification));
  CHECK(with_mark->verification.evidence.matches >= 6);
  CHECK(signal(with_mark->verification) > signal(without->verification) + 0.5);
  CHECK(outcome->results.watermark->psnr_marked_vs_unmarked.value_or(0) > 20);
  const auto record = read_mark(settings.out / "mark.json");
  REQUIRE(record.has_value());
  CHECK(record->key_commitment == unmarked.key.commitment());
  CHECK(check_recorded(unmarked.scene.key, unmarked.key, unmarked.decoder, outcome->model, {}).ok());
}

TEST_CASE("app/run/embed: a run that is stopped and resumed ends in the same bits, from the same model alone") {
  Unmarked unmarked("compmark-run-embed-resume");
  KeepingObserver first, second, other;
  REQUIRE(embed_message(unmarked.embedding("whole"), unmarked.executor, first).ok());
  EmbedSettings settings = unmarked.embedding("parts");
  first.stop_after = 67;
  CHECK(embed_message(settings, unmarked.executor, first).error().kind == ErrorKind::cancelled);
  settings.resume = true;
  EmbedSettings changed = settings;
  changed.mark.weight = 3;
  const Result<RunOutcome> refused = embed_message(changed, unmarked.executor, other);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().problem.find("watermark") != std::string::npos);
  REQUIRE(embed_message(settings, unmarked.executor, second).ok());
  CHECK(second.beginnings[0].iteration == 67);
  CHECK(testing::same_file(settings.out / "model.safetensors", unmarked.scene.folder.path / "whole/model.safetensors"));
}

TEST_CASE("app/run/embed: a baseline hides the message in its own way, and results.json says which") {
  Unmarked unmarked("compmark-run-embed-baselines");
  const Message message = message_of(unmarked.key);
  const auto signal_in = [&](const std::filesystem::path& model) {
    ReadingSettings reading;
    reading.decoder = unmarked.decoder;
    reading.model = model;
    const auto read = verify_files(unmarked.key, reading, {}, unmarked.executor);
    REQUIRE_MESSAGE(read.ok(), read.error().line());
    double sum = 0;
    for (std::size_t b = 0; b < 8; ++b) sum += (message[b] ? 1 : -1) * read->verification.fused[b] / 8;
    return sum;
  };
  const auto changed_in = [&](const std::filesystem::path& model) {
    const auto before = read_safetensors(unmarked.model), after = read_safetensors(model);
    REQUIRE(before.ok());
    REQUIRE(after.ok());
    std::vector<std::string> names;
    for (const auto& [name, tensor] : before->tensors) {
      const auto other = after->tensors.find(name);
      REQUIRE(other != after->tensors.end());
      const bool same =
          std::equal(tensor.data.begin(), tensor.data.end(), other->second.data.begin(), other->second.data.end());
      if (!same && name != "info") names.push_back(name);
    }
    CHECK(before->tensors.size() == after->tensors.size());
    return names;
  };
  const double before = signal_in(unmarked.model);
  CAPTURE(before);
  for (const EmbedMethod method :
       {EmbedMethod::waterf, EmbedMethod::guardsplat, EmbedMethod::gaussianmarker, EmbedMethod::threedgsw}) {
    const std::string name(name_of(method));
    CAPTURE(name);
    EmbedSettings settings = unmarked.embedding(name);
    settings.method = method;
    if (method == EmbedMethod::guardsplat) settings.mark.weight = 1;  // 150 iterations of 48 x 48 pixels
    const Result<RunOutcome> outcome = embed_message(settings, unmarked.executor, unmarked.told);
    REQUIRE_MESSAGE(outcome.ok(), outcome.error().line());
    CHECK(outcome->results.method == name);
    const Result<RunResults> written = read_results(settings.out / "results.json");
    REQUIRE(written.ok());
    CHECK(written->method == name);
    const double after = signal_in(outcome->model);
    CAPTURE(after);
    CHECK(after > before + 0.2);
    const std::vector<std::string> changed = changed_in(outcome->model);
    // Everything but the places of the anchors, the features alone, or the anchors and no network; 3D-GSW removes
    // anchors too.
    const std::size_t anchors = outcome->results.anchors, host = unmarked.anchors;
    if (method == EmbedMethod::guardsplat) {
      CHECK(changed.size() == 1);
    } else if (method == EmbedMethod::gaussianmarker) {
      CHECK(changed.size() == 4);
      CHECK(anchors > host);
      CHECK(anchors <= host + (host + 1) / 2);
    } else {
      CHECK(changed.size() > 5);
    }
    if (method == EmbedMethod::waterf || method == EmbedMethod::guardsplat) CHECK(anchors == host);
  }
  // A finished run of one method is no run of another.
  EmbedSettings other = unmarked.embedding("waterf");
  other.method = EmbedMethod::guardsplat;
  other.resume = true;
  const Result<RunOutcome> refused = embed_message(other, unmarked.executor, unmarked.told);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().problem.find("--method") != std::string::npos);
}

TEST_CASE("app/run/embed: a baseline that is stopped and resumed ends in the same bits") {
  Unmarked unmarked("compmark-run-embed-baseline-resume");
  for (const EmbedMethod method :
       {EmbedMethod::waterf, EmbedMethod::guardsplat, EmbedMethod::gaussianmarker, EmbedMethod::threedgsw}) {
    const std::string name(name_of(method));
    CAPTURE(name);
    KeepingObserver first, second;
    EmbedSettings settings = unmarked.embedding(name + "-whole");
    settings.method = method;
    settings.iterations = 40;
    REQUIRE(embed_message(settings, unmarked.executor, second).ok());
    settings.out = unmarked.scene.folder.path / (name + "-parts");
    first.stop_after = 17;
    CHECK(embed_message(settings, unmarked.executor, first).error().kind == ErrorKind::cancelled);
    settings.resume = true;
    REQUIRE(embed_message(settings, unmarked.executor, second).ok());
    CHECK(testing::same_file(settings.out / "model.safetensors",
                             unmarked.scene.folder.path / (name + "-whole") / "model.safetensors"));
  }
}

/// What the pictures of `model` at the stored cameras say of the spread mark of `key`, read by the unmarked one.
SpreadEvidence spread_of(const std::filesystem::path& model, const Unmarked& unmarked, const OwnerKey& key) {
  ThreadExecutor executor(2);
  Result<AnyModel> shown = AnyModel::open(model, executor), plain = AnyModel::open(unmarked.model, executor);
  REQUIRE(shown.ok());
  REQUIRE(plain.ok());
  Result<SpreadReader> reader = SpreadReader::make(*plain, executor);
  REQUIRE(reader.ok());
  std::vector<double> sums(reader->cells().place.size(), 0.0);
  for (const StoredView& view : plain->info().views) {
    const Result<RenderedView> picture = shown->render(view, executor), render = plain->render(view, executor);
    REQUIRE(picture.ok());
    REQUIRE(render.ok());
    const ImageView<const float> said(picture->image);
    const std::vector<float> weight(said.size() / 3, 1.0f);
    REQUIRE(reader->add(said, ImageView<const float>(render->image), weight, view.camera, executor, sums).ok());
  }
  return spread_evidence(spread_signs(key, reader->cells()), sums);
}

TEST_CASE("app/run/embed: a spread mark is hidden beside the message, and a resumed run has both to the bit") {
  Unmarked unmarked("compmark-run-embed-spread");
  EmbedSettings settings = unmarked.embedding("plain");
  settings.iterations = 60;
  const Result<RunOutcome> plain = embed_message(settings, unmarked.executor, unmarked.told);
  REQUIRE(plain.ok());
  settings.out = unmarked.scene.folder.path / "both";
  settings.mark.spread = 40;
  const Result<RunOutcome> both = embed_message(settings, unmarked.executor, unmarked.told);
  REQUIRE_MESSAGE(both.ok(), both.error().line());
  Digest256 secret{};
  secret[7] = std::byte{77};
  const Result<OwnerKey> other = make_key(secret, "2026-01-31T23:59:59Z", 8);
  REQUIRE(other.ok());
  const SpreadEvidence evidence = spread_of(both->model, unmarked, unmarked.key),
                       without = spread_of(plain->model, unmarked, unmarked.key),
                       wrong = spread_of(both->model, unmarked, *other);
  MESSAGE("deviations ", evidence.deviations, ", without it ", without.deviations, ", another key ", wrong.deviations);
  CHECK(evidence.p_value < 1e-6);
  CHECK(without.p_value > 1e-3);
  CHECK(wrong.p_value > 1e-3);
  // The file that the message was learned from is gone; results.json knows the option.
  for (const auto& file : std::filesystem::directory_iterator(settings.out))
    CHECK(file.path().filename().string().find("spread") == std::string::npos);
  settings.resume = true;
  REQUIRE(embed_message(settings, unmarked.executor, unmarked.told).ok());
  settings.mark.spread = 45;
  const Result<RunOutcome> changed = embed_message(settings, unmarked.executor, unmarked.told);
  REQUIRE_FALSE(changed.ok());
  CHECK(changed.error().problem.find("--spread") != std::string::npos);

  settings.out = unmarked.scene.folder.path / "parts";
  settings.mark.spread = 40;
  settings.resume = false;
  KeepingObserver stopping, going_on;
  stopping.stop_after = 27;
  CHECK(embed_message(settings, unmarked.executor, stopping).error().kind == ErrorKind::cancelled);
  settings.resume = true;
  REQUIRE(embed_message(settings, unmarked.executor, going_on).ok());
  CHECK(going_on.beginnings[0].iteration == 27);
  CHECK(testing::same_file(settings.out / "model.safetensors", both->model));
}

TEST_CASE("app/run/embed: what cannot be marked, or not in this way, is refused with the option's name") {
  Unmarked unmarked("compmark-run-embed-wrong");
  const auto field_of = [&](auto change) {
    EmbedSettings settings = unmarked.embedding("refused");
    change(settings);
    const Result<RunOutcome> outcome = embed_message(settings, unmarked.executor, unmarked.told);
    REQUIRE_FALSE(outcome.ok());
    return outcome.error().field;
  };
  CHECK(field_of([](EmbedSettings& s) { s.distortion = EmbedDistortion::noise; }) == "--distortion");
  CHECK(field_of([](EmbedSettings& s) { s.mark.period = 0.2; }) == "--period");
  CHECK(field_of([](EmbedSettings& s) { s.mark.calibrate_steps = 20; }) == "--calibrate-steps");
  CHECK(field_of([](EmbedSettings& s) { s.mark.bits = 16; }) == "bits");
  CHECK(field_of([](EmbedSettings& s) { s.mark.spread = 20; }) == "--spread");
  CHECK(field_of([](EmbedSettings& s) { s.codec = "hac_puls"; }) == "--codec");
  CHECK(field_of([](EmbedSettings& s) {
          s.mark.fidelity = 0;
          s.mark.fall = 1;
        }) == "--fidelity-fall");
  // A decoder would be fitted, and the key is bound to one: told before anything is trained.
  Digest256 secret{};
  secret[3] = std::byte{5};
  const auto bound =
      make_bound_key(secret, std::string(64, 'a'), "2026-01-31T23:59:59Z", 8, "", OwnerKey::least_hardness);
  const std::filesystem::path bound_file = unmarked.scene.folder.path / "bound.key";
  REQUIRE(write_key(bound_file, *bound).ok());
  CHECK(field_of([&](EmbedSettings& s) {
          s.mark.key = bound_file;
          s.mark.decoder.clear();
        }) == "--decoder");
  // What a baseline has no use for.
  const auto field_of_baseline = [&](auto change) {
    return field_of([&](EmbedSettings& s) {
      s.method = EmbedMethod::guardsplat;
      change(s.mark);
    });
  };
  CHECK(field_of_baseline([](MarkSettings& m) { m.fidelity = 100; }) == "--fidelity");
  CHECK(field_of_baseline([](MarkSettings& m) { m.orbit = 0.5; }) == "--orbit");
  CHECK(field_of_baseline([](MarkSettings& m) { m.photographs = 0.5; }) == "--photographs");
  CHECK(field_of_baseline([](MarkSettings& m) { m.margin = 2; }) == "--message-margin");
  CHECK(field_of_baseline([](MarkSettings& m) { m.lost_anchors = 0.5; }) == "--lost-anchors");
  CHECK(field_of_baseline([](MarkSettings& m) { m.spread = 50; }) == "--spread");
  CHECK(field_of_baseline([](MarkSettings& m) { m.for_compression = true; }) == "--for-compression");
}

TEST_CASE("app/run/embed: the splats of another program are marked as they are, without photographs") {
  const testing::ScratchFolder folder("compmark-run-embed-splats");
  ThreadExecutor executor(2);
  KeepingObserver told;
  const SplatTable table = testing::splats::random_splats(400, 1);
  const std::filesystem::path ply = folder.path / "scene.ply", key_file = folder.path / "owner.key";
  testing::put_raw(ply, testing::splats::permuted_ply_bytes(table, 1));
  Digest256 secret{};
  secret[5] = std::byte{9};
  const Result<OwnerKey> key = make_key(secret, "2026-01-31T23:59:59Z", 8);
  REQUIRE(key.ok());
  REQUIRE(write_key(key_file, *key).ok());

  DecoderFileSettings fit;
  fit.model = fit.data = ply;
  fit.out = folder.path / "decoder.safetensors";
  fit.downscale = 16;  // 50 x 50
  fit.fit.bits = 8;
  fit.fit.features = 24;
  fit.fit.statistics_views = 96;
  fit.fit.gradient_views = 2;
  const Result<FittedDecoder> decoder = fit_decoder_file(fit, executor, told);
  REQUIRE_MESSAGE(decoder.ok(), decoder.error().line());

  EmbedSettings settings;
  settings.model = ply;
  settings.out = folder.path / "marked";
  settings.mark.key = key_file;
  settings.mark.decoder = fit.out;
  settings.downscale = 16;
  settings.iterations = 300;
  EmbedSettings with_spread = settings;  // whose directions are those of features
  with_spread.mark.spread = 50;
  CHECK(embed_message(with_spread, executor, told).error().field == "--spread");
  const Result<RunOutcome> outcome = embed_message(settings, executor, told);
  REQUIRE_MESSAGE(outcome.ok(), outcome.error().line());
  REQUIRE(outcome->results.watermark.has_value());
  CHECK(outcome->views == 16);
  CHECK(outcome->results.watermark->psnr_marked_vs_unmarked.value_or(0) > 20);
  CHECK_FALSE(outcome->results.watermark->psnr_cost_vs_unmarked.has_value());  // there are no photographs
  CHECK(outcome->psnr == doctest::Approx(*outcome->results.watermark->psnr_marked_vs_unmarked));

  // The message is read of the marked model, and not of the file that came.
  ReadingSettings reading;
  reading.decoder = fit.out;
  reading.model = outcome->model;
  const auto with_mark = verify_files(*key, reading, {}, executor);
  REQUIRE_MESSAGE(with_mark.ok(), with_mark.error().line());
  // 6 after 150 iterations. How far all bits together lean towards the message; without a mark it is about 0.
  const Message message = message_of(*key);
  double lean = 0;
  for (std::size_t b = 0; b < 8; ++b) lean += (message[b] ? 1 : -1) * with_mark->verification.fused[b] / 8;
  CAPTURE(lean);
  CHECK(with_mark->verification.evidence.matches >= 6);
  CHECK(lean > 0.5);

  // marked.ply holds the same Gaussians: places and sizes of the file that came, other colours. It has harmonics of the
  // degree that came, and all of the mark: what it has not was not moved.
  const Result<SplatFile> marked = read_splat(settings.out / "marked.ply");
  REQUIRE_MESSAGE(marked.ok(), marked.error().line());
  REQUIRE(marked->table.count == table.count);
  CHECK(marked->table.degree == 1);
  const Result<SafetensorsFile> model = read_safetensors(outcome->model);
  REQUIRE(model.ok());
  const auto feature = model->tensors.find("anchor.feature");
  REQUIRE(feature != model->tensors.end());
  using Layout = ExplicitLayout<3>;
  REQUIRE(feature->second.data.size() == table.count * Layout::width * sizeof(float));
  double above = 0, within = 0;
  for (std::size_t i = 0; i < table.count * Layout::width; ++i) {
    float value = 0;
    std::memcpy(&value, feature->second.data.data() + i * sizeof value, sizeof value);
    const std::size_t column = i % Layout::width;
    if (column < Layout::color) continue;
    const std::size_t coefficient = (column - Layout::color) % Layout::coefficients;
    double& largest = coefficient >= sh_count(1) ? above : within;
    largest = std::max(largest, std::abs(static_cast<double>(value)));
  }
  CHECK(above == 0);
  CHECK(within > 1e-3);  // negative control
  double moved = 0, recoloured = 0;
  for (std::size_t i = 0; i < table.count; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto distance = [&](const std::vector<float>& a, const std::vector<float>& b) {
        return std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
      };
      moved = std::max(moved, distance(marked->table.mean[axis], table.mean[axis]));
      moved = std::max(moved, distance(marked->table.log_scale[axis], table.log_scale[axis]));
      recoloured = std::max(recoloured, distance(marked->table.color(axis, 0), table.color(axis, 0)));
    }
  }
  CHECK(moved < 1e-6);
  CHECK(recoloured > 1e-3);
  const auto record = read_mark(settings.out / "mark.json");
  REQUIRE(record.has_value());
  CHECK(record->models.size() == 2);

  // A model of ours still needs its photographs.
  settings.model = outcome->model;
  settings.out = folder.path / "again";
  CHECK(embed_message(settings, executor, told).error().field == "--data");
  settings.model = ply;
  settings.mark.fidelity = 0;
  CHECK(embed_message(settings, executor, told).error().field == "--recipe");
}

}  // namespace
