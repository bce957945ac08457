// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "options.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "new_names.hpp"

namespace tool {
namespace {

const char* role_name(OptionRole role) {
  switch (role) {
    case OptionRole::input:
      return "input";
    case OptionRole::output_file:
      return "output file";
    case OptionRole::output_folder:
      return "output folder";
    case OptionRole::share_or_folder:
      return "share or folder";
    case OptionRole::number:
      return "number";
    case OptionRole::flag:
      return "flag";
    case OptionRole::word:
      break;
  }
  return "word";
}

/// The word as a number, whatever it is; nothing if it is none.
std::optional<double> as_number(const std::string& word) {
  char* end = nullptr;
  const double value = std::strtod(word.c_str(), &end);
  if (end == word.c_str() || *end != '\0') return std::nullopt;
  return value;
}

constexpr const char* basic_group = "Options";
constexpr const char* message_group = "Message (watermark)";
constexpr const char* codec_group = "Codec (compression)";
constexpr const char* expert_group = "Expert";

struct GroupedOption {
  const char* name;
  const char* group;
};
constexpr GroupedOption grouped_options[] = {
    {"--key", message_group},
    {"--decoder", message_group},
    {"--recipient", message_group},
    {"--recipient-alpha", message_group},
    {"--fidelity", message_group},
    {"--mark-iterations", message_group},
    {"--unmarked", message_group},
    {"--for-compression", message_group},
    {"--bits", message_group},
    {"--distortion", message_group},
    {"--alpha", message_group},
    {"--tests", message_group},
    {"--any-decoder", message_group},
    {"--payload", message_group},
    {"--codec", codec_group},
    {"--lambda", codec_group},
    {"--for-fit-codec", codec_group},
    {"--networks", codec_group},
    {"--cameras", codec_group},
    {"--touch-up", codec_group},
    {"--salvage", codec_group},
    {"--partial", codec_group},
    {"--preview", codec_group},
    {"--seed", expert_group},
    {"--voxel-size", expert_group},
    {"--max-anchors", expert_group},
    {"--memory-budget", expert_group},
    {"--whole-images", expert_group},
    {"--checkpoint-every", expert_group},
    {"--json-log", expert_group},
    {"--recipe", expert_group},
    {"--profile", expert_group},
    {"--lens", expert_group},
    {"--background", expert_group},
    {"--lpips-alex", expert_group},
    {"--lpips-squeeze", expert_group},
    {"--lpips-family-range", expert_group},
    {"--message-every", expert_group},
    {"--message-margin", expert_group},
    {"--message-power", expert_group},
    {"--message-rate", expert_group},
    {"--step-rate", expert_group},
    {"--message-weight", expert_group},
    {"--fidelity-fall", expert_group},
    {"--sample-by-loss", expert_group},
    {"--orbit", expert_group},
    {"--photographs", expert_group},
    {"--edits", expert_group},
    {"--lost-anchors", expert_group},
    {"--calibrate-steps", expert_group},
    {"--period", expert_group},
    {"--tone", expert_group},
    {"--features", expert_group},
    {"--coordinates", expert_group},
    {"--gradient-views", expert_group},
    {"--region-limit", expert_group},
    {"--edit-weight", expert_group},
    {"--stride", expert_group},
    {"--crop", expert_group},
    {"--measure", expert_group},
    {"--measure-steps", expert_group},
    {"--symmetric", expert_group},
    {"--keep-networks", expert_group},
    {"--keep-positions", expert_group},
    {"--coarse-to-fine", expert_group},
    {"--method", message_group},
    {"--spread", message_group},
};

}  // namespace

std::vector<std::string> with_new_names(std::vector<std::string> words) {
  const bool of_pretrain = !words.empty() && words[0] == "pretrain";
  return renamed(std::move(words), of_pretrain, [](const std::string& before, const std::string& now) {
    std::fprintf(stderr, "compmark: warning: %s is called %s now\n", before.c_str(), now.c_str());
  });
}

const char* option_group(const std::string& name) {
  for (const GroupedOption& option : grouped_options) {
    if (name == option.name) return option.group;
  }
  return basic_group;
}

const char* input_kind_name(InputKind kind) {
  switch (kind) {
    case InputKind::model:
      return "model";
    case InputKind::trained_model:
      return "trained model";
    case InputKind::markable:
      return "markable model";
    case InputKind::compressed:
      return "compressed model";
    case InputKind::decoder:
      return "decoder";
    case InputKind::interference:
      return "interference";
    case InputKind::key:
      return "key";
    case InputKind::claim:
      return "claim";
    case InputKind::time_stamp:
      return "time stamp";
    case InputKind::images:
      return "images";
    case InputKind::dataset:
      return "dataset";
    case InputKind::splats:
      return "splat file";
    case InputKind::weights:
      return "LPIPS weights";
    case InputKind::other:
      break;
  }
  return "other";
}

CLI::Option* Options::share_or_folder(const std::string& name, std::string& target, const std::string& text) {
  const auto folder = [&target] {
    return target.empty() || as_number(target) ? std::vector<Path>() : std::vector<Path>{target};
  };
  return declare({name, OptionRole::share_or_folder, InputKind::images, {}, false, folder, text}, target)
      ->check(CLI::Validator(
          [](std::string& word) {
            const std::optional<double> share = as_number(word);
            if (word.empty() || (share && !(*share > 0 && *share < 1)))
              return "\"" + word + "\" is neither a share above 0 and below 1 nor a folder";
            return std::string();
          },
          "SHARE or FOLDER"));
}

CLI::Option* Options::flag(const std::string& name, bool& target, const std::string& text) {
  CLI::Option* option = app_.add_flag(name, target, text)->group(option_group(name));
  declared_.push_back({name, OptionRole::flag, {}, {}, false, {}, text, option});
  return option;
}

FileUse Options::use() const {
  FileUse use;
  for (const DeclaredOption& declared : declared_) {
    if (!declared.paths) continue;
    for (const Path& path : declared.paths()) {
      if (declared.role == OptionRole::output_file) use.write(path, declared.name, declared.written);
      if (declared.role == OptionRole::input || declared.role == OptionRole::share_or_folder)
        use.read(path, declared.name, declared.kind);
    }
  }
  if (more_) more_(use);
  return use;
}

nlohmann::ordered_json Options::json() const {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const CLI::Option* option : app_.get_options()) {
    if (option == app_.get_help_ptr() || option == app_.get_help_all_ptr()) continue;
    nlohmann::ordered_json entry{{"name", option->get_name()}};
    const auto found = std::find_if(declared_.begin(), declared_.end(),
                                    [&](const DeclaredOption& declared) { return declared.option == option; });
    if (found == declared_.end()) {
      entry["role"] = nullptr;
    } else {
      entry["role"] = role_name(found->role);
      if (found->role == OptionRole::input) entry["reads"] = input_kind_name(found->kind);
      if (found->role == OptionRole::number) {
        entry["whole"] = found->whole;
        entry["range"] = found->range;
      }
      if (found->role == OptionRole::output_folder) entry["names_its_files"] = static_cast<bool>(more_);
    }
    entry["group"] = option->get_group();
    entry["required"] = option->get_required();
    for (const CLI::Option* needed : option->get_needs()) entry["needs"].push_back(needed->get_name());
    entry["text"] = option->get_description();
    list.push_back(std::move(entry));
  }
  return list;
}

}  // namespace tool
