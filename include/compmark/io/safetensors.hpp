// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// safetensors: 8 bytes little-endian header length n, n bytes of JSON {name: {dtype, shape, data_offsets},
// "__metadata__": {...}}, data. Reading and writing have a header each; this one gives both.
#pragma once

#include "compmark/io/safetensors_reader.hpp"
#include "compmark/io/safetensors_writer.hpp"
