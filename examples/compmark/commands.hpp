// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One function a subcommand: add_… declares its options and returns what runs it.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace tool {

using Command = std::function<int()>;

Command add_scene(CLI::App& app);
Command add_probe(CLI::App& app);
Command add_train(CLI::App& app);
Command add_embed(CLI::App& app);
Command add_fit(CLI::App& app);
Command add_pretrain(CLI::App& app);
Command add_compress(CLI::App& app);
Command add_fit_codec(CLI::App& app);
Command add_decompress(CLI::App& app);
Command add_render(CLI::App& app);
Command add_evaluate(CLI::App& app);
Command add_export(CLI::App& app);
Command add_info(CLI::App& app);
Command add_keygen(CLI::App& app);
Command add_extract(CLI::App& app);
Command add_verify(CLI::App& app);
Command add_calibrate(CLI::App& app);
Command add_attack(CLI::App& app);

}  // namespace tool
