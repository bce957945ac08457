// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message decoder of nothing but names would read nothing.
// message: Recipe: MessageDecoder lacks bits
#include "compmark/recipes/marked_codecs.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"

using namespace compmark;

struct Empty {
  static constexpr bool is_absent = false;
  using Scalar = float;
  struct Settings {};
  struct Handles {};
  struct Context {};
};
struct Mine : recipes::Scaffold {
#ifdef COMPMARK_MUST_FAIL
  using MessageDecoder = Empty;
#else
  using MessageDecoder = LatticeDecoder<float>;
#endif
};

Pipeline<Mine> pipeline;
