// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// splat-transform of PlayCanvas as a peer: it reads every format that we write to the numbers that we read from the
// same file, and we read what it writes. Label peer; without the program the tests say so and are skipped.
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/io/splat/read_splat.hpp>
#include <compmark/io/splat/write_splat.hpp>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "io/splat_differences.hpp"
#include "io/splat_writers.hpp"
#include "support/scene_files.hpp"

namespace splat_transform_test {

using compmark::SplatFile;
using compmark::SplatFormat;
using compmark::SplatTable;
using compmark::SplatWritten;
using compmark::testing::TemporaryFolder;
using compmark::testing::splats::Differences;

bool peer_is_there() {
  const bool there = std::system("command -v splat-transform >/dev/null 2>&1") == 0;
  if (!there) MESSAGE("skipped: no splat-transform (npm install -g @playcanvas/splat-transform)");
  return there;
}

SplatTable table_of(const std::filesystem::path& path) {
  const compmark::Result<SplatFile> file = compmark::read_splat(path);
  REQUIRE_MESSAGE(file.ok(), file.error().line());
  return file->table;
}
void transform(const std::filesystem::path& from, const std::filesystem::path& to) {
  const std::string command =
      "splat-transform -q -g cpu -w '" + from.string() + "' '" + to.string() + "' >/dev/null 2>&1";
  CAPTURE(command);
  REQUIRE(std::system(command.c_str()) == 0);
}
/// Nothing but the last bits of floats.
void check_alike(const SplatTable& ours, const SplatTable& theirs, double rotation) {
  const Differences found = compmark::testing::splats::differences(ours, theirs);
  CHECK(found.mean < 2e-6);
  CHECK(found.log_scale < 2e-6);
  CHECK(found.color < 2e-6);
  CHECK(found.opacity < 2e-6);
  CHECK(found.harmonics < 2e-6);
  CHECK(found.rotation < rotation);
}

TEST_CASE("peer/splat_transform: reads every format that we write, of every degree, to the numbers that we read") {
  if (!peer_is_there()) return;
  const TemporaryFolder folder;
  for (int degree = 0; degree <= compmark::max_sh_degree; ++degree) {
    const SplatTable table = compmark::testing::splats::random_splats(700, degree);
    for (const compmark::SplatEnding& known : compmark::splat_endings) {
      const std::filesystem::path file = folder.path() / ("ours" + std::string(known.ending));
      const std::filesystem::path back = folder.path() / "back.ply";
      if (known.format == SplatFormat::glb) continue;                         // it writes this one alone
      if (known.format == SplatFormat::sog && !compmark::has_webp) continue;  // it reads WebP images alone
      CAPTURE(file.string());
      const compmark::Result<SplatWritten> written = compmark::write_splat(file, table);
      REQUIRE_MESSAGE(written.ok(), written.error().line());
      transform(file, back);
      // It takes a byte of a rotation in .splat for b / 127.5 - 1, we for b / 128 - 1, as the format's viewer does.
      check_alike(table_of(file), table_of(back), known.format == SplatFormat::splat ? 0.01 : 2e-6);
    }
  }
  // The control: files of other splats are told apart.
  const SplatTable one = compmark::testing::splats::random_splats(700, 0),
                   other = compmark::testing::splats::random_splats(700, 0, 4);
  CHECK(compmark::testing::splats::differences(one, other).mean > 1);
}

TEST_CASE("peer/splat_transform: we read what it writes as it does, and its .glb to the bit") {
  if (!peer_is_there()) return;
  const TemporaryFolder folder;
  const SplatTable table = compmark::testing::splats::random_splats(700, 3);
  const std::filesystem::path ply = folder.path() / "ours.ply", back = folder.path() / "back.ply";
  REQUIRE(compmark::write_splat(ply, table).ok());
  for (const char* name : {"theirs.compressed.ply", "theirs.spz", "theirs.sog"}) {
    const std::filesystem::path file = folder.path() / name;
    if (std::string(name) == "theirs.sog" && !compmark::has_webp) continue;
    CAPTURE(name);
    transform(ply, file);
    transform(file, back);
    check_alike(table_of(file), table_of(back), 2e-6);
  }
  // Its glTF is turned by half a circle round z, ours round x: both have y up.
  const std::filesystem::path glb = folder.path() / "theirs.glb";
  transform(ply, glb);
  SplatTable turned = table;
  compmark::detail::change_axes(turned, {-1, 1, -1});
  // It turns a splat from the left alone, we from both sides: the axes of a splat have other signs, its shape is one.
  for (std::size_t k = 0; k < 4; ++k) turned.rotation[k] = table.rotation[3 - k];
  const Differences found = compmark::testing::splats::differences(turned, table_of(glb));
  CHECK(found.mean < 2e-6);
  CHECK(found.harmonics < 2e-6);
  CHECK(found.log_scale < 2e-6);
  CHECK(found.rotation < 2e-6);
}

TEST_CASE("peer/splat_transform: what we write goes through it to every format that it writes, and back") {
  if (!peer_is_there()) return;
  const TemporaryFolder folder;
  // A whole step of each format: what we and it read of a file differs in the last bits, which can fall to either side.
  struct Step {
    const char* name;
    double mean, log_scale, color, opacity, harmonics, rotation;
  };
  const double byte = 1.0 / 255, dc = compmark::sh_constant;
  // 256 numbers of SOG are learned from the values: four steps of an even grid of 256. Its sets of harmonics come from a
  // clustering, and those of two tables that differ in last bits were 1.3 apart: they are not compared here.
  const double any = 8;
  const std::vector<Step> steps{
      {"theirs.compressed.ply", 8.0 / 1023, 7.0 / 1023, 3.2 * dc * byte, byte, 1.0 / 32, 0.004},
      {"theirs.spz", 1.0 / 4096, 1.0 / 16, dc / 38.25, byte, 1.0 / 8, 0.004},
      {"theirs.sog", 1e-3, 28 * byte, 12.8 * dc * byte, byte, any, 0.02},
      {"theirs.glb", 0, 0, 0, 0, 0, 0}};
  for (const compmark::SplatEnding& known : compmark::splat_endings) {
    if (known.format == SplatFormat::glb) continue;  // it writes this one alone
    if (known.format == SplatFormat::ply) continue;  // the case above
    if (known.format == SplatFormat::sog && !compmark::has_webp) continue;
    const std::filesystem::path file = folder.path() / ("ours" + std::string(known.ending));
    const std::filesystem::path plain = folder.path() / "plain.ply";
    REQUIRE(compmark::write_splat(file, compmark::testing::splats::random_splats(700, 3)).ok());
    REQUIRE(compmark::write_splat(plain, table_of(file)).ok());
    for (const Step& step : steps) {
      const std::filesystem::path there = folder.path() / step.name;
      if (there.extension() == ".sog" && !compmark::has_webp) continue;
      CAPTURE(file.string());
      CAPTURE(step.name);
      transform(file, there);
      const SplatTable through = table_of(there);
      transform(plain, there);  // what it makes of the numbers that we read in our file
      const Differences found = compmark::testing::splats::differences(through, table_of(there));
      CHECK(found.mean <= step.mean + 2e-6);
      CHECK(found.log_scale <= step.log_scale + 2e-6);
      CHECK(found.color <= step.color + 2e-6);
      CHECK(found.opacity <= step.opacity + 2e-6);
      CHECK(found.harmonics <= step.harmonics + 2e-6);
      CHECK(found.rotation <= step.rotation + (known.format == SplatFormat::splat ? 0.01 : 2e-6));
    }
  }
}

}  // namespace splat_transform_test
