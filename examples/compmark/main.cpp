// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The command-line tool: train, render and evaluate anchor-based splats on the CPU. Exit codes: 0 done (verify:
// detected), 1 verify: not detected, 2 error (one line says what, where and what to do), 3 verify: inconclusive, 4
// decompress --salvage: something was lost, 130 interrupted (a checkpoint was written).
#include <CLI/CLI.hpp>
#include <compmark/version.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "common.hpp"
#include "options.hpp"
#include "process.hpp"
#include "run_folder.hpp"

int main(int argc, char** argv) {
  tool::prepare_process();
  CLI::App app{"compmark: train, protect and ship 3D Gaussian splats on the CPU", "compmark"};
  app.require_subcommand(1);
  app.set_help_all_flag("--help-all", "help of all subcommands");
  app.set_version_flag("--version", std::string("compmark ") + compmark::version);

  struct Entry {
    std::string name;
    std::unique_ptr<tool::Options> options;
    tool::Command run;
  };
  std::vector<Entry> entries;
  const auto add = [&](const char* name, const char* text, tool::Command (*declare)(tool::Options&)) {
    auto options = std::make_unique<tool::Options>(*app.add_subcommand(name, text));
    tool::Command run = declare(*options);
    entries.push_back({name, std::move(options), std::move(run)});
  };
  add("scene", "write the built-in procedural scene as a dataset", tool::add_scene);
  add("probe", "measure which effects of a capture a recipe should model", tool::add_probe);
  add("train", "train a splat from a dataset", tool::add_train);
  add("adopt", "train a model from the splats of another program, without photographs", tool::add_adopt);
  add("embed", "hide a message in a finished model", tool::add_embed);
  add("spread", "hide a mark that single pictures prove to who has the unmarked model", tool::add_spread);
  add("fit", "fit a message decoder to one scene, from its unmarked model", tool::add_fit);
  add("interference", "measure what an unmarked scene says to a message decoder by itself", tool::add_interference);
  add("pretrain", "train a message decoder for all scenes, from photographs", tool::add_pretrain);
  add("compress", "write the compressed file (.cmk) of a model that was trained for it", tool::add_compress);
  add("fit-codec", "fit a codec to a finished model and write its compressed file (.cmk)", tool::add_fit_codec);
  add("decompress", "write the model of a compressed file, or the undamaged part of it", tool::add_decompress);
  add("render", "render views of a model to PNG", tool::add_render);
  add("register", "find the cameras from which pictures show the scene of a model", tool::add_register);
  add("evaluate", "measure models against a dataset's test views", tool::add_evaluate);
  add("export", "write a model as splats of any viewer (PLY, SPZ, SOG, .splat, .glb), or as a page that shows them",
      tool::add_export);
  add("info", "print the contents and the digest of a model file", tool::add_info);
  add("keygen", "make an owner's key", tool::add_keygen);
  add("claim", "write the line that an owner publishes before anybody else has the scene", tool::add_claim);
  add("extract", "read the bits of a model's renders or of images", tool::add_extract);
  add("verify", "test whether a key's message is in a model or in images, with a p-value", tool::add_verify);
  add("certify", "verify, and write a record of it for somebody else", tool::add_certify);
  add("calibrate", "measure false positives of random keys on images", tool::add_calibrate);
  add("attack", "write an attacked model, or attacked images", tool::add_attack);
  add("doctor", "say what this machine has for the program, and what is missing", tool::add_doctor);

  app.add_flag_callback(
      "--options-json",
      [&] {
        nlohmann::ordered_json json;
        for (const Entry& entry : entries) json[entry.name] = entry.options->json();
        std::printf("%s\n", json.dump(2).c_str());
        throw CLI::Success();
      },
      "print all options of all commands as JSON: files that are read, files that are "
      "written, ranges of numbers");

  const std::vector<std::string> words = tool::with_new_names({argv + 1, argv + argc});
  try {
    app.parse(std::vector<std::string>(words.rbegin(), words.rend()));  // the parser takes them from the end
  } catch (const CLI::ParseError& error) {
    return tool::finish_output(tool::answer_parser(app, error, words));
  }
  try {
    for (const Entry& entry : entries) {
      if (!entry.options->parsed()) continue;
      const auto taken = tool::take_files(entry.options->use());
      if (!taken) return tool::fail(taken.error());
      return tool::finish_output(entry.run());
    }
  } catch (...) {
    return tool::fail(tool::caught_error());
  }
  return tool::failure;
}
