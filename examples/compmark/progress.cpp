// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "progress.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <compmark/io/output_target.hpp>
#include <csignal>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "svg_plot.hpp"

namespace tool {

using compmark::Error;
using compmark::ErrorKind;
using compmark::Result;

namespace {

std::atomic<int> interrupt_count{0};
static_assert(std::atomic<int>::is_always_lock_free, "the signal handler needs a lock-free flag");

extern "C" void on_interrupt(int signal) {
  interrupt_count.store(1);
  struct sigaction action {};
  action.sa_handler = SIG_DFL;
  sigaction(signal, &action, nullptr);  // async-signal-safe (POSIX.1-2008, 2.4.3)
}

double seconds_between(std::chrono::steady_clock::time_point from, std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

int terminal_columns(std::FILE* stream) {
  winsize size{};
  if (ioctl(fileno(stream), TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  return 100;
}

nlohmann::ordered_json to_json(const ProgressLine& line) {
  nlohmann::ordered_json json{{"iteration", line.iteration}, {"total", line.total},     {"seconds", line.seconds},
                              {"loss", line.loss},           {"l1", line.l1},           {"ssim", line.ssim},
                              {"psnr", line.psnr},           {"anchors", line.anchors}, {"gaussians", line.gaussians}};
  if (line.bits_per_scalar) json["bits_per_scalar"] = *line.bits_per_scalar;
  if (line.bit_accuracy) json["bit_accuracy"] = *line.bit_accuracy;
  if (line.revivals != 0) json["revivals"] = line.revivals;
  if (line.test_psnr) json["test_psnr"] = *line.test_psnr;
  return json;
}

/// What a killed run, or a full disk, left of a line at the end of a log: the next one would stand behind it, and
/// neither could be read.
void drop_torn_line(const std::filesystem::path& log) {
  std::ifstream file(log, std::ios::binary);
  std::uintmax_t whole = 0, size = 0;
  for (std::string line; std::getline(file, line);) {
    size += line.size() + (file.eof() ? 0 : 1);
    if (!file.eof()) whole = size;
  }
  file.close();
  std::error_code status;
  if (whole != size) std::filesystem::resize_file(log, whole, status);
}

std::string values_text(const ProgressLine& line) {
  std::string text = format_text("loss %.4f  PSNR %.2f dB  anchors %llu", line.loss, line.psnr,
                                 static_cast<unsigned long long>(line.anchors));
  if (line.bits_per_scalar) text += format_text("  %.2f bits/scalar", *line.bits_per_scalar);
  if (line.bit_accuracy) text += format_text("  bits %.0f %%", 100 * *line.bit_accuracy);
  return text;
}

}  // namespace

InterruptWatch::InterruptWatch() {
  interrupt_count.store(0);
  struct sigaction action {};
  action.sa_handler = on_interrupt;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  sigaction(SIGINT, &action, &interrupt_);
  sigaction(SIGTERM, &action, &terminate_);
}

InterruptWatch::~InterruptWatch() {
  sigaction(SIGINT, &interrupt_, nullptr);
  sigaction(SIGTERM, &terminate_, nullptr);
}

bool interrupted() { return interrupt_count.load(std::memory_order_relaxed) != 0; }

std::string format_duration(double seconds) {
  if (!std::isfinite(seconds) || seconds < 0 || seconds > 1e7) return "--:--";
  const long whole = std::lround(seconds);
  if (whole >= 3600) return format_text("%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
  return format_text("%ld:%02ld", whole / 60, whole % 60);
}

Result<Progress> Progress::open(ProgressSettings settings) {
  Progress progress(std::move(settings));
  const ProgressSettings& s = progress.settings_;
  progress.terminal_ = s.terminal ? *s.terminal : isatty(fileno(s.stream)) == 1;
  if (!s.json_log.empty() && compmark::is_stream_target(s.json_log)) {
    Result<compmark::AtomicFile> stream = compmark::AtomicFile::create(s.json_log);
    if (!stream) return stream.error();
    progress.stream_log_ = std::move(*stream);
  } else if (!s.json_log.empty()) {
    if (Result<std::vector<ProgressLine>> old = s.append ? read_progress_log(s.json_log) : std::vector<ProgressLine>();
        old) {
      progress.before_ = std::move(*old);
      if (s.append) drop_torn_line(s.json_log);
    }
    progress.log_.reset(std::fopen(s.json_log.c_str(), s.append ? "ab" : "wb"));
    if (!progress.log_) {
      return Error{ErrorKind::unwritable, s.json_log.string(), "",
                   std::string("cannot be written: ") + std::strerror(errno), "create its folder and make it writable"};
    }
  }
  return progress;
}

void Progress::Mean::add(const ProgressLine& line) {
  loss += line.loss;
  l1 += line.l1;
  ssim += line.ssim;
  psnr += line.psnr;
  ++count;
}

ProgressLine Progress::Mean::of(const ProgressLine& last) const {
  ProgressLine line = last;
  const double n = static_cast<double>(count);
  line.loss = loss / n;
  line.l1 = l1 / n;
  line.ssim = ssim / n;
  line.psnr = psnr / n;
  return line;
}

void Progress::show(const ProgressLine& given) {
  const Clock::time_point now = Clock::now();
  ProgressLine line = given;
  if (start_ == Clock::time_point{}) {
    start_ = last_shown_ = rate_time_ = now;
    first_ = rate_iteration_ = line.iteration - 1;
    for (const ProgressLine& old : before_) {  // of a resumed run: the time until its checkpoint counts too
      if (old.iteration <= first_) seconds_before_ = old.seconds;
    }
  }
  line.seconds = seconds_before_ + seconds_between(start_, now);
  const bool last = line.iteration == line.total;

  logged_.add(line);
  if (line.iteration % settings_.log_every == 0 || line.iteration == 1 || last || line.test_psnr) {
    history_.push_back(logged_.of(line));
    logged_ = {};
    log(to_json(history_.back()).dump() + "\n");
  }

  const double since_rate = seconds_between(rate_time_, now);
  if (since_rate >= 0.5 || rate_ == 0) {
    const double current = static_cast<double>(line.iteration - rate_iteration_) / std::max(since_rate, 1e-6);
    const double weight = rate_ == 0 || line.iteration - first_ < 3 ? 1 : 1 - std::exp(-since_rate / 10);
    if (since_rate > 0) rate_ += weight * (current - rate_);
    rate_time_ = now;
    rate_iteration_ = line.iteration;
  }

  shown_.add(line);
  pending_ = line;
  if (settings_.quiet) return;
  const double wait = terminal_ ? settings_.bar_seconds : settings_.line_seconds;
  if (!last && line.iteration != first_ + 1 && seconds_between(last_shown_, now) < wait) return;
  last_shown_ = now;
  const ProgressLine mean = shown_.of(line);
  shown_ = {};
  pending_.reset();
  terminal_ ? draw(mean) : print(mean);
}

/// Flushed line by line: a killed run keeps its curve.
void Progress::log(const std::string& text) {
  if (log_failure_) return;
  bool written = true;
  errno = 0;
  if (stream_log_) {
    stream_log_->write(text);
    written = stream_log_->flush();
  } else if (log_) {
    written = std::fwrite(text.data(), 1, text.size(), log_.get()) == text.size() && std::fflush(log_.get()) == 0;
  }
  if (written) return;
  const int why = errno;
  if (log_) {
    log_.reset();
    drop_torn_line(settings_.json_log);
  }
  log_failure_ =
      Error{ErrorKind::unwritable, settings_.json_log.string(), "--json-log",
            std::string("a line could not be written") + (why != 0 ? std::string(": ") + std::strerror(why) : ""),
            "the log ends there; all other files of the run are complete"};
  note("compmark: warning: the log " + settings_.json_log.string() + " cannot be written any more; the run goes on");
}

std::vector<ProgressLine> Progress::curve() const {
  std::vector<ProgressLine> lines = before_;
  while (!lines.empty() && !history_.empty() && lines.back().iteration >= history_.front().iteration) lines.pop_back();
  lines.insert(lines.end(), history_.begin(), history_.end());
  return lines;
}

void Progress::draw(const ProgressLine& line) {
  const double done = line.total > 0 ? static_cast<double>(line.iteration) / static_cast<double>(line.total) : 0;
  const double left = rate_ > 0 ? static_cast<double>(line.total - line.iteration) / rate_ : INFINITY;
  const std::string head = format_text("%s %3d%% ", settings_.label.c_str(), static_cast<int>(100 * done));
  const std::string tail = format_text(" %lld/%lld  %.1f it/s  ETA %s  ", static_cast<long long>(line.iteration),
                                       static_cast<long long>(line.total), rate_, format_duration(left).c_str()) +
                           values_text(line);
  const int columns = terminal_columns(settings_.stream);
  const int room = std::min(40, columns - static_cast<int>(head.size() + tail.size()) - 3);
  std::string bar;
  if (room >= 8) {
    const int eighths = static_cast<int>(done * room * 8);
    static constexpr const char* part[] = {"", "▏", "▎", "▍", "▌", "▋", "▊", "▉"};
    for (int i = 0; i < eighths / 8; ++i) bar += "█";
    int used = eighths / 8;
    if (eighths % 8 != 0) bar += part[eighths % 8], ++used;
    bar += std::string(static_cast<std::size_t>(room - used), ' ');
    bar = "|" + bar + "|";
  }
  std::string text = head + bar + tail;
  if (room < 8) text.resize(std::min(text.size(), static_cast<std::size_t>(std::max(columns - 1, 20))));
  std::fprintf(settings_.stream, "\r%s\x1b[K", text.c_str());
  std::fflush(settings_.stream);
  bar_visible_ = true;
}

void Progress::print(const ProgressLine& line) {
  const double left = rate_ > 0 ? static_cast<double>(line.total - line.iteration) / rate_ : INFINITY;
  std::fprintf(settings_.stream, "%s %lld/%lld  %.1f it/s  ETA %s  %s\n", settings_.label.c_str(),
               static_cast<long long>(line.iteration), static_cast<long long>(line.total), rate_,
               format_duration(left).c_str(), values_text(line).c_str());
  std::fflush(settings_.stream);
}

void Progress::note(const std::string& text) {
  if (settings_.quiet) return;
  std::fprintf(settings_.stream, "%s%s%s\n", bar_visible_ ? "\r" : "", text.c_str(), bar_visible_ ? "\x1b[K" : "");
  std::fflush(settings_.stream);
}

void Progress::finish() {
  if (pending_ && !settings_.quiet && shown_.count > 0) {
    const ProgressLine mean = shown_.of(*pending_);
    terminal_ ? draw(mean) : print(mean);
  }
  pending_.reset();
  shown_ = {};
  if (bar_visible_) std::fputc('\n', settings_.stream);
  bar_visible_ = false;
  if (log_ && std::fclose(log_.release()) != 0 && !log_failure_)
    log_failure_ = Error{ErrorKind::unwritable, settings_.json_log.string(), "--json-log",
                         std::string("its end could not be written: ") + std::strerror(errno),
                         "all other files of the run are complete"};
  stream_log_.reset();
}

Result<std::vector<ProgressLine>> read_progress_log(const std::filesystem::path& path) {
  std::error_code status;
  const bool regular = std::filesystem::is_regular_file(path, status);  // of a pipe that is written nothing comes back
  std::ifstream file;
  if (regular) file.open(path);
  if (!regular || !file) return Error{ErrorKind::not_found, path.string(), "", "cannot be read", "check the path"};
  std::vector<ProgressLine> lines;
  std::string text;
  for (int number = 1; std::getline(file, text); ++number) {
    if (text.empty()) continue;
    const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
    if (json.is_discarded() && file.peek() == std::ifstream::traits_type::eof())
      break;  // the run was killed while it wrote
    if (!json.is_object() || !json.contains("iteration") || !json["iteration"].is_number_integer()) {
      return Error{ErrorKind::malformed, path.string(), "line " + std::to_string(number),
                   "is not a line of a training log", "check that this is the right file"};
    }
    const auto number_of = [&](const char* key) {
      const auto found = json.find(key);
      return found != json.end() && found->is_number() ? found->get<double>() : std::nan("");
    };
    const auto count_of = [&](const char* key) {
      const auto found = json.find(key);
      return found != json.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : 0;
    };
    ProgressLine line;
    line.iteration = json["iteration"].get<std::int64_t>();
    line.total = static_cast<std::int64_t>(count_of("total"));
    line.seconds = number_of("seconds");
    line.loss = number_of("loss");
    line.l1 = number_of("l1");
    line.ssim = number_of("ssim");
    line.psnr = number_of("psnr");
    line.anchors = count_of("anchors");
    line.gaussians = count_of("gaussians");
    line.revivals = count_of("revivals");
    if (json.contains("bits_per_scalar")) line.bits_per_scalar = number_of("bits_per_scalar");
    if (json.contains("bit_accuracy")) line.bit_accuracy = number_of("bit_accuracy");
    if (json.contains("test_psnr")) line.test_psnr = number_of("test_psnr");
    while (!lines.empty() && lines.back().iteration >= line.iteration) lines.pop_back();
    lines.push_back(line);
  }
  return lines;
}

}  // namespace tool
