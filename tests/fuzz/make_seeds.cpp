// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Writes first inputs of the fuzz targets that don't make their own: make_seeds FOLDER gives FOLDER/<target>/*.
#include <compmark/io/image_file.hpp>
#include <compmark/io/owner_claim.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/ply.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/io/splat/write_splat.hpp>

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "any_capture.hpp"
#include "io/splat_writers.hpp"

namespace {

using namespace compmark;
namespace fs = std::filesystem;

/// A PNG of any type that the format has, whose rows are all of one byte; checksums are left out, as stb_image does.
std::vector<std::byte> png(int side, int depth, int type, bool interlaced) {
  std::vector<std::byte> file;
  const auto word = [&](std::uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) file.push_back(static_cast<std::byte>(value >> shift & 255u));
  };
  const auto chunk = [&](const char* name, std::span<const std::byte> bytes) {
    word(static_cast<std::uint32_t>(bytes.size()));
    for (int i = 0; i < 4; ++i) file.push_back(static_cast<std::byte>(name[i]));
    file.insert(file.end(), bytes.begin(), bytes.end());
    word(0);
  };
  for (const unsigned b : {0x89u, 'P' + 0u, 'N' + 0u, 'G' + 0u, 13u, 10u, 26u, 10u}) file.push_back(std::byte(b));
  std::vector<std::byte> header(13);
  header[3] = header[7] = static_cast<std::byte>(side);
  header[8] = static_cast<std::byte>(depth);
  header[9] = static_cast<std::byte>(type);
  header[12] = static_cast<std::byte>(interlaced ? 1 : 0);
  chunk("IHDR", header);
  if (type == 3) {
    chunk("PLTE", std::vector<std::byte>(3 * 4, std::byte{60}));
    chunk("tRNS", std::vector<std::byte>(2, std::byte{9}));
  }
  std::vector<unsigned char> rows(static_cast<std::size_t>(2 * side * (1 + 8 * side)), 0);
  int size = 0;
  unsigned char* const packed = detail::stb::stbi_zlib_compress(rows.data(), static_cast<int>(rows.size()), &size, 8);
  chunk("IDAT", std::as_bytes(std::span<const unsigned char>(packed, static_cast<std::size_t>(size))));
  std::free(packed);
  chunk("IEND", {});
  return file;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::fprintf(stderr, "make_seeds FOLDER\n");
    return 2;
  }
  const fs::path root = arguments[1];
  int written = 0;
  const auto put = [&](const char* target, std::span<const std::byte> bytes) {
    fs::create_directories(root / target);
    testing::put_bytes(root / target / ("seed_" + std::to_string(written++)), bytes);
  };
  const auto put_text = [&](const char* target, const std::string& text) {
    put(target, std::as_bytes(std::span<const char>(text.data(), text.size())));
  };

  ImageBytes image{17, 9, 3, {}};
  for (int i = 0; i < 17 * 9 * 3; ++i) image.pixels.push_back(static_cast<std::uint8_t>(i * 37));
  std::vector<std::byte> jpeg = encode_jpeg(image, 50);
  for (const char* target : {"image", "file_kind"}) {
    put(target, jpeg);
    put(target, encode_png(image));
  }
  for (std::size_t i = 0; i + 1 < jpeg.size(); ++i) {  // a progressive one, of one scan
    if (jpeg[i] != std::byte{0xFF}) continue;
    if (jpeg[i + 1] == std::byte{0xC0}) jpeg[i + 1] = std::byte{0xC2};
    if (jpeg[i + 1] == std::byte{0xDA}) jpeg[i + 12] = std::byte{0};
  }
  put("image", jpeg);
  for (const int type : {0, 2, 3, 4, 6}) {
    for (const int depth : {1, 2, 4, 8, 16}) {
      if ((type == 3 && depth == 16) || (type != 0 && type != 3 && depth < 8)) continue;
      for (const bool interlaced : {false, true}) put("image", png(5, depth, type, interlaced));
    }
  }

  const fs::path file = root / "file";
  Digest256 secret{};
  secret[0] = std::byte{1};
  OwnerKey key = *make_key(secret, "2026-01-31T23:59:59Z", 48, "a note");
  for (const bool payload : {false, true}) {
    if (payload) {
      key.payload = "0123";
      key.corrects = 3;
    }
    fs::remove(file);
    if (!write_key(file, key)) return 1;
    const std::vector<std::byte> bytes = *read_file(file);
    put("file_kind", bytes);
    put_text("owner_key", "\1\2" + std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  }
  const std::string digits(64, 'a');
  put_text("owner_key", "\1\2" + OwnerClaim{key.commitment(), digits, digits, ""}.text());
  // Lengths, choices and the files themselves, so that there is something to change.
  const auto captured = [&](const char* target, const std::string& first, const std::string& second,
                            const std::string& third) {
    std::string text;
    for (const std::string* part : {&first, &second}) {
      text += static_cast<char>(part->size() >> 8);
      text += static_cast<char>(part->size() & 255u);
    }
    put_text(target, text + '\0' + first + second + third);
  };
  const auto text_of = [](std::span<const std::byte> bytes) {
    return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  ImageBytes small{8, 6, 4, std::vector<std::uint8_t>(8 * 6 * 4, 99)};
  const std::string photograph = text_of(encode_png(small));
  small.channels = 1;
  const std::string mask = text_of(encode_png(small));
  captured("capture_images", testing::capture_json, photograph, mask);
  captured("capture_images", testing::capture_json, "", "");
  captured("capture_images", "", photograph, "");
  captured("capture_images", "", "", mask);
  captured("colmap_images", testing::colmap_cameras, testing::colmap_images, testing::colmap_points);
  captured("colmap_images", testing::colmap_cameras, "", "");
  captured("colmap_images", "", testing::colmap_images, "");

  const std::vector<float> numbers{1, 2, 3};
  for (const char* format : {"compmark.model", "compmark decoder", "compmark.checkpoint", "pt"}) {
    SafetensorsWriter writer;
    writer.metadata = {{"format", format}};
    writer.add_values("a", {3}, std::span<const float>(numbers));
    if (!writer.write(file)) return 1;
    put("file_kind", *read_file(file));
    put("safetensors", *read_file(file));
  }
  if (!write_ply(file, 3, std::array{PlyFloatColumn{"x", numbers.data(), 1}})) return 1;
  put("file_kind", *read_file(file));
  put("ply", *read_file(file));
  namespace splats = testing::splats;
  for (const int degree : {0, 1}) {
    const SplatTable table = splats::random_splats(3, degree);
    put("splat", splats::permuted_ply_bytes(table, 1));
    put("splat", splats::compressed_ply_bytes(table, degree == 0));
    for (const int level : {0, 1, 2}) put("splat", splats::ksplat_bytes(table, level));
    for (const int version : {2, 3}) put("splat", splats::gzip_bytes(splats::spz_content(table, version)));
    put("splat", splats::spz_content(table, 3));
#if defined(COMPMARK_WITH_ZSTD)
    put("splat", splats::spz4_bytes(table));
#endif
    for (const char* name : {"seed.sog", "seed.glb"}) {
      const fs::path written = root / name;
      if (!write_splat(written, table).ok()) return 1;
      put("splat", *read_file(written));
      fs::remove(written);
    }
  }
  put("splat", splats::antimatter_bytes(splats::random_splats(3, 0)));
  fs::remove(file);
  put_text(
      "transforms",
      R"({"camera_angle_x":0.8,"frames":[{"file_path":"a.png","transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}]})");
  return 0;
}
