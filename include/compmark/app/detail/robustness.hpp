// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/robustness.hpp. Longer than 300 lines: what is read of one cell is kept together.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/app/detail/informed.hpp"
#include "compmark/app/detail/model_attack.hpp"
#include "compmark/app/detail/reading.hpp"
#include "compmark/app/detail/render_reading.hpp"
#include "compmark/app/robustness.hpp"
#include "compmark/app/verify.hpp"
#include "compmark/core/random.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/metric/psnr.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/watermark/attack/pgd.hpp"
#include "compmark/watermark/attack/picture_attacks.hpp"
#include "compmark/watermark/proof/key.hpp"
#include "compmark/watermark/proof/restored_features.hpp"

namespace compmark {
namespace detail {

/// A key that nobody has: the thief's, whose carriers he knows. It derives from every bit of the root turned round.
[[nodiscard]] inline OwnerKey another_key(OwnerKey key) {
  key.secret = key.root();
  for (std::byte& byte : key.secret) byte = ~byte;
  key.hardness = 0;
  return key;
}

}  // namespace detail

COMPMARK_APP_INLINE Result<RobustnessBench> RobustnessBench::open(const RobustnessSettings& settings,
                                                                  ThreadExecutor& executor) {
  RobustnessBench bench;
  bench.settings_ = settings;
  Result<OwnerKey> key = open_key(settings.key);
  if (key) key = for_recipient(*key, settings.key, settings.recipient);
  if (!key) return key.error();
  bench.key_ = *key;
  Result<FileDecoder> decoder = open_decoder(settings.decoder, &bench.key_);
  if (!decoder) return decoder.error();
  bench.decoder_ = std::move(*decoder);
  Result<AnyModel> model = AnyModel::open(settings.model, executor);
  if (!model) return model.error();
  std::vector<StoredView> views = model->info().views;
  if (std::any_of(views.begin(), views.end(), [](const StoredView& view) { return view.test; }))
    std::erase_if(views, [](const StoredView& view) { return !view.test; });
  if (views.empty()) {
    return Error{ErrorKind::invalid, settings.model.string(), "--model", "stores no camera",
                 "give a model of compmark train"};
  }
  if (!settings.unmarked.empty() && settings.informed_views > 0 && settings.pictures.empty()) {
    return Error{
        ErrorKind::invalid, {}, "pictures", "is missing", "name a folder for the pictures that informed reading reads"};
  }
  if (settings.restored && settings.unmarked.empty()) {
    return Error{
        ErrorKind::invalid, {}, "--restored", "needs the unmarked model", "give --unmarked, or leave --restored out"};
  }
  detail::keep_evenly(views, settings.views);
  bench.views_ = std::move(views);
  Result<Pictures> before = bench.renders(*model, executor);
  if (!before) return before.error();
  bench.before_ = std::move(*before);
  if (settings.restored) {
    Reading sources;
    Result<AnyModel> unmarked = detail::load_unmarked(settings.unmarked, model->info(), sources, executor);
    if (!unmarked) return unmarked.error();
    Result<Pictures> pictures = bench.renders(*unmarked, executor);
    if (!pictures) return pictures.error();
    Result<std::vector<ViewLogits>> said = bench.logits_of(*pictures, executor);
    if (!said) return said.error();
    bench.unmarked_ = std::move(*said);
  }
  return bench;
}

COMPMARK_APP_INLINE Result<std::vector<AttackedPicture>> RobustnessBench::renders(AnyModel& model,
                                                                                  ThreadExecutor& executor) const {
  Pictures pictures;
  for (const StoredView& view : views_) {
    const Result<RenderedView> render = model.render(view, executor);
    if (!render) return render.error();
    round_to_8bit<float>(render->image, render->image);
    const ImageView<float> image = render->image;
    pictures.push_back({image.height, image.width, {image.data, image.data + image.size()}});
  }
  return pictures;
}

COMPMARK_APP_INLINE Result<std::vector<AttackedPicture>> RobustnessBench::pgd(const std::string& text,
                                                                              ThreadExecutor& executor) {
  const std::size_t colon = text.find(':');
  const std::string_view name = std::string_view(text).substr(0, colon);
  PgdSettings settings;
  if (colon != std::string::npos) {
    const char* const end = text.data() + text.size();
    const auto [read, status] = std::from_chars(text.data() + colon + 1, end, settings.epsilon);
    if (status != std::errc() || read != end) settings.epsilon = -1;
  }
  if ((name != "pgd" && name != "pgd_random" && name != "pgd_no_key") ||
      !(settings.epsilon >= 0 && settings.epsilon <= 1)) {
    return Error{ErrorKind::invalid,
                 {},
                 "attack",
                 "\"" + text.substr(0, 40) + "\" is none of pgd, pgd_random, pgd_no_key, with an epsilon from 0 to 1",
                 "give pgd:0.1"};
  }
  FileDecoder known = decoder_;
  if (name == "pgd_no_key") {
    const OwnerKey other = detail::another_key(key_);
    Result<FileDecoder> opened = open_decoder(settings_.decoder, &other);
    if (!opened) return opened.error();
    known = std::move(*opened);
  }
  FileDecoder::Context context;
  Pictures pictures;
  for (std::size_t v = 0; v < before_.size(); ++v) {
    settings.seed = settings_.seed + v;
    std::vector<std::uint8_t> aim = opposite_bits(before_[v].view(), known, context, executor);
    if (name == "pgd_random") {
      const Random random(settings.seed, 0, random_stage("attack/pgd_random"));
      for (std::size_t bit = 0; bit < aim.size(); ++bit) aim[bit] = random.uniform(bit) < 0.5 ? 0 : 1;
    }
    pictures.push_back(
        pgd_picture(before_[v].view(), known, context, std::span<const std::uint8_t>(aim), settings, executor));
  }
  return pictures;
}

COMPMARK_APP_INLINE Result<std::vector<AttackedPicture>> RobustnessBench::attacked(const RobustnessAttack& attack,
                                                                                   double missing_share,
                                                                                   ThreadExecutor& executor) {
  if (attack.kind == RobustnessKind::none) return before_;
  if (attack.kind == RobustnessKind::pgd) return pgd(attack.text, executor);
  if (attack.kind == RobustnessKind::picture) {
    Pictures pictures;
    for (std::size_t v = 0; v < before_.size(); ++v) {
      Result<AttackedPicture> picture =
          attack_picture<PictureAttacks>(attack.text, before_[v].view(), settings_.seed + v);
      if (!picture) return picture.error();
      pictures.push_back(std::move(*picture));
    }
    return pictures;
  }
  Result<AnyModel> model = attacked_model(attack, executor);
  if (!model) return model.error();
  if (Result<Done> done = model->make_up_for(missing_share); !done) return done.error();
  return renders(*model, executor);
}

COMPMARK_APP_INLINE Result<AnyModel> RobustnessBench::attacked_model(const RobustnessAttack& attack,
                                                                     ThreadExecutor& executor) const {
  if (attack.kind == RobustnessKind::other && attack.files.empty())
    return Error{ErrorKind::invalid, {}, attack.text, "names no model", "give its file"};
  Result<AnyModel> model =
      AnyModel::open(attack.kind == RobustnessKind::other ? attack.files[0] : settings_.model, executor);
  if (!model) return model;
  Result<Done> done = Done{};
  if (attack.kind == RobustnessKind::model) done = attack_any_model(*model, attack.text, settings_.seed, executor);
  if (attack.kind == RobustnessKind::average) done = average_models(*model, attack.files, executor);
  if (!done) return done.error();
  return model;
}

COMPMARK_APP_INLINE Result<std::vector<ViewLogits>> RobustnessBench::logits_of(Pictures& pictures,
                                                                               ThreadExecutor& executor) {
  std::vector<ViewLogits> read;
  for (std::size_t v = 0; v < pictures.size(); ++v) {
    AttackedPicture& picture = pictures[v];
    const ImageView<float> image{picture.planes.data(), 3, picture.height, picture.width};
    round_to_8bit<float>(image, image);
    Result<ViewLogits> logits =
        read_logits(decoder_, ImageView<const float>(image), views_[v].name, context_, executor);
    if (!logits) return logits.error();
    read.push_back(std::move(*logits));
  }
  return read;
}

COMPMARK_APP_INLINE Result<std::optional<RestoredCell>> RobustnessBench::read_restored(const RobustnessAttack& attack,
                                                                                       ThreadExecutor& executor) {
  Result<AnyModel> model = attacked_model(attack, executor);
  if (!model) return model.error();
  Result<AnyModel> whole = AnyModel::open(settings_.unmarked, executor);
  if (!whole) return whole.error();
  const Result<RestoredFeatures> features = restore_features(whole->arena(), std::as_const(model->arena()), executor);
  if (!features) return std::optional<RestoredCell>();  // another scene, or other networks
  Result<Pictures> pictures = renders(*whole, executor);
  if (!pictures) return pictures.error();
  Result<std::vector<ViewLogits>> read = logits_of(*pictures, executor);
  if (!read) return read.error();
  for (std::size_t v = 0; v < read->size(); ++v) {
    for (std::size_t bit = 0; bit < (*read)[v].logits.size(); ++bit) (*read)[v].logits[bit] -= unmarked_[v].logits[bit];
  }
  const Result<Verification> verified = verify_message(message_of(key_), *read, VerifySettings{});
  if (!verified) return verified.error();
  RestoredCell cell;
  cell.features = *features;
  cell.matches = verified->evidence.matches;
  cell.p_value = verified->evidence.p_value;
  cell.worst = 1;
  for (const Evidence& view : verified->views) {
    const double share = static_cast<double>(view.matches) / static_cast<double>(verified->bits);
    cell.mean += share / static_cast<double>(verified->views.size());
    cell.worst = std::min(cell.worst, share);
  }
  return std::optional(cell);
}

COMPMARK_APP_INLINE Result<Done> RobustnessBench::read_informed(const Pictures& pictures, ThreadExecutor& executor,
                                                                RobustnessCell& cell) {
  std::error_code status;
  std::filesystem::create_directories(settings_.pictures, status);
  if (status) {
    return Error{ErrorKind::unwritable,
                 settings_.pictures.string(),
                 {},
                 "cannot be created: " + status.message(),
                 "choose another folder"};
  }
  std::vector<std::size_t> chosen(pictures.size());
  for (std::size_t v = 0; v < chosen.size(); ++v) chosen[v] = v;
  detail::keep_evenly(chosen, settings_.informed_views);
  ReadingSettings reading;
  for (const std::size_t v : chosen) {
    reading.images.push_back(settings_.pictures / ("view_" + std::to_string(v) + ".png"));
    if (Result<Done> written = write_png(reading.images.back(), pictures[v].view()); !written) return written;
  }
  reading.decoder = settings_.decoder;
  reading.unmarked = settings_.unmarked;
  reading.mirrored = true;  // which way is found without the key
  const Result<InformedReport> report = verify_informed(key_, reading, VerifySettings{}, executor);
  if (!report) return report.error();
  cell.informed = report->pictures.size();
  cell.found = static_cast<std::size_t>(std::count_if(report->pictures.begin(), report->pictures.end(),
                                                      [](const InformedPicture& picture) { return picture.found; }));
  cell.informed_matches = report->report.verification.evidence.matches;
  cell.informed_p_value = report->together.p_corrected;
  cell.spread_deviations = report->spread.deviations;
  return Done{};
}

COMPMARK_APP_INLINE Result<RobustnessCell> RobustnessBench::read_blind(const RobustnessAttack& attack,
                                                                       Pictures& pictures, std::uint64_t tests,
                                                                       ThreadExecutor& executor) {
  RobustnessCell cell;
  Result<std::vector<ViewLogits>> read = logits_of(pictures, executor);
  if (!read) {
    Error error = read.error();
    error.problem = "after " + attack.text + ": " + error.problem;
    return error;
  }
  double decibels = 0;
  bool same_size = true;
  for (std::size_t v = 0; v < pictures.size(); ++v) {
    same_size = same_size && pictures[v].height == before_[v].height && pictures[v].width == before_[v].width;
    if (same_size) decibels += psnr(pictures[v].view(), before_[v].view());
  }
  const Result<Verification> verified = verify_message(message_of(key_), *read, VerifySettings{});
  if (!verified) return verified.error();
  const auto corrected = [tests](double p) { return std::min(1.0, static_cast<double>(tests) * p); };
  cell.views = read->size();
  cell.bits = verified->bits;
  cell.matches = verified->evidence.matches;
  cell.p_value = corrected(verified->evidence.p_value);
  cell.worst = 1;
  cell.worst_p_value = 0;
  for (const Evidence& view : verified->views) {
    const double share = static_cast<double>(view.matches) / static_cast<double>(cell.bits);
    cell.mean += share / static_cast<double>(cell.views);
    cell.worst = std::min(cell.worst, share);
    cell.worst_p_value = std::max(cell.worst_p_value, corrected(view.p_value));
  }
  if (same_size) cell.psnr = decibels / static_cast<double>(cell.views);
  return cell;
}

COMPMARK_APP_INLINE Result<RobustnessCell> RobustnessBench::measure(const RobustnessAttack& attack,
                                                                    ThreadExecutor& executor) {
  const bool of_model = attack.kind == RobustnessKind::model || attack.kind == RobustnessKind::average ||
                        attack.kind == RobustnessKind::other;
  const std::size_t shares = settings_.pruned && of_model ? pruned_shares.size() : 1;
  Result<Pictures> pictures = attacked(attack, 0, executor);
  if (!pictures) return pictures.error();
  Result<RobustnessCell> cell = read_blind(attack, *pictures, shares, executor);
  if (!cell) return cell;
  for (std::size_t i = 1; i < shares; ++i) {
    Result<Pictures> made_up = attacked(attack, pruned_shares[i], executor);
    if (!made_up) return made_up.error();
    Result<RobustnessCell> read = read_blind(attack, *made_up, shares, executor);
    if (!read) return read;
    if (read->matches < cell->matches || (read->matches == cell->matches && read->mean <= cell->mean)) continue;
    read->psnr = cell->psnr;  // what is left to the thief is what he has, not what is read
    read->missing_share = pruned_shares[i];
    cell = std::move(read);
  }
  if (settings_.restored && of_model) {
    Result<std::optional<RestoredCell>> restored = read_restored(attack, executor);
    if (!restored) return restored.error();
    cell->restored = *restored;
  }
  if (!settings_.unmarked.empty() && settings_.informed_views > 0) {
    if (Result<Done> informed = read_informed(*pictures, executor, *cell); !informed) return informed.error();
  }
  return cell;
}

}  // namespace compmark
