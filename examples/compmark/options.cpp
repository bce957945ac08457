// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "options.hpp"

#include <algorithm>
#include <cstdlib>

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

}  // namespace

const char* input_kind_name(InputKind kind) {
  switch (kind) {
    case InputKind::model:
      return "model";
    case InputKind::trained_model:
      return "trained model";
    case InputKind::compressed:
      return "compressed model";
    case InputKind::decoder:
      return "decoder";
    case InputKind::key:
      return "key";
    case InputKind::images:
      return "images";
    case InputKind::dataset:
      return "dataset";
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
  CLI::Option* option = app_.add_flag(name, target, text);
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
    entry["required"] = option->get_required();
    for (const CLI::Option* needed : option->get_needs()) entry["needs"].push_back(needed->get_name());
    entry["text"] = option->get_description();
    list.push_back(std::move(entry));
  }
  return list;
}

}  // namespace tool
