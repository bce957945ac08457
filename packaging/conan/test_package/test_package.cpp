// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The package is found, and stb through it: a picture is written.
#include <compmark/io/image_file.hpp>
#include <compmark/version.hpp>
#include <cstdio>
#include <vector>

int main() {
  std::vector<float> pixels(3 * 8 * 8, 0.5f);
  const compmark::ImageView<float> image{pixels.data(), 3, 8, 8};
  if (!compmark::write_png("test_package.png", image).ok()) return 1;
  std::printf("compmark %s\n", compmark::version);
  return 0;
}
