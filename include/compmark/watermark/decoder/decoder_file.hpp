// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Files of decoder weights: the tables, reading and writing. The format is described in decoder_reader.hpp.
#pragma once

#include "compmark/watermark/decoder/decoder_reader.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"
#include "compmark/watermark/decoder/decoder_writer.hpp"
