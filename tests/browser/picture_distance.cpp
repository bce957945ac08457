// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
//   picture_distance a.png b.png      prints the PSNR of two pictures, dB
//   picture_distance a.png R G B      succeeds if the first pixel has this colour
#include <compmark/io/image_file.hpp>
#include <compmark/metric/psnr.hpp>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

std::vector<int> colors(const char* path) {
  const compmark::Result<compmark::ImageBytes> image = compmark::read_image(path);
  if (!image) {
    std::fprintf(stderr, "%s\n", image.error().line().c_str());
    std::exit(2);
  }
  std::vector<int> values{image->width, image->height};
  const auto channels = static_cast<std::size_t>(image->channels);
  for (std::size_t i = 0; i < image->pixels.size(); i += channels) {
    for (std::size_t c = 0; c < 3; ++c) values.push_back(image->pixels[i + (channels < 3 ? 0 : c)]);
  }
  return values;
}

}  // namespace

int main(int count, char** words) {
  if (count != 3 && count != 5) return 2;
  const std::vector<int> a = colors(words[1]);
  if (count == 5) {
    std::printf("%d %d %d\n", a[2], a[3], a[4]);
    for (int c = 0; c < 3; ++c) {
      if (a[static_cast<std::size_t>(2 + c)] != std::atoi(words[2 + c])) return 1;
    }
    return 0;
  }
  const std::vector<int> b = colors(words[2]);
  if (a.size() != b.size() || a[0] != b[0]) return 2;
  double sum = 0;
  for (std::size_t i = 2; i < a.size(); ++i) sum += static_cast<double>((a[i] - b[i]) * (a[i] - b[i]));
  std::printf("%.2f\n", compmark::psnr_from_mse(sum / static_cast<double>(a.size() - 2) / (255.0 * 255.0)));
  return 0;
}
