// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <string>

#include "common.hpp"
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

int answer_parser(const CLI::App& app, const CLI::ParseError& error) {
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success))
    return app.exit(error) == 0 ? success : failure;
  std::string command = "compmark";
  for (const CLI::App* sub : app.get_subcommands()) command += " " + sub->get_name();
  return fail(words_error(command, error));
}

compmark::Error words_error(const std::string& command, const CLI::ParseError& error) {
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
