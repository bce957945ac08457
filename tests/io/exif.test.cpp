// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The file format byte by byte (Exif 2.32, TIFF 6.0, JPEG's segments). Whole photographs with an orientation are in
// tests/scene/turn.test.cpp.
#include "compmark/io/exif.hpp"

#include <doctest/doctest.h>

#include <string>

using namespace compmark;

namespace {

std::string number(unsigned value, int bytes, bool little) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> 8 * (little ? i : bytes - 1 - i) & 255);
  return text;
}
/// One directory entry: tag, type, count 1, value in the first two bytes of its field.
std::string entry(unsigned tag, unsigned type, unsigned value, bool little) {
  return number(tag, 2, little) + number(type, 2, little) + number(1, 4, little) + number(value, 2, little) +
         std::string(2, '\0');
}
/// A TIFF block whose directory begins at `directory`.
std::string tiff(const std::string& entries, bool little, unsigned directory = 8, int count = -1) {
  const unsigned n = count >= 0 ? static_cast<unsigned>(count) : static_cast<unsigned>(entries.size() / 12);
  return (little ? "II" : "MM") + number(42, 2, little) + number(directory, 4, little) +
         std::string(directory - 8, 'x') + number(n, 2, little) + entries;
}
std::string segment(char marker, const std::string& body) {
  return std::string("\xFF") + marker + number(static_cast<unsigned>(body.size() + 2), 2, false) + body;
}
std::string exif(const std::string& block) { return segment('\xE1', std::string("Exif\0\0", 6) + block); }
const std::string jpeg_start = "\xFF\xD8";
const std::string picture = segment('\xDA', "scan");

int orientation(const std::string& file) {
  return jpeg_orientation(std::as_bytes(std::span<const char>(file.data(), file.size())));
}

}  // namespace

TEST_CASE("io/exif: the tag is found behind other tags, other segments, a far directory and fill bytes") {
  for (const bool little : {true, false}) {
    CAPTURE(little);
    const std::string make = entry(0x010F, 2, 3, little), turned = entry(0x0112, 3, 8, little);
    CHECK(orientation(jpeg_start + exif(tiff(turned, little)) + picture) == 8);
    CHECK(orientation(jpeg_start + exif(tiff(make + entry(0x011A, 5, 1, little) + turned, little)) + picture) == 8);
    CHECK(orientation(jpeg_start + exif(tiff(turned, little, 1000)) + picture) == 8);
    // JFIF first, then an XMP packet under the same marker, then a comment; any number of fill bytes before a marker.
    CHECK(orientation(jpeg_start + segment('\xE0', "JFIF") + segment('\xE1', "http://ns.adobe.com/xap/1.0/") +
                      segment('\xFE', "") + "\xFF\xFF\xFF" + exif(tiff(turned, little)) + picture) == 8);
    // Segments are skipped by their length: what looks like Exif inside another one is not.
    CHECK(orientation(jpeg_start + segment('\xFE', exif(tiff(turned, little))) + picture) == 1);
    // The bytes of the wrong order are another tag.
    CHECK(orientation(jpeg_start + exif(tiff(entry(0x0112, 3, 8, !little), little)) + picture) == 1);
  }
}

TEST_CASE("io/exif: what the standard does not allow is no orientation") {
  for (const bool little : {true, false}) {
    CAPTURE(little);
    const auto with = [&](unsigned type, unsigned value) {
      return orientation(jpeg_start + exif(tiff(entry(0x0112, type, value, little), little)) + picture);
    };
    CHECK(with(3, 6) == 6);
    for (const unsigned value : {0u, 9u, 255u, 256u, 0x0600u, 65535u}) CHECK(with(3, value) == 1);
    for (const unsigned type : {0u, 1u, 2u, 4u, 9u, 0x0300u}) CHECK(with(type, 6) == 1);
    const std::string turned = entry(0x0112, 3, 6, little);
    // The first of two tags counts, so that a reader of the whole directory and this one agree on files that have one.
    CHECK(orientation(jpeg_start + exif(tiff(turned + entry(0x0112, 3, 3, little), little)) + picture) == 6);
    // A directory that promises 65,535 entries is read as far as the block goes, one that promises none is not read.
    CHECK(orientation(jpeg_start + exif(tiff(entry(0x010F, 2, 1, little) + turned, little, 8, 65535)) + picture) == 6);
    CHECK(orientation(jpeg_start + exif(tiff(entry(0x010F, 2, 1, little), little, 8, 65535)) + picture) == 1);
    CHECK(orientation(jpeg_start + exif(tiff(turned, little, 8, 0)) + picture) == 1);
    // Directories before the header's end, at the end, behind it, and as far as 32 bits reach.
    for (const unsigned place : {0u, 7u, 22u, 23u, 0x7FFFFFFFu, 0xFFFFFFFFu}) {
      std::string block = tiff(turned, little);
      block.replace(4, 4, number(place, 4, little));
      CHECK(orientation(jpeg_start + exif(block) + picture) == 1);
    }
  }
  CHECK(orientation(jpeg_start + exif("XX*") + picture) == 1);
  CHECK(orientation(jpeg_start + exif("II*\0\x08\0\0") + picture) == 1);
}

TEST_CASE("io/exif: the picture ends the search, and a segment longer than the file is not entered") {
  const std::string block = exif(tiff(entry(0x0112, 3, 6, true), true));
  CHECK(orientation(jpeg_start + block) == 6);            // nothing follows: the block itself is whole
  CHECK(orientation(jpeg_start + picture + block) == 1);  // behind the beginning of the scan there are no segments
  CHECK(orientation(block + picture) == 1);               // no JPEG
  CHECK(orientation("") == 1);
  std::string longer = jpeg_start + block;
  longer[4] = '\x7F';  // the segment's length
  CHECK(orientation(longer + picture) == 1);
  for (const char low : {'\0', '\x01'}) {  // a length that does not hold itself would never end
    std::string shorter = jpeg_start + block;
    shorter[4] = '\0';
    shorter[5] = low;
    CHECK(orientation(shorter) == 1);
  }
  for (std::size_t cut = 0; cut < (jpeg_start + block).size(); ++cut)
    CHECK(orientation((jpeg_start + block).substr(0, cut)) == 1);
}
