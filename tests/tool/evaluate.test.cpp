// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark evaluate: marked models of both codecs before and after them, each against its own counterpart: every figure is in JSON, CSV and the page, and is
// the one that the library finds in the pictures that anybody can render.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/metric/ssim.hpp>
#include <compmark/scene/image.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tool/running.hpp"

namespace evaluate_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::Outcome;
using testing::text_of;
using testing::tool;

constexpr std::size_t views = 3, bits = 24;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-evaluate-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// SqueezeNet weights of nobody: LPIPS of them is a distance all the same.
void write_random_lpips(const fs::path& path) {
  SafetensorsWriter writer;
  const auto add = [&](const std::string& name, const std::vector<std::int64_t>& shape) {
    std::size_t count = 1;
    for (const std::int64_t extent : shape) count *= static_cast<std::size_t>(extent);
    const double scale =
        shape.size() == 4 ? std::sqrt(6.0 / (static_cast<double>(count) / static_cast<double>(shape[0]))) : 0.1;
    const Random random(1, 0, random_stage(name));
    std::vector<float> values(count);
    for (std::size_t i = 0; i < count; ++i)
      values[i] = static_cast<float>(name[0] == 'l' ? random.uniform(i) : 2 * scale * (random.uniform(i) - 0.5));
    writer.add_copy(name, shape, std::span<const float>(values));
  };
  const auto convolution = [&](const std::string& name, std::int64_t out, std::int64_t in, std::int64_t kernel) {
    add("features." + name + ".weight", {out, in, kernel, kernel});
    add("features." + name + ".bias", {out});
  };
  convolution("conv1", 64, 3, 3);
  std::int64_t in = 64;
  for (std::int64_t fire = 2; fire <= 9; ++fire) {
    const std::string name = "fire" + std::to_string(fire);
    const std::int64_t squeezed = 16 * (fire / 2);
    convolution(name + ".squeeze1x1", squeezed, in, 1);
    convolution(name + ".expand1x1", 4 * squeezed, squeezed, 1);
    convolution(name + ".expand3x3", 4 * squeezed, squeezed, 3);
    in = 8 * squeezed;
  }
  int layer = 0;
  for (const std::int64_t channels : {64, 128, 256, 384, 384, 512, 512})
    add("lin" + std::to_string(layer++) + ".weight", {channels});
  REQUIRE(writer.write(path).ok());
}

/// The built-in scene, small, in two codecs, each marked for some iterations: how well is no question here.
struct Fixture {
  std::string key = at("owner.key"), decoder = at("colours.safetensors"), lpips = at("lpips.safetensors");
  Fixture() {
    done("scene --out " + at("scene") + " --width 64 --height 64 --train 12 --test " + std::to_string(views));
    REQUIRE(write_key(key, testing::fixed_key(1, bits)).ok());
    REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_colours(bits), "a test", fs::path(decoder)).ok());
    write_random_lpips(lpips);
    for (const std::string codec : {"hac", "context_gs"}) {
      // One thread: with little to do a second one waits more than it helps.
      done("train --threads 1 --codec " + codec + " --voxel-size 0.2 --effects none --iterations 100 --data " +
           at("scene") + " --out " + at(codec));
      done("embed --threads 1 --iterations 30 --fidelity 100 --message-rate 0.01 --model " +
           at(codec + "/model.safetensors") + " --data " + at("scene") + " --out " + at(codec + "_marked") + " --key " +
           key + " --decoder " + decoder);
    }
  }
  [[nodiscard]] std::string mark() const { return " --key " + key + " --decoder " + decoder; }
};
const Fixture& fixture() {
  static const Fixture instance;
  return instance;
}

/// Lines of cells by the names of the first line (RFC 4180).
std::vector<std::map<std::string, std::string>> csv_of(const fs::path& path) {
  std::vector<std::vector<std::string>> lines(1, std::vector<std::string>(1));
  bool quoted = false;
  const std::string text = text_of(path);
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string& cell = lines.back().back();
    if (quoted && text[i] == '"' && i + 1 < text.size() && text[i + 1] == '"')
      cell += text[i++];
    else if (text[i] == '"')
      quoted = !quoted;
    else if (!quoted && text[i] == ',')
      lines.back().emplace_back();
    else if (!quoted && text[i] == '\n')
      lines.emplace_back(1);
    else if (quoted || text[i] != '\r')
      cell += text[i];
  }
  lines.pop_back();  // what follows the last line's end
  std::vector<std::map<std::string, std::string>> rows;
  for (std::size_t l = 1; l < lines.size(); ++l) {
    REQUIRE(lines[l].size() == lines[0].size());
    rows.emplace_back();
    for (std::size_t c = 0; c < lines[0].size(); ++c) rows.back()[lines[0][c]] = lines[l][c];
  }
  return rows;
}

/// The table under a heading of the page, lines of cells by the names of its header.
std::vector<std::map<std::string, std::string>> table_of(const std::string& page, const std::string& heading) {
  const std::string begin = "<h2>" + heading + "</h2><div class=\"scroll\"><table>";
  const std::size_t from = page.find(begin);
  INFO(heading);
  REQUIRE(from != std::string::npos);
  const std::string table = page.substr(from + begin.size(), page.find("</table>", from) - from - begin.size());
  std::vector<std::string> names;
  std::vector<std::map<std::string, std::string>> rows;
  for (std::size_t line = table.find("<tr>"); line != std::string::npos; line = table.find("<tr>", line + 1)) {
    const std::size_t end = table.find("</tr>", line);
    std::vector<std::string> cells;
    for (std::size_t cell = table.find("<t", line + 4); cell < end; cell = table.find("<t", cell + 1)) {
      const std::size_t text = table.find('>', cell) + 1;
      cells.push_back(table.substr(text, table.find("</t", text) - text));
    }
    if (names.empty()) {
      names = cells;
      continue;
    }
    REQUIRE(cells.size() == names.size());
    rows.emplace_back();
    for (std::size_t c = 0; c < cells.size(); ++c) rows.back()[names[c]] = cells[c];
  }
  return rows;
}

std::string text(const char* format, double value) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, value);
  return buffer;
}

/// How the measures are called in JSON and CSV, and in the tables of the page.
struct Named {
  const char *name, *heading, *format;
  bool of_unmarked;
};
constexpr Named named[] = {{"psnr", "PSNR, dB", "%.3f", false},
                           {"ssim", "SSIM", "%.4f", false},
                           {"lpips_squeeze", "LPIPS-squeeze", "%.4f", false},
                           {"psnr_cost_vs_unmarked", "dB lost", "%.3f", true},
                           {"psnr_vs_unmarked", "against unmarked, dB", "%.2f", true},
                           {"ssim_vs_unmarked", "SSIM against it", "%.4f", true},
                           {"lpips_squeeze_vs_unmarked", "LPIPS-squeeze against it", "%.4f", true},
                           {"milliseconds", "ms a view", "%.1f", false}};

/// Figures of one view or model in the three files.
void check_same(const nlohmann::json& json, std::map<std::string, std::string>& csv,
                std::map<std::string, std::string>& page, bool has_unmarked) {
  for (const Named& measure : named) {
    INFO(measure.name);
    if (measure.of_unmarked && !has_unmarked) {
      CHECK_FALSE(json.contains(measure.name));
      CHECK(csv.at(measure.name).empty());
      CHECK(page.at(measure.heading).empty());
      continue;
    }
    REQUIRE(json.contains(measure.name));
    const double value = json[measure.name].get<double>();
    REQUIRE_FALSE(csv.at(measure.name).empty());
    CHECK(std::stod(csv[measure.name]) == doctest::Approx(value).epsilon(1e-8));
    CHECK(page.at(measure.heading) == text(measure.format, value));
  }
}

/// A render that anybody can make.
std::vector<float> picture(const fs::path& path, int& width, int& height) {
  const Result<ImageBytes> image = decode_image(testing::file_bytes(path), path.string());
  REQUIRE(image.ok());
  width = image->width;
  height = image->height;
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                    channels = static_cast<std::size_t>(image->channels);
  std::vector<float> planes(3 * pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      planes[c * pixels + i] = static_cast<float>(image->pixels[i * channels + c]) / 255.0f;
  }
  return planes;
}

}  // namespace

TEST_CASE(
    "evaluate: marked models of both codecs against their own counterparts, the same figures in JSON, CSV and page") {
  const Fixture& all = fixture();
  // Before and after HAC, after ContextGS, and a control: an unmarked model that is its own counterpart.
  const std::vector<std::string> models = {"hac_marked/model.safetensors", "hac_marked/model.cmk",
                                           "context_gs_marked/model.cmk", "hac/model.safetensors"},
                                 counterparts = {"hac/model.safetensors", "hac_marked/unmarked.cmk",
                                                 "context_gs_marked/unmarked.cmk", "hac/model.safetensors"};
  std::string command = "evaluate --threads 1 --data " + at("scene") + all.mark() + " --lpips-squeeze " + all.lpips +
                        " --json " + at("all.json") + " --csv " + at("all.csv") + " --html " + at("all.html") +
                        " --model";
  for (const std::string& model : models) command += " " + at(model);
  command += " --unmarked";
  for (const std::string& counterpart : counterparts) command += " " + at(counterpart);
  const Outcome outcome = done(command);
  CHECK(outcome.text.find("its p") != std::string::npos);  // the terminal has the worst view's too
  const nlohmann::json json = json_of(at("all.json"));
  auto csv = csv_of(at("all.csv"));
  const std::string page = text_of(at("all.html"));
  auto table = table_of(page, "Models");
  const auto sections = table_of(page, "Bytes by section");

  // Six files: the control's counterpart is there already.
  REQUIRE(json["models"].size() == 6);
  REQUIRE(table.size() == 6);
  REQUIRE(csv.size() == 6 * (views + 1));
  for (std::size_t m = 0; m < 6; ++m) {
    const nlohmann::json& model = json["models"][m];
    const std::string name = m < 4 ? models[m] : counterparts[m - 3], shown = name + (m < 3 ? "" : " (unmarked)");
    INFO(name);
    CHECK(model["name"] == name);  // three are called model.cmk or model.safetensors: with their folder
    CHECK(model["unmarked"] == (m >= 3));
    REQUIRE(model.contains("twin") == (m < 4));
    if (m < 4) CHECK(json["models"][model["twin"].get<std::size_t>()]["name"] == counterparts[m]);

    // All views.
    auto& whole = csv[m * (views + 1) + views];
    CHECK(whole.at("scope") == "model");
    CHECK(whole.at("model") == name);
    CHECK(whole.at("view").empty());
    CHECK(whole.at("unmarked") == (m < 4 ? counterparts[m] : ""));
    CHECK(table[m].at("model") == shown);
    CHECK(table[m].at("unmarked counterpart") == (m < 4 ? counterparts[m] : ""));
    if (m < 3) CHECK(page.find("./test/r_000, " + name) != std::string::npos);  // under its picture
    check_same(model, whole, table[m], m < 4);
    const double accuracy = model["bit_accuracy"]["mean"].get<double>(),
                 worst = model["bit_accuracy"]["min"].get<double>(), p = model["p_value"].get<double>(),
                 worst_p = model["largest_view_p_value"].get<double>();
    CHECK(std::stod(whole.at("bit_accuracy")) == doctest::Approx(accuracy).epsilon(1e-8));
    CHECK(std::stod(whole.at("bit_accuracy_min")) == doctest::Approx(worst).epsilon(1e-8));
    CHECK(std::stod(whole.at("p_value")) == doctest::Approx(p).epsilon(1e-8));
    CHECK(std::stod(whole.at("largest_view_p_value")) == doctest::Approx(worst_p).epsilon(1e-8));
    CHECK(table[m].at("bits a view") == text("%.4f", accuracy));
    CHECK(table[m].at("worst view") == text("%.4f", worst));
    CHECK(table[m].at("its p") == text("%.1e", worst_p));
    CHECK(table[m].at("p") == text("%.1e", p));
    CHECK(table[m].at("all views") == std::to_string(model["bits_right"].get<int>()) + " of 24");
    CHECK(whole.at("bits_right") == std::to_string(model["bits_right"].get<int>()));

    // Each view; their means are the model's.
    auto by_view = table_of(page, "Views of " + shown);
    REQUIRE(model["views"].size() == views);
    REQUIRE(by_view.size() == views);
    std::map<std::string, double> sums;
    double least = 1, largest_p = 0;
    for (std::size_t v = 0; v < views; ++v) {
      const nlohmann::json& view = model["views"][v];
      auto& line = csv[m * (views + 1) + v];
      CHECK(line.at("scope") == "view");
      CHECK(line.at("view") == view["name"]);
      CHECK(by_view[v].at("view") == view["name"]);
      check_same(view, line, by_view[v], m < 4);
      for (const Named& measure : named) sums[measure.name] += view.value(measure.name, 0.0);
      const int right = view["bits_right"].get<int>();
      CHECK(line.at("bits_right") == std::to_string(right));
      CHECK(line.at("bits") == "24");
      CHECK(by_view[v].at("bits") == std::to_string(right) + " of 24");
      CHECK(by_view[v].at("p") == text("%.1e", view["p_value"].get<double>()));
      CHECK(std::stod(line.at("p_value")) == doctest::Approx(view["p_value"].get<double>()).epsilon(1e-8));
      least = std::min(least, right / 24.0);
      largest_p = std::max(largest_p, view["p_value"].get<double>());
    }
    CHECK(worst == doctest::Approx(least));
    CHECK(worst_p == largest_p);
    for (const Named& measure : named) {
      if (model.contains(measure.name))
        CHECK(model[measure.name].get<double>() == doctest::Approx(sums[measure.name] / views).epsilon(1e-9));
    }

    // Size, by section.
    const std::string bytes = std::to_string(fs::file_size(at(name)));
    CHECK(model["bytes"].dump() == bytes);
    CHECK(whole.at("bytes") == bytes);
    CHECK(table[m].at("bytes") == bytes);
    CHECK(whole.at("anchors") == model["anchors"].dump());
    CHECK(table[m].at("anchors") == model["anchors"].dump());
    std::size_t in_json = 0, in_csv = 0, in_page = 0;
    for (const auto& [column, cell] : whole)
      in_csv += column.rfind("section: ", 0) == 0 && !cell.empty() ? std::stoul(cell) : 0;
    if (name.find(".cmk") == std::string::npos) {
      CHECK_FALSE(model.contains("sections"));
      CHECK(in_csv == 0);
      continue;
    }
    const std::string codec = name.rfind("hac", 0) == 0 ? "hac" : "context_gs";
    CHECK(model["codec"] == codec);
    CHECK(whole.at("codec") == codec);
    CHECK(table[m].at("codec") == codec);
    for (const auto& [section, size] : model["sections"].items()) {
      in_json += size.get<std::size_t>();
      CHECK(whole.at("section: " + section) == size.dump());
      for (const auto& row : sections) in_page += row.at("section") == section ? std::stoul(row.at(shown)) : 0;
    }
    CHECK(std::to_string(in_json) == bytes);
    CHECK(std::to_string(in_csv) == bytes);
    CHECK(std::to_string(in_page) == bytes);
    CHECK(sections.back().at(shown) == bytes);
  }
  CHECK(json["views"] == json["models"][0]["views"]);
  CHECK(json["psnr"] == json["models"][0]["psnr"]);

  // The control: nothing lies between a model and itself. The marked ones are other models.
  const nlohmann::json& control = json["models"][3];
  CHECK(control["psnr_vs_unmarked"] == psnr_of_identical_images);
  CHECK(control["ssim_vs_unmarked"] == 1.0);
  CHECK(control["lpips_squeeze_vs_unmarked"] == 0.0);
  CHECK(control["psnr_cost_vs_unmarked"] == 0.0);
  for (std::size_t m = 0; m < 3; ++m) {
    CHECK(json["models"][m]["psnr_vs_unmarked"].get<double>() < 60);
    CHECK(json["models"][m]["ssim_vs_unmarked"].get<double>() < 0.9999);
    CHECK(json["models"][m]["lpips_squeeze_vs_unmarked"].get<double>() > 0);
  }
  // After the codec, a model is compared with what the codec made of the counterpart, as embed does.
  for (const auto& [m, run] :
       {std::pair(std::size_t{1}, "hac_marked"), std::pair(std::size_t{2}, "context_gs_marked")}) {
    const nlohmann::json said = json_of(at(std::string(run) + "/results.json"))["compressed"];
    CHECK(json["models"][m]["psnr_cost_vs_unmarked"].get<double>() ==
          doctest::Approx(said["psnr_cost_vs_unmarked"].get<double>()).epsilon(1e-9));
    CHECK(json["models"][m]["psnr_vs_unmarked"].get<double>() ==
          doctest::Approx(said["psnr_marked_vs_unmarked"].get<double>()).epsilon(1e-9));
    CHECK(json["models"][m]["bit_accuracy"] == said["bit_accuracy"]);
    CHECK(json["models"][m]["sections"] == said["sections"]);
  }
}

TEST_CASE("evaluate: what it says of two renders is what the library finds in their pictures") {
  const Fixture& all = fixture();
  done("evaluate --threads 1 --data " + at("scene") + " --model " + at("hac_marked/model.cmk") + " --unmarked " +
       at("hac_marked/unmarked.cmk") + " --json " + at("pair.json"));
  const nlohmann::json pair = json_of(at("pair.json"));
  CHECK_FALSE(pair.contains("lpips_squeeze_vs_unmarked"));  // no weights
  CHECK_FALSE(pair.contains("p_value"));                    // no key
  for (const char* model : {"model", "unmarked"})
    done("render --model " + at("hac_marked/" + std::string(model) + ".cmk") + " --out " + at(model));
  std::vector<fs::path> names;
  for (const auto& entry : fs::directory_iterator(at("model"))) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  REQUIRE(names.size() == views);
  for (std::size_t v = 0; v < views; ++v) {
    int width = 0, height = 0;
    const std::vector<float> marked = picture(scratch() / "model" / names[v], width, height),
                             unmarked = picture(scratch() / "unmarked" / names[v], width, height);
    const ImageView<const float> a{marked.data(), 3, height, width}, b{unmarked.data(), 3, height, width};
    CHECK(pair["views"][v]["psnr_vs_unmarked"].get<double>() == doctest::Approx(psnr(a, b)).epsilon(1e-6));
    CHECK(pair["views"][v]["ssim_vs_unmarked"].get<double>() == doctest::Approx(ssim(a, b)).epsilon(1e-6));
  }
  static_cast<void>(all);
}

TEST_CASE("evaluate: one counterpart for all models, or one for each; other counts are refused") {
  static_cast<void>(fixture());
  const std::string models = "evaluate --threads 1 --data " + at("scene") + " --model " +
                             at("hac_marked/model.safetensors") + " " + at("hac_marked/model.cmk") + " " +
                             at("hac/model.safetensors");
  done(models + " --unmarked " + at("hac/model.safetensors") + " --json " + at("one.json"));
  const nlohmann::json one = json_of(at("one.json"))["models"];
  REQUIRE(one.size() == 3);  // the counterpart is the last of them
  for (std::size_t m = 0; m < 3; ++m) {
    CHECK(one[m]["twin"] == 2);
    CHECK(one[m]["psnr_cost_vs_unmarked"].get<double>() ==
          doctest::Approx(one[2]["psnr"].get<double>() - one[m]["psnr"].get<double>()).epsilon(1e-9));
  }
  const std::string unmarked = " " + at("hac_marked/unmarked.cmk"), json = " --json " + at("none.json");
  check_refused(tool(models + " --unmarked" + unmarked + unmarked + json),
                {"--unmarked", "2 files for 3 models", "one for each"});
  check_refused(tool(models + " --unmarked" + unmarked + unmarked + unmarked + unmarked + json),
                {"4 files for 3 models"});
  CHECK_FALSE(fs::exists(at("none.json")));
  // What is read is not written over, the second counterpart neither.
  check_refused(tool(models + " --unmarked" + unmarked + " " + at("hac/model.safetensors") + unmarked + " --csv " +
                     at("hac/model.safetensors")),
                {"--csv"});
}

}  // namespace evaluate_test
