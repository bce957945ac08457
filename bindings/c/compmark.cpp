// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// libcompmark: the functions of compmark.h on those of compmark/app.
#include "compmark.h"

#include <dlfcn.h>

#include <algorithm>
#include <cmath>
#include <compmark/app/any_model.hpp>
#include <compmark/app/proof.hpp>
#include <compmark/app/run/mark_record.hpp>
#include <compmark/app/run/payload_json.hpp>
#include <compmark/app/verify.hpp>
#include <compmark/version.hpp>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

// Records alone of what compmark::app_run compiles: that target would bring all of training with it.
#include <compmark/app/run/detail/mark_record.hpp>

using namespace compmark;

struct compmark_session {
  explicit compmark_session(std::size_t threads) : executor(threads) {}
  ThreadExecutor executor;
  std::string error;
};
struct compmark_model {
  AnyModel model;
};

namespace {

Error missing(const char* what) { return {ErrorKind::invalid, {}, what, "is NULL", "give what compmark.h says of it"}; }

/// The value of f, which returns a Result; nothing if it failed, and the session keeps why. No exception leaves it.
template <class F>
auto guarded(compmark_session* session, const F& f) noexcept -> std::optional<std::decay_t<decltype(*f())>> {
  try {
    try {
      auto result = f();
      if (!result) session->error = result.error().line();
      return result ? std::optional(std::move(*result)) : std::nullopt;
    } catch (const std::bad_alloc&) {
      session->error = "memory: there is not enough of it; close what you do not need";
    } catch (const std::exception& error) {
      session->error = error.what();
    }
  } catch (...) {  // no memory for the words either, or nothing that is an exception
    session->error.clear();
  }
  return std::nullopt;
}

std::filesystem::path path_of(const char* text) {
  if (text == nullptr) return {};
  const std::string_view view(text);
  return std::filesystem::path(std::u8string(view.begin(), view.end()));
}

/// As the tool chooses: the decoder that is given; decoder.safetensors beside the model; the one beside this library
/// (lib, share/compmark/weights), or in the tree that it was built in.
Result<std::filesystem::path> decoder_of(const char* given, const std::filesystem::path& model) {
  if (given != nullptr) return path_of(given);
  constexpr const char* name = "universal3_64.safetensors";
  std::error_code status;
  const std::filesystem::path of_model = model.parent_path() / "decoder.safetensors";
  if (!model.empty() && std::filesystem::exists(of_model, status)) return of_model;
  Dl_info self{};
  std::vector<std::filesystem::path> places;
  if (dladdr(reinterpret_cast<const void*>(&compmark_abi), &self) != 0 && self.dli_fname != nullptr) {
    // lib, or lib/<architecture>.
    std::filesystem::path folder = std::filesystem::absolute(self.dli_fname, status).parent_path();
    for (int up = 0; up < 2; ++up) {
      folder = folder.parent_path();
      places.push_back(folder / "share/compmark/weights" / name);
    }
  }
  places.push_back(std::filesystem::path(COMPMARK_WEIGHTS_DIR) / name);
  for (const std::filesystem::path& place : places) {
    if (std::filesystem::exists(place, status)) return place;
  }
  return Error{ErrorKind::unreadable, places.front().string(), "decoder", "is missing, and none was given",
               "install the library with its weights, or give one"};
}

Result<ReadingSettings> settings_of(const compmark_reading& reading) {
  ReadingSettings settings;
  settings.model = path_of(reading.model);
  Result<std::filesystem::path> decoder = decoder_of(reading.decoder, settings.model);
  if (!decoder) return decoder.error();
  settings.decoder = std::move(*decoder);
  settings.unmarked = path_of(reading.unmarked);
  settings.interference = path_of(reading.interference);
  if ((reading.images == nullptr && reading.image_count != 0)) return missing("images");
  for (std::size_t i = 0; i < reading.image_count; ++i) {
    if (reading.images[i] == nullptr) return missing("images");
    settings.images.push_back(path_of(reading.images[i]));
  }
  if ((reading.pictures == nullptr && reading.picture_count != 0)) return missing("pictures");
  for (std::size_t i = 0; i < reading.picture_count; ++i) {
    const compmark_picture& picture = reading.pictures[i];
    if (picture.pixels == nullptr) return missing("pixels");
    GivenPicture given;
    given.name = picture.name != nullptr ? picture.name : "picture " + std::to_string(i);
    given.width = picture.width;
    given.height = picture.height;
    given.channels = picture.channels;
    if (given.width > 0 && given.height > 0 && given.channels > 0) {
      given.pixels = {picture.pixels, static_cast<std::size_t>(given.width) * static_cast<std::size_t>(given.height) *
                                          static_cast<std::size_t>(given.channels)};
    }
    settings.pictures.push_back(std::move(given));
  }
  settings.views = reading.views;
  settings.split = reading.all_cameras != 0 ? ViewChoice::all : ViewChoice::test;
  std::copy_n(reading.background, 3, settings.background.begin());
  return settings;
}

/// A camera of somebody else's numbers: what would be drawn of nothing, or asks for more memory than there is.
Result<Done> check_camera(const Camera<double>& camera) {
  constexpr int longest_side = 32768;
  const auto is_wrong = [](const char* field, const char* what, const char* remedy) {
    return Error{ErrorKind::invalid, "camera", field, what, remedy};
  };
  if (std::min(camera.width, camera.height) < 1 || std::max(camera.width, camera.height) > longest_side)
    return is_wrong("width, height", "are not sides of a picture", "give 1 to 32768 pixels");
  for (const double focal : {camera.fx, camera.fy}) {
    if (!(focal > 0) || !std::isfinite(focal))
      return is_wrong("fx, fy", "are not positive numbers", "give focal lengths in pixels");
  }
  double sum = camera.cx + camera.cy;
  for (const double value : camera.center_world) sum += value;
  if (!std::isfinite(sum)) return is_wrong("cx, cy, center_world", "are not all numbers", "give finite ones");
  const auto& r = camera.rotation_camera_world;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      double product = 0;
      for (std::size_t k = 0; k < 3; ++k) product += r[3 * i + k] * r[3 * j + k];
      if (!(std::abs(product - (i == j ? 1 : 0)) < 1e-3))
        return is_wrong("rotation_camera_world", "is no rotation", "give orthonormal rows: right, down, ahead");
    }
  }
  const double determinant =
      r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6]);
  if (!(determinant > 0)) {
    return is_wrong("rotation_camera_world", "is a reflection, which no camera is",
                    "give orthonormal rows: right, down, ahead, with a determinant of 1");
  }
  return Done{};
}

/// An error if the record of this key names another decoder than this one, in the words of this interface.
Result<Done> check_decoder(const std::filesystem::path& key_file, const OwnerKey& key,
                           const ReadingSettings& settings) {
  constexpr const char* tools_word = "--decoder";
  Result<Done> recorded = check_recorded(key_file, key, settings.decoder, settings.model, {});
  if (recorded || recorded.error().field != tools_word) return recorded;
  Error error = recorded.error();
  error.field = "decoder";
  error.remedy = "give the decoder on record, or a copy of it; to use this one anyway, set any_decoder";
  return error;
}

struct Judged {
  compmark_verdict verdict{};
  std::string report;
};

Result<Judged> judged(const compmark_reading& reading, bool restored, bool reported, ThreadExecutor& executor) {
  Result<ReadingSettings> settings = settings_of(reading);
  if (!settings) return settings.error();
  settings->restored = restored;
  if (restored && (settings->model.empty() || settings->unmarked.empty())) {
    return Error{ErrorKind::invalid,
                 {},
                 settings->model.empty() ? "model" : "unmarked",
                 "is missing, and a model is put back together in the unmarked one",
                 "give both, or call compmark_verify"};
  }
  VerifySettings test;
  test.false_positive_rate = reading.false_positive_rate;
  test.tries = reading.tests;
  if (const Result<Done> checked = check_settings(test); !checked) return checked.error();
  if (reading.key == nullptr) return missing("key");
  const std::filesystem::path key_file = path_of(reading.key);
  const Result<OwnerKey> key = open_key(key_file);
  if (!key) return key.error();
  const ProofSettings proof{path_of(reading.claim), path_of(reading.time_stamp)};
  // A claim that is not of this key is told before the reading.
  if (const Result<ProofBasis> claimed = proof_basis(*key, {}, proof); !claimed) return claimed.error();
  if (reading.any_decoder == 0) {
    if (const Result<Done> recorded = check_decoder(key_file, *key, *settings); !recorded) return recorded.error();
  }
  Result<VerificationReport> report = reading.mirrored != 0
                                          ? verify_either_way(*key, std::move(*settings), test, executor)
                                          : verify_files(*key, *settings, test, executor);
  if (!report) return report.error();
  const Result<ProofBasis> basis = proof_basis(*key, report->sources, proof);
  if (!basis) return basis.error();
  const Verification& verification = report->verification;
  const Standing standing = standing_of(verification, *basis);
  Judged result;
  result.verdict.verdict = verification.verdict == Verdict::detected       ? COMPMARK_DETECTED
                           : verification.verdict == Verdict::not_detected ? COMPMARK_NOT_DETECTED
                                                                           : COMPMARK_INCONCLUSIVE;
  result.verdict.not_a_proof = standing.kind == StandingKind::not_a_proof ? 1 : 0;
  result.verdict.bits = verification.bits;
  result.verdict.matches = verification.evidence.matches;
  result.verdict.p_value = verification.evidence.p_value;
  result.verdict.p_corrected = verification.p_corrected;
  if (reported) {
    nlohmann::ordered_json json = report_json<nlohmann::ordered_json>(*report);
    json["proof"] = standing_json<nlohmann::ordered_json>(standing, *basis);
    if (key->corrects != 0) json["payload"] = payload_json(*key, verification.read);
    // Names of files may be no UTF-8.
    result.report = json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  }
  return result;
}

/// compmark_verify and compmark_verify_restored.
int verified(compmark_session* session, const compmark_reading* reading, bool restored, compmark_verdict* verdict,
             char** report) {
  if (report != nullptr) *report = nullptr;
  if (session == nullptr) return -1;
  const auto done = guarded(session, [&]() -> Result<Done> {
    if (reading == nullptr) return missing("reading");
    if (verdict == nullptr) return missing("verdict");
    Result<Judged> result = judged(*reading, restored, report != nullptr, session->executor);
    if (!result) return result.error();
    if (report != nullptr) {
      auto* const text = static_cast<char*>(std::malloc(result->report.size() + 1));
      if (text == nullptr) throw std::bad_alloc();
      std::memcpy(text, result->report.c_str(), result->report.size() + 1);
      *report = text;
    }
    *verdict = result->verdict;
    return Done{};
  });
  return done ? 0 : -1;
}

}  // namespace

extern "C" {

int compmark_abi(void) { return COMPMARK_ABI; }
const char* compmark_version(void) { return compmark::version; }

compmark_session* compmark_session_new(uint32_t threads) {
  try {
    constexpr uint32_t most = 1024;
    return new compmark_session(std::min(threads, most));
  } catch (const std::exception&) {
    return nullptr;
  }
}
void compmark_session_free(compmark_session* session) { delete session; }
const char* compmark_last_error(const compmark_session* session) {
  return session == nullptr ? "session: is NULL" : session->error.c_str();
}

compmark_model* compmark_model_open(compmark_session* session, const char* path) {
  if (session == nullptr) return nullptr;
  auto opened = guarded(session, [&]() -> Result<std::unique_ptr<compmark_model>> {
    if (path == nullptr) return missing("path");
    Result<AnyModel> model = AnyModel::open(path_of(path), session->executor);
    if (!model) return model.error();
    return std::unique_ptr<compmark_model>(new compmark_model{std::move(*model)});
  });
  return opened ? opened->release() : nullptr;
}
void compmark_model_free(compmark_model* model) { delete model; }
const char* compmark_model_recipe(const compmark_model* model) {
  return model == nullptr ? "" : model->model.info().recipe.c_str();
}
size_t compmark_model_anchors(const compmark_model* model) {
  return model == nullptr ? 0 : model->model.anchor_count();
}
size_t compmark_model_cameras(const compmark_model* model) {
  return model == nullptr ? 0 : model->model.info().views.size();
}

int compmark_model_camera(compmark_session* session, const compmark_model* model, size_t index,
                          compmark_camera* camera) {
  if (session == nullptr) return -1;
  const auto done = guarded(session, [&]() -> Result<Done> {
    if (model == nullptr) return missing("model");
    if (camera == nullptr) return missing("camera");
    const auto& views = model->model.info().views;
    if (index >= views.size()) {
      return Error{
          ErrorKind::invalid, model->model.file().string(), "index",
          "is " + std::to_string(index) + ", and the model stores " + std::to_string(views.size()) + " cameras",
          "give one below that"};
    }
    const Camera<double>& stored = views[index].camera;
    camera->width = stored.width;
    camera->height = stored.height;
    camera->fx = stored.fx;
    camera->fy = stored.fy;
    camera->cx = stored.cx;
    camera->cy = stored.cy;
    std::copy(stored.rotation_camera_world.begin(), stored.rotation_camera_world.end(), camera->rotation_camera_world);
    std::copy(stored.center_world.begin(), stored.center_world.end(), camera->center_world);
    return Done{};
  });
  return done ? 0 : -1;
}

int compmark_render(compmark_session* session, compmark_model* model, const compmark_camera* camera, float* rgb,
                    size_t count) {
  if (session == nullptr) return -1;
  const auto done = guarded(session, [&]() -> Result<Done> {
    if (model == nullptr) return missing("model");
    if (camera == nullptr) return missing("camera");
    if (rgb == nullptr) return missing("rgb");
    Camera<double> drawn;
    drawn.width = camera->width;
    drawn.height = camera->height;
    drawn.fx = camera->fx;
    drawn.fy = camera->fy;
    drawn.cx = camera->cx;
    drawn.cy = camera->cy;
    std::copy_n(camera->rotation_camera_world, 9, drawn.rotation_camera_world.begin());
    std::copy_n(camera->center_world, 3, drawn.center_world.begin());
    if (Result<Done> checked = check_camera(drawn); !checked) return checked;
    const std::size_t pixels = static_cast<std::size_t>(drawn.width) * static_cast<std::size_t>(drawn.height);
    if (count < 3 * pixels) {
      return Error{ErrorKind::invalid,
                   {},
                   "count",
                   "is " + std::to_string(count) + ", and the picture has " + std::to_string(3 * pixels) + " values",
                   "give room for height * width * 3 floats"};
    }
    const Result<RenderedView> view = model->model.render(drawn, session->executor);
    if (!view) return view.error();
    for (std::size_t c = 0; c < 3; ++c) {
      const float* const plane = view->image.data + c * pixels;
      for (std::size_t i = 0; i < pixels; ++i) rgb[3 * i + c] = plane[i];
    }
    return Done{};
  });
  return done ? 0 : -1;
}

int compmark_model_write(compmark_session* session, const compmark_model* model, const char* path) {
  if (session == nullptr) return -1;
  const auto done = guarded(session, [&]() -> Result<Done> {
    if (model == nullptr) return missing("model");
    if (path == nullptr) return missing("path");
    return model->model.write(path_of(path));
  });
  return done ? 0 : -1;
}

void compmark_reading_init(compmark_reading* reading) {
  if (reading == nullptr) return;
  *reading = compmark_reading{};
  const VerifySettings usual;
  reading->false_positive_rate = usual.false_positive_rate;
  reading->tests = usual.tries;
}

int compmark_verify(compmark_session* session, const compmark_reading* reading, compmark_verdict* verdict,
                    char** report) {
  return verified(session, reading, false, verdict, report);
}
int compmark_verify_restored(compmark_session* session, const compmark_reading* reading, compmark_verdict* verdict,
                             char** report) {
  return verified(session, reading, true, verdict, report);
}
void compmark_text_free(char* text) { std::free(text); }

}  // extern "C"
