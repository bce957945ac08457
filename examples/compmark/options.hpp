// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Declares the options of a command: each is a file that is read or written, a number with its range, a word or a flag.
// All checks come from this table, so that no command can forget one: no output is a file that is read or written
// otherwise (file_use.hpp), no input is a file of another kind (input_files.hpp), and no number is outside its range.
// There is no other way to declare an option. `compmark --options-json` prints the table.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "file_use.hpp"
#include "numbers.hpp"

namespace tool {

/// The words of a command line, with the names of options that are called otherwise since; each is said once.
[[nodiscard]] std::vector<std::string> with_new_names(std::vector<std::string> words);

/// The heading of an option in --help: what everybody gives, what is of a message or of a codec, and numbers that have
/// good defaults. Names of all commands are in one table (options.cpp).
[[nodiscard]] const char* option_group(const std::string& name);

enum class OptionRole { input, output_file, output_folder, share_or_folder, number, word, flag };

struct DeclaredOption {
  std::string name;  ///< with its dashes, where it has any
  OptionRole role = OptionRole::word;
  InputKind kind = InputKind::other;                               ///< of an input
  std::string range;                                               ///< of a number
  bool whole = false;                                              ///< of a number
  std::function<std::vector<std::filesystem::path>()> paths = {};  ///< of inputs and outputs, as they were given
  std::string text;
  CLI::Option* option = nullptr;
  OutputKind written = OutputKind::any;  ///< of an output file
};

class Options {
 public:
  using Path = std::filesystem::path;
  explicit Options(CLI::App& app) : app_(app) {}

  /// A file, or a folder, that is read.
  CLI::Option* reads(const std::string& name, Path& target, InputKind kind, const std::string& text) {
    return declare({name, OptionRole::input, kind, {}, false, one(target), text}, target);
  }
  CLI::Option* reads(const std::string& name, std::vector<Path>& target, InputKind kind, const std::string& text) {
    return declare({name, OptionRole::input, kind, {}, false, [&target] { return target; }, text}, target);
  }
  /// A file that is read, or one word that names no file.
  CLI::Option* reads_or(const std::string& word, const std::string& name, Path& target, InputKind kind,
                        const std::string& text) {
    const auto file = [&target, word] {
      return target.empty() || target == word ? std::vector<Path>() : std::vector<Path>{target};
    };
    return declare({name, OptionRole::input, kind, {}, false, file, text}, target);
  }
  /// A share of photographs, or a folder of them: the word itself decides.
  CLI::Option* share_or_folder(const std::string& name, std::string& target, const std::string& text);
  /// A file that is written.
  CLI::Option* writes(const std::string& name, Path& target, OutputKind written, const std::string& text) {
    return declare({name, OptionRole::output_file, {}, {}, false, one(target), text, nullptr, written}, target);
  }
  /// A folder that is written into; `also` must list the files.
  CLI::Option* writes_into(const std::string& name, Path& target, const std::string& text) {
    return declare({name, OptionRole::output_folder, {}, {}, false, one(target), text}, target);
  }
  /// T is a number or a std::optional of one.
  template <class T>
  CLI::Option* number(const std::string& name, T& target, WholeRange range, const std::string& text) {
    static_assert(std::is_integral_v<Plain<T>>, "a whole range is of whole numbers");
    return declare({name, OptionRole::number, {}, numbers::range_text(range), true, {}, text}, target)
        ->check(in_range(range));
  }
  template <class T>
  CLI::Option* number(const std::string& name, T& target, RealRange range, const std::string& text) {
    static_assert(std::is_floating_point_v<Plain<T>>, "a range of real numbers");
    return declare({name, OptionRole::number, {}, numbers::range_text(range), false, {}, text}, target)
        ->check(in_range(range));
  }
  CLI::Option* word(const std::string& name, std::string& target, const std::string& text) {
    return declare({name, OptionRole::word, {}, {}, false, {}, text}, target);
  }
  CLI::Option* words(const std::string& name, std::vector<std::string>& target, const std::string& text) {
    return declare({name, OptionRole::word, {}, {}, false, {}, text}, target);
  }
  CLI::Option* flag(const std::string& name, bool& target, const std::string& text);

  /// Adds files that the command reads and writes beside those of its options; called after the options were parsed.
  void also(std::function<void(FileUse&)> more) { more_ = std::move(more); }
  void footer(const std::string& text) { app_.footer(text); }

  /// How often an option was given.
  [[nodiscard]] std::size_t count(const std::string& name) const { return app_.count(name); }
  [[nodiscard]] bool parsed() const { return app_.parsed(); }
  /// The files that the command's options read and write.
  [[nodiscard]] FileUse use() const;
  /// The table of options; those that the parser adds itself have no role.
  [[nodiscard]] nlohmann::ordered_json json() const;

 private:
  template <class T>
  struct Inner {
    using Type = T;
  };
  template <class T>
  struct Inner<std::optional<T>> {
    using Type = T;
  };
  template <class T>
  using Plain = typename Inner<T>::Type;

  static std::function<std::vector<Path>()> one(Path& target) {
    return [&target] { return target.empty() ? std::vector<Path>() : std::vector<Path>{target}; };
  }
  template <class T>
  CLI::Option* declare(DeclaredOption declared, T& target) {
    CLI::Option* option = app_.add_option(declared.name, target, declared.text)->group(option_group(declared.name));
    declared.option = option;
    declared_.push_back(std::move(declared));
    return option;
  }

  CLI::App& app_;
  std::vector<DeclaredOption> declared_;
  std::function<void(FileUse&)> more_;
};

}  // namespace tool
