// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/run/run_settings.hpp>

TEST_CASE("app/run/run_settings: any number of a mark makes one wanted") {
  compmark::MarkSettings none;
  CHECK_FALSE(none.wanted());
  const auto wanted = [](auto change) {
    compmark::MarkSettings mark;
    change(mark);
    return mark.wanted();
  };
  CHECK(wanted([](auto& m) { m.key = "owner.key"; }));
  CHECK(wanted([](auto& m) { m.decoder = "decoder.safetensors"; }));
  CHECK(wanted([](auto& m) { m.fidelity = 0; }));
  CHECK(wanted([](auto& m) { m.recipient = 2; }));
  CHECK(wanted([](auto& m) { m.spread = 50; }));
  CHECK(wanted([](auto& m) { m.message_every = 2; }));
  CHECK(wanted([](auto& m) { m.for_compression = true; }));
}
