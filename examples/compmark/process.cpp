// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <optional>
#include <string>
#include <vector>

#include "common.hpp"
#include "nearest_word.hpp"
#include "numbers.hpp"

namespace tool {

void prepare_process() {
  struct sigaction ignore {};
  ignore.sa_handler = SIG_IGN;
  sigaction(SIGPIPE, &ignore, nullptr);
  sigaction(SIGXFSZ, &ignore, nullptr);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) != -1) continue;
    // The lowest free number is this one. It cannot be written to, so that who prints there learns of it.
    if (open("/dev/null", stream == STDERR_FILENO ? O_WRONLY : O_RDONLY) != stream) return;
  }
}

int finish_output(int code) {
  errno = 0;
  const bool flushed = std::fflush(stdout) == 0;
  const int why = errno;
  if (flushed && std::ferror(stdout) == 0) return code;
  return fail({compmark::ErrorKind::unwritable,
               "standard output",
               {},
               std::string("not everything could be written: ") + (why != 0 ? std::strerror(why) : "an earlier error"),
               "the output of this command is incomplete; free some space and run it again"});
}

namespace {

/// The first word that is no command, or no option of its command, as an error that names the nearest one.
std::optional<compmark::Error> unknown_word(const CLI::App& app, const std::vector<std::string>& words) {
  std::vector<std::string> known;
  const auto unknown = [&](const std::string& word, const char* what, const std::string& help) {
    const std::string nearest = nearest_word(word, known);
    return compmark::Error{compmark::ErrorKind::invalid,
                           {},
                           word,
                           std::string("is no ") + what,
                           (nearest.empty() ? "" : "did you mean " + nearest + "? ") + help + " lists them"};
  };
  const std::vector<const CLI::App*> commands = app.get_subcommands({});
  const auto command = std::find_if(commands.begin(), commands.end(), [&](const CLI::App* one) {
    return !words.empty() && one->get_name() == words.front();
  });
  if (command == commands.end()) {
    if (words.empty() || words.front().rfind('-', 0) == 0) return std::nullopt;
    for (const CLI::App* one : commands) known.push_back(one->get_name());
    return unknown(words.front(), "command", "compmark --help");
  }
  for (const CLI::Option* option : (*command)->get_options()) {
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  }
  for (std::size_t i = 1; i < words.size(); ++i) {
    const std::string name = words[i].substr(0, words[i].find('='));
    if (name.size() < 3 || name.rfind("--", 0) != 0) continue;
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    return unknown(name, "option", "compmark " + (*command)->get_name() + " --help");
  }
  return std::nullopt;
}

}  // namespace

int answer_parser(const CLI::App& app, const CLI::ParseError& error, const std::vector<std::string>& words) {
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success))
    return app.exit(error) == 0 ? success : failure;
  return fail(words_error(app, error, words));
}

compmark::Error words_error(const CLI::App& app, const CLI::ParseError& error, const std::vector<std::string>& words) {
  if (const std::optional<compmark::Error> unknown = unknown_word(app, words)) return *unknown;
  std::string command = "compmark";
  for (const CLI::App* sub : app.get_subcommands()) command += " " + sub->get_name();
  return {compmark::ErrorKind::invalid, {}, {}, parse_error_line(error), command + " --help says more"};
}

compmark::Error caught_error() {
  using compmark::ErrorKind;
  try {
    throw;
  } catch (const std::bad_alloc&) {
    return {ErrorKind::exhausted, {}, {}, "out of memory", "use --downscale, --memory-budget or --max-anchors"};
  } catch (const std::exception& error) {
    return {ErrorKind::invalid, {}, {}, std::string("unexpected: ") + error.what(), "please report this"};
  }
}

}  // namespace tool
