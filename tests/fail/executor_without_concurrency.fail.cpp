// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An Executor that does not say how many workers it has.
// message: concurrency
#include "compmark/core/executor.hpp"

struct Incomplete {
  template <class Body>
  void for_chunks(std::size_t n, std::size_t, const Body& body) {
    body(std::size_t{0}, n, std::size_t{0});
  }
};

#ifdef COMPMARK_MUST_FAIL
using Candidate = Incomplete;
#else
using Candidate = compmark::SerialExecutor;
#endif
static_assert(compmark::Executor<Candidate>);
