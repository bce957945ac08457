// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/file_kind.hpp"

#include <doctest/doctest.h>
#include <sys/stat.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "compmark/io/bytes.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/io/npy.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/io/ply.hpp"
#include "compmark/io/safetensors.hpp"
#include "support/scene_files.hpp"

namespace {

using namespace compmark;
using namespace std::string_literals;
using testing::put;
using testing::TemporaryFolder;
namespace fs = std::filesystem;

FileKind kind_of(const std::string& text) {
  return identify_bytes(std::as_bytes(std::span<const char>(text.data(), text.size())), text.size());
}

void put_tensors(const fs::path& path, const std::string& format, const std::string& tensor = "a") {
  SafetensorsWriter writer;
  if (!format.empty()) writer.metadata = {{"format", format}, {"info", "{\"format\":\"compmark decoder\"}"}};
  const std::vector<float> values(100, 1.0f);
  writer.add_values(tensor, {100}, std::span<const float>(values));
  REQUIRE(writer.write(path).ok());
}

TEST_CASE("io/file_kind: files of our own writers are told apart") {
  const TemporaryFolder folder;
  const auto at = [&](const char* name) { return folder.path() / name; };
  const std::vector<std::pair<const char*, FileKind>> formats{{"compmark.model", FileKind::model},
                                                              {"compmark decoder", FileKind::decoder},
                                                              {"compmark.checkpoint", FileKind::checkpoint},
                                                              {"compmark decoder training", FileKind::decoder_training},
                                                              {"compmark cover interference", FileKind::interference},
                                                              {"pt", FileKind::safetensors},
                                                              {"", FileKind::safetensors}};
  for (const auto& [format, kind] : formats) {
    put_tensors(at("t"), format);
    CHECK(identify_file(at("t")) == kind);
    CHECK(tensors_kind(*read_safetensors(at("t"))) == kind);
    CHECK(expect_kind(*read_safetensors(at("t")), FileKind::model).ok() ==
          (kind == FileKind::model || kind == FileKind::safetensors));
  }
  put_tensors(at("t"), "", "lin0.weight");
  CHECK(identify_file(at("t")) == FileKind::lpips);
  Digest256 secret{};
  secret[0] = std::byte{1};
  REQUIRE(write_key(at("owner.key"), *make_key(secret, "2026-01-31T23:59:59Z", 48)).ok());
  CHECK(identify_file(at("owner.key")) == FileKind::owner_key);
  testing::put_image(at("a.png"), 4, 3);
  CHECK(identify_file(at("a.png")) == FileKind::png);
  REQUIRE(write_file(at("a.jpg"), encode_jpeg(*read_image(at("a.png")), 90)).ok());
  CHECK(identify_file(at("a.jpg")) == FileKind::jpeg);
  const std::vector<float> x{1, 2};
  REQUIRE(write_ply(at("a.ply"), 2, std::array{PlyFloatColumn{"x", x.data(), 1}}).ok());
  CHECK(identify_file(at("a.ply")) == FileKind::ply);
}

TEST_CASE("io/file_kind: formats of other programs, by their first bytes") {
  const std::vector<std::pair<std::string, FileKind>> files{
      {"\x89"
       "CMK\r\n\x1a\n",
       FileKind::cmk},
      {"GIF89a", FileKind::gif},
      {"RIFF\x10\0\0\0WEBPVP8 "s, FileKind::webp},
      {"RIFF\x10\0\0\0WAVEfmt "s, FileKind::unknown},
      {"MM\0*\0\0"s, FileKind::tiff},
      {"II*\0\0\0"s, FileKind::tiff},
      {"BM\x10\0\0\0\0\0\0\0\x36"s, FileKind::bmp},
      {"BMW of 1972", FileKind::text},
      {"%PDF-1.7", FileKind::pdf},
      {"\0\0\0\x18"
       "ftypheic"s,
       FileKind::heif},
      {"\0\0\0\x18"
       "ftypisom"s,
       FileKind::video},
      {"PK\3\4"s + std::string(26, '\0') + "x.txt", FileKind::zip},
      {"PK\3\4"s + std::string(26, '\0') + "x.npy", FileKind::npz},
      {"\x1f\x8b\x08\0"s, FileKind::gzip},
      {"\x93NUMPY\1\0v\0"s, FileKind::npy},
      {"ply\r\nformat ascii 1.0\r\n", FileKind::ply},
      {"NGSP and so on", FileKind::spz},
      {"plywood is a text", FileKind::text},
      {"\x80\2}q\0"s, FileKind::pickle},
      {"", FileKind::empty},
      {std::string(1000, '\0'), FileKind::unknown},
      {" \n", FileKind::text},
      {"<!DOCTYPE html><html>", FileKind::html},
      {"{\"a\": 1}", FileKind::json},
      {"\xEF\xBB\xBF\n [1, 2]", FileKind::json},
      {"[section]\nkey = 1", FileKind::text},
      {"{not json}", FileKind::text},
      {"{\"frames\": [{\"file_path\": \"a\"}]}", FileKind::capture},
      {"{\"schema\": \"compmark.fit.1\"}", FileKind::report},
      {"{\"schema\": 1, \"recipe\": \"hac\"}", FileKind::report},
      {"{\"iteration\":1,\"total\":2}\n{", FileKind::log},
      {"{\"format\": \"compmark-key\"}", FileKind::owner_key},
      {"{\"note\": \"\\\"format\\\": \\\"compmark-key\\\"\"}", FileKind::json},  // a quote within a text says nothing
      {"gr\xC3\xBC\xC3\x9F"
       "e",
       FileKind::text}};
  for (const auto& file : files) {
    CAPTURE(file.first);
    CHECK(file_kind_name(kind_of(file.first)) == file_kind_name(file.second));
    // A file that was cut short is looked at no further than it goes.
    for (std::size_t n = 0; n < file.first.size(); ++n)
      CHECK(!file_kind_name(kind_of(file.first.substr(0, n))).empty());
  }
}

TEST_CASE("io/file_kind: a COLMAP model's cameras and images; what only their name tells") {
  ByteWriter cameras, images;
  cameras.put(std::uint64_t{1})
      .put(std::uint32_t{1})
      .put(std::int32_t{1})
      .put(std::uint64_t{640})
      .put(std::uint64_t{480});
  for (int i = 0; i < 8; ++i) cameras.put(500.0);
  images.put(std::uint64_t{1}).put(std::uint32_t{1}).put(0.5).put(-0.5).put(0.5).put(0.5).put(1.0).put(2.0).put(3.0);
  images.put(std::uint32_t{1}).put(std::string_view("a.png")).put(std::uint8_t{0}).put(std::uint64_t{0});
  CHECK(identify_bytes(cameras.bytes(), cameras.size()) == FileKind::colmap);
  CHECK(identify_bytes(images.bytes(), images.size()) == FileKind::colmap);
  const TemporaryFolder folder;
  put(folder.path() / "a.SPZ", "\x1f\x8b\x08\0"s);
  put(folder.path() / "a.splat", std::string(64, '\1'));
  put(folder.path() / "a.csv", "a,b\n");
  CHECK(identify_file(folder.path() / "a.SPZ") == FileKind::spz);
  CHECK(identify_file(folder.path() / "a.splat") == FileKind::splat);
  CHECK(identify_file(folder.path() / "a.csv") == FileKind::csv);
  CHECK(identify_file(folder.path()) == FileKind::folder);
  CHECK(identify_file(folder.path() / "none") == FileKind::unreadable);
  CHECK(identify_file("/dev/null") == FileKind::stream);
  REQUIRE(::mkfifo((folder.path() / "pipe").c_str(), 0600) == 0);
  CHECK(identify_file(folder.path() / "pipe") == FileKind::stream);  // and it does not hang
}

TEST_CASE("io/file_kind: every kind has a name of its own, and random bytes have no kind") {
  std::set<std::string_view> names;
  const int kinds = static_cast<int>(FileKind::program) + 1;
  for (int k = 0; k < kinds; ++k) names.insert(file_kind_name(static_cast<FileKind>(k)));
  CHECK(names.size() == static_cast<std::size_t>(kinds));
  std::mt19937 random(1);
  int named = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string text(1 + random() % 300, '\0');
    for (char& c : text) c = static_cast<char>(random());
    named += text.size() > 20 && tells_kind(kind_of(text)) ? 1 : 0;
  }
  CHECK(named <= 2);
}

TEST_CASE(
    "io/file_kind: each reader names a file that was given for another, and reads no more of it than its beginning") {
  const TemporaryFolder folder;
  const auto at = [&](const char* name) { return folder.path() / name; };
  put(at("ply"), "ply\nformat ascii 1.0\n");
  put(at("json"), "{\"frames\": []}");
  put_tensors(at("model"), "compmark.model");
  testing::put_image(at("png"), 4, 3);
  const auto says = [](const Error& error, const char* kind, const char* expected) {
    CAPTURE(error.line());
    CHECK(error.problem.find("is "s + kind) != std::string::npos);
    CHECK(error.problem.find("not "s + expected) != std::string::npos);
    CHECK(!error.remedy.empty());
  };
  says(read_safetensors(at("ply")).error(), "a PLY file", "a safetensors file");
  says(read_safetensors(at("json"), FileKind::model).error(), "a JSON file", "a model");
  says(read_safetensors(at("png")).error(), "a PNG image", "a safetensors file");
  says(read_key(at("model")).error(), "a model", "an owner's key");
  says(read_key(at("json")).error(), "a JSON file of cameras", "an owner's key");
  says(read_json(at("png")).error(), "a PNG image", "a JSON file");
  says(read_ply(at("png")).error(), "a PNG image", "a PLY file");
  says(read_npy(at("ply")).error(), "a PLY file", "a NumPy array");
  says(read_image(at("ply")).error(), "a PLY file", "a PNG or JPEG image");
  says(read_image_info(at("model")).error(), "a model", "a PNG or JPEG image");
  says(read_safetensors(at("model"), FileKind::decoder).error(), "a model", "a message decoder");
  CHECK(read_safetensors(at("model"), FileKind::model).ok());
  put(at("zeros"), "");
  fs::resize_file(at("zeros"), std::uintmax_t{1} << 39);  // a hole that no memory holds
  for (const Error& error :
       {read_safetensors(at("zeros")).error(), read_ply(at("zeros")).error(), read_key(at("zeros")).error()}) {
    CHECK(error.kind == ErrorKind::malformed);
    CHECK(!error.remedy.empty());
  }
  fs::resize_file(at("zeros"), std::uintmax_t{300} << 20);
  const std::size_t before = testing::peak_memory();
  for (const Error& error : {read_image(at("zeros")).error(), read_image_info(at("zeros")).error(),
                             read_npy(at("zeros")).error(), read_json(at("zeros")).error()}) {
    CHECK(error.kind == ErrorKind::malformed);
    CHECK(!error.remedy.empty());
  }
  CHECK(testing::peak_memory() < before + (std::size_t{16} << 20));
}

}  // namespace
