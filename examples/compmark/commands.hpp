// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One function for each subcommand: add_… declares its options and returns the function that runs it.
#pragma once

#include <functional>

#include "options.hpp"

namespace tool {

using Command = std::function<int()>;

Command add_scene(Options& app);
Command add_probe(Options& app);
Command add_train(Options& app);
Command add_adopt(Options& app);
Command add_embed(Options& app);
Command add_spread(Options& app);
Command add_fit(Options& app);
Command add_interference(Options& app);
Command add_pretrain(Options& app);
Command add_compress(Options& app);
Command add_fit_codec(Options& app);
Command add_decompress(Options& app);
Command add_render(Options& app);
Command add_register(Options& app);
Command add_evaluate(Options& app);
Command add_export(Options& app);
Command add_info(Options& app);
Command add_keygen(Options& app);
Command add_claim(Options& app);
Command add_extract(Options& app);
Command add_verify(Options& app);
Command add_certify(Options& app);
Command add_calibrate(Options& app);
Command add_attack(Options& app);
Command add_doctor(Options& app);

}  // namespace tool
