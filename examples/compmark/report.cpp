// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "report.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <span>
#include <string_view>
#include <thread>

#include "compmark/io/atomic_file.hpp"
#include "compmark/io/base64.hpp"
#include "svg_plot.hpp"

// A copy of its own, so that this file links beside any other user of the library.
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#include <stb/stb_image_write.h>

namespace tool {

namespace {

constexpr std::string_view page_style = R"(
:root{--ink:#16202c;--soft:#5b6878;--line:#dfe4ea;--paper:#fff;--panel:#f6f8fa;color-scheme:light dark}
@media(prefers-color-scheme:dark){:root{--ink:#e6ebf1;--soft:#98a5b5;--line:#2d3742;--paper:#12171d;--panel:#1a2129}}
body{margin:0 auto;max-width:1240px;padding:28px 20px 60px;background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,sans-serif}
h1{margin:0;font-size:28px} h2{margin:36px 0 12px;font-size:18px} p.sub{margin:2px 0 20px;color:var(--soft)}
.figures{display:flex;flex-wrap:wrap;gap:10px} .figures div{background:var(--panel);border:1px solid var(--line);border-radius:8px;padding:10px 16px}
.figures b{display:block;font-size:21px;font-variant-numeric:tabular-nums} .figures span{color:var(--soft);font-size:13px}
.row{display:flex;flex-wrap:wrap;gap:14px} .row>*{flex:1 1 380px;min-width:0}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums} caption{text-align:left;font-weight:600;padding:6px 0}
td,th{padding:4px 10px 4px 0;border-bottom:1px solid var(--line);text-align:left;vertical-align:top} td.n,th.n{text-align:right}
td:first-child{color:var(--soft)}
h3{margin:0 0 4px;font-size:15px} p.verdict{margin:4px 0 8px;font-weight:600}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(380px,100%),1fr));gap:14px}
.views{display:grid;grid-template-columns:repeat(3,minmax(0,1fr));gap:14px;margin-bottom:18px} .views figure{margin:0} .views img{width:100%;height:auto;display:block;border-radius:4px} figcaption{color:var(--soft);font-size:13px;padding-top:4px}
.scroll{overflow-x:auto}
)";

std::string image_tag(const ReportImage& image, const std::string& caption) {
  std::string text = "<figure>";
  int size = 0;
  unsigned char* png =
      image.width > 0 ? stbi_write_png_to_mem(image.rgb.data(), 3 * image.width, image.width, image.height, 3, &size)
                      : nullptr;
  if (png != nullptr) {
    text += "<img alt=\"" + escape_html(caption) + "\" src=\"data:image/png;base64," +
            base64(std::as_bytes(std::span(png, static_cast<std::size_t>(size)))) + "\">";
    std::free(png);
  }
  return text + "<figcaption>" + escape_html(caption) + "</figcaption></figure>";
}

ReportImage difference(const ReportImage& a, const ReportImage& b, int gain) {
  ReportImage result{a.width, a.height, std::vector<std::uint8_t>(a.rgb.size())};
  for (std::size_t i = 0; i < std::min(a.rgb.size(), b.rgb.size()); ++i) {
    result.rgb[i] = static_cast<std::uint8_t>(
        std::min(255, gain * std::abs(static_cast<int>(a.rgb[i]) - static_cast<int>(b.rgb[i]))));
  }
  return result;
}

/// Lines of report_text(): those with a label of twelve letters are rows of a table, the others the verdict, which
/// stands above it.
std::string words(const ReportWords& input) {
  constexpr std::size_t label = 12;
  std::string verdict, rows;
  for (std::size_t begin = 0; begin < input.text.size();) {
    const std::size_t end = std::min(input.text.find('\n', begin), input.text.size());
    const std::string line = input.text.substr(begin, end - begin);
    begin = end + 1;
    if (line.size() > label && line.compare(label - 2, 2, "  ") == 0) {
      rows += "<tr><td>" + escape_html(line.substr(0, line.find("  "))) + "</td><td>" +
              escape_html(line.substr(label)) + "</td></tr>";
    } else if (!line.empty()) {
      verdict += "<p class=\"verdict\">" + escape_html(line) + "</p>";
    }
  }
  return "<div><h3>" + escape_html(input.heading) + "</h3>" + verdict + "<table>" + rows + "</table></div>";
}

std::string view_row(const ReportView& view, const ReportInput& input) {
  const std::string gain = "×" + std::to_string(input.difference_gain);
  std::string figures = format_text("%.2f dB, SSIM %.4f", view.psnr, view.ssim);
  if (view.lpips) figures += format_text(", LPIPS %.4f", *view.lpips);
  std::string text = "<div class=\"views\">" + image_tag(view.ground_truth, view.name) +
                     image_tag(view.render, input.renders + ": " + figures) +
                     image_tag(difference(view.ground_truth, view.render, input.difference_gain),
                               "difference from the ground truth " + gain);
  if (view.unmarked) {  // under the marked one, with nothing under the ground truth
    const UnmarkedView& counterpart = *view.unmarked;
    text += "<div></div>" +
            image_tag(counterpart.render, "unmarked, " + counterpart.file + ": " +
                                              format_text("%.2f dB, SSIM %.4f", counterpart.psnr, counterpart.ssim)) +
            image_tag(difference(view.render, counterpart.render, input.difference_gain),
                      "difference of marked and unmarked " + gain);
  }
  return text + "</div>\n";
}

std::string table(const ReportTable& input) {
  std::string text = "<table><caption>" + escape_html(input.heading) + "</caption>";
  for (const auto& [name, value] : input.rows)
    text += "<tr><td>" + escape_html(name) + "</td><td>" + escape_html(value) + "</td></tr>";
  return text + "</table>";
}

std::string grid(const ReportGrid& input) {
  std::string text = "<h2>" + escape_html(input.heading) + "</h2><div class=\"scroll\"><table><tr>";
  for (std::size_t c = 0; c < input.columns.size(); ++c) {
    text += (c == 0 ? "<th>" : "<th class=\"n\">") + escape_html(input.columns[c]) + "</th>";
  }
  text += "</tr>";
  for (const std::vector<std::string>& row : input.rows) {
    text += "<tr>";
    for (std::size_t c = 0; c < row.size(); ++c)
      text += (c == 0 ? "<td>" : "<td class=\"n\">") + escape_html(row[c]) + "</td>";
    text += "</tr>";
  }
  return text + "</table></div>\n";
}

}  // namespace

ReportImage make_report_image(compmark::ImageView<const float> image) {
  ReportImage result{image.width, image.height, std::vector<std::uint8_t>(3 * image.plane_size())};
  for (std::size_t i = 0; i < image.plane_size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = image.plane(static_cast<int>(c))[i];
      const float clamped = value > 0 ? std::min(value, 1.0f) : 0.0f;  // NaN becomes 0
      result.rgb[3 * i + c] = static_cast<std::uint8_t>(clamped * 255 + 0.5f);
    }
  }
  return result;
}

std::string make_report(const ReportInput& input) {
  std::string page =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\"><title>" +
      escape_html(input.title) + "</title><style>" + std::string(page_style) + std::string(plot_style) +
      "</style></head><body>\n";
  page += "<h1>" + escape_html(input.title) + "</h1><p class=\"sub\">" + escape_html(input.subtitle) + "</p>\n";
  if (!input.headline.empty()) {
    page += "<div class=\"figures\">";
    for (const auto& [value, meaning] : input.headline) {
      page += "<div><b>" + escape_html(value) + "</b><span>" + escape_html(meaning) + "</span></div>";
    }
    page += "</div>\n";
  }
  if (!input.words.empty()) {
    page += "<h2>Is the message there?</h2><div class=\"row\">";
    for (const ReportWords& one : input.words) page += words(one);
    page += "</div>\n";
  }
  if (!input.plots.empty()) {
    page += "<h2>Message</h2><div class=\"plots\">";
    for (const Plot& plot : input.plots) page += svg(plot);
    page += "</div>\n";
  }
  if (!input.views.empty()) {
    page += "<h2>Views: ground truth, " + escape_html(input.renders) + ", difference ×" +
            std::to_string(input.difference_gain) + "</h2>\n";
    for (const ReportView& view : input.views) page += view_row(view, input);
  }
  for (const ReportCurve& curve : input.curves) page += curves_html(curve);
  for (const ReportGrid& one : input.grids) page += grid(one);
  if (!input.tables.empty()) {
    page += "<h2>Details</h2><div class=\"row\">";
    for (const ReportTable& one : input.tables) page += "<div class=\"scroll\">" + table(one) + "</div>";
    page += "</div>\n";
  }
  return page + "</body></html>\n";
}

compmark::Result<compmark::Done> write_report(const std::filesystem::path& path, const ReportInput& input) {
  return compmark::write_file(path, make_report(input));
}

ReportTable machine_table(int threads) {
  ReportTable result{"Machine", {}};
  std::ifstream cpu("/proc/cpuinfo");
  for (std::string line; std::getline(cpu, line);) {
    if (line.rfind("model name", 0) == 0 && line.find(": ") != std::string::npos) {
      result.rows.emplace_back("processor", line.substr(line.find(": ") + 2));
      break;
    }
  }
  result.rows.emplace_back("hardware threads", std::to_string(std::thread::hardware_concurrency()));
  result.rows.emplace_back("threads used", std::to_string(threads));
  const long pages = sysconf(_SC_PHYS_PAGES), page_size = sysconf(_SC_PAGESIZE);
  if (pages > 0 && page_size > 0) {
    result.rows.emplace_back("memory",
                             format_text("%.1f GB", static_cast<double>(pages) * static_cast<double>(page_size) / 1e9));
  }
#if defined(__clang__)
  result.rows.emplace_back("compiler", "clang " __clang_version__);
#else
  result.rows.emplace_back("compiler", "g++ " __VERSION__);
#endif
#if defined(__AVX512F__)
  result.rows.emplace_back("vector instructions", "AVX-512");
#elif defined(__AVX2__)
  result.rows.emplace_back("vector instructions", "AVX2");
#else
  result.rows.emplace_back("vector instructions", "baseline");
#endif
  return result;
}

}  // namespace tool
