// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The kinds of files that people have around captures and splats: what they are called, and which command takes them.
#pragma once

#include <string_view>

namespace compmark {

enum class FileKind {
  unknown,
  unreadable,  ///< not there, or it cannot be opened
  folder,
  stream,  ///< a device, a pipe or a socket
  empty,
  text,
  html,
  csv,
  json,
  capture,  ///< cameras of a capture: transforms*.json
  report,   ///< figures that a command of ours wrote as JSON
  log,      ///< JSON lines of a training
  owner_key,
  safetensors,  ///< of another program
  model,
  decoder,
  checkpoint,
  decoder_training,  ///< checkpoint of a decoder's training
  interference,      ///< what an unmarked scene says to a decoder
  lpips,             ///< weights of LPIPS
  cmk,               ///< a compressed model
  ply,
  splat,  ///< .splat, .ksplat
  spz,
  sog,
  glb,     ///< binary glTF
  colmap,  ///< a binary file of a COLMAP model
  png,
  jpeg,
  gif,
  webp,
  tiff,
  bmp,
  heif,  ///< HEIC, AVIF
  exr,
  pdf,
  video,
  npy,
  npz,
  zip,
  gzip,
  zstd,
  hdf5,
  pickle,  ///< of Python: weights of PyTorch before its zip format
  program,
};

/// How people call it, with its article: "a PLY file".
[[nodiscard]] inline std::string_view file_kind_name(FileKind kind) {
  switch (kind) {
    case FileKind::unknown:
      return "a file of an unknown kind";
    case FileKind::unreadable:
      return "a file that cannot be read";
    case FileKind::folder:
      return "a folder";
    case FileKind::stream:
      return "a pipe or a device";
    case FileKind::empty:
      return "an empty file";
    case FileKind::text:
      return "a text file";
    case FileKind::html:
      return "an HTML page";
    case FileKind::csv:
      return "a CSV table";
    case FileKind::json:
      return "a JSON file";
    case FileKind::capture:
      return "a JSON file of cameras (transforms)";
    case FileKind::report:
      return "a JSON report";
    case FileKind::log:
      return "a training's log (JSON lines)";
    case FileKind::owner_key:
      return "an owner's key (JSON)";
    case FileKind::safetensors:
      return "a safetensors file of another program";
    case FileKind::model:
      return "a model (safetensors)";
    case FileKind::decoder:
      return "a message decoder (safetensors)";
    case FileKind::checkpoint:
      return "a training's checkpoint (safetensors)";
    case FileKind::decoder_training:
      return "a checkpoint of a decoder's training (safetensors)";
    case FileKind::interference:
      return "the cover interference of a scene (safetensors)";
    case FileKind::lpips:
      return "LPIPS weights (safetensors)";
    case FileKind::cmk:
      return "a compressed model (.cmk)";
    case FileKind::ply:
      return "a PLY file";
    case FileKind::splat:
      return "a file of splats";
    case FileKind::spz:
      return "an SPZ file (splats)";
    case FileKind::sog:
      return "a SOG file (splats)";
    case FileKind::glb:
      return "a binary glTF file (.glb)";
    case FileKind::colmap:
      return "a binary file of a COLMAP model";
    case FileKind::png:
      return "a PNG image";
    case FileKind::jpeg:
      return "a JPEG image";
    case FileKind::gif:
      return "a GIF image";
    case FileKind::webp:
      return "a WebP image";
    case FileKind::tiff:
      return "a TIFF image";
    case FileKind::bmp:
      return "a BMP image";
    case FileKind::heif:
      return "a HEIF image";
    case FileKind::exr:
      return "an OpenEXR image";
    case FileKind::pdf:
      return "a PDF document";
    case FileKind::video:
      return "a video";
    case FileKind::npy:
      return "a NumPy array (.npy)";
    case FileKind::npz:
      return "NumPy arrays (.npz)";
    case FileKind::zip:
      return "a ZIP archive";
    case FileKind::gzip:
      return "a gzip file";
    case FileKind::zstd:
      return "a Zstandard file";
    case FileKind::hdf5:
      return "an HDF5 file";
    case FileKind::pickle:
      return "a pickle of Python";
    case FileKind::program:
      return "a program";
  }
  return "a file of an unknown kind";
}

/// Which command of the tool takes such a file, as a remedy: "verify and extract --decoder take it"; empty where none
/// does.
[[nodiscard]] inline std::string_view file_kind_use(FileKind kind) {
  switch (kind) {
    case FileKind::model:
      return "render, evaluate, export, embed and compress --model take it";
    case FileKind::cmk:
      return "render, evaluate, export and decompress --model take it";
    case FileKind::decoder:
      return "verify, extract and embed --decoder take it";
    case FileKind::owner_key:
      return "verify, extract and embed --key take it";
    case FileKind::capture:
      return "train --data takes its folder";
    case FileKind::colmap:
      return "train --data takes the folder of the COLMAP model and its images";
    case FileKind::png:
    case FileKind::jpeg:
      return "verify and extract --images take it, train --data takes a folder of a capture";
    case FileKind::checkpoint:
      return "train and embed --resume with the folder of the run take it";
    case FileKind::decoder_training:
      return "pretrain --resume takes it";
    case FileKind::interference:
      return "verify and extract --interference take it";
    case FileKind::lpips:
      return "evaluate takes it (--lpips-alex, --lpips-squeeze)";
    case FileKind::gif:
    case FileKind::webp:
    case FileKind::tiff:
    case FileKind::bmp:
    case FileKind::heif:
    case FileKind::exr:
      return "convert it to PNG or JPEG";
    case FileKind::zip:
    case FileKind::gzip:
    case FileKind::zstd:
      return "unpack it first";
    case FileKind::ply:
    case FileKind::splat:
    case FileKind::spz:
    case FileKind::sog:
    case FileKind::glb:
      return "info, render, evaluate, export, verify, embed and spread --model take it; to compress it, make a model "
             "of "
             "it first: compmark adopt --splat FILE --codec hac";
    default:
      return "";
  }
}

}  // namespace compmark
