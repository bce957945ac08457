// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The codecs of `.cmk` files, an open list: ShippedCodecs at the end is the one place that knows them all. cmk.hpp
// writes and reads by it, inspect.hpp describes by it.
//
//   Codec                                        meaning                                                       cost
//   C::profile, C::name, C::sections             its number in the header, what recipes begin with, and the    -
//                                                CodecSections of its files
//   C::codes(model)                              whether a CodecModel is one of its own                        O(1)
//   C::encode(model, settings, executor)         Result<CodecEncoded>, with the model that decoding gives      a pass
//   C::decode(bytes, path, settings, executor)   Result<CodecDecoded>; refuses files of other codecs           a pass
//
// Laws: K1 decode(encode(m)) is the model that encode returned, and encoding that again gives the same bytes; K2 the
// same bytes at any thread count; K3 a file with one changed bit is refused, or salvaged where the settings ask for it.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "compmark/codec/container/decoding.hpp"
#include "compmark/codec/container/encoding.hpp"
#include "compmark/codec/context_gs/context_gs_decoder.hpp"
#include "compmark/codec/context_gs/context_gs_encoder.hpp"
#include "compmark/codec/hac/hac_decoder.hpp"
#include "compmark/codec/hac/hac_encoder.hpp"
#include "compmark/codec/hac_plus/hac_plus_decoder.hpp"
#include "compmark/codec/hac_plus/hac_plus_encoder.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

template <class C>
concept Codec = requires(const CodecModel& model, const CodecEncodeSettings& encoding,
                         const CodecDecodeSettings& decoding, std::span<const std::byte> bytes, const std::string& path,
                         SerialExecutor& executor) {
  { C::profile } -> std::convertible_to<ContainerProfile>;
  { C::name } -> std::convertible_to<const char*>;
  { C::sections } -> std::convertible_to<const CodecSections&>;
  { C::codes(model) } -> std::convertible_to<bool>;
  { C::encode(model, encoding, executor) } -> std::same_as<Result<CodecEncoded>>;
  { C::decode(bytes, path, decoding, executor) } -> std::same_as<Result<CodecDecoded>>;
};

struct HacCodec {
  static constexpr ContainerProfile profile = ContainerProfile::hac;
  static constexpr const char* name = "hac";
  static constexpr const CodecSections& sections = HacFormat::sections;
  [[nodiscard]] static bool codes(const CodecModel& model) { return !model.intra && (model.trained || model.context); }
  template <Executor E>
  [[nodiscard]] static Result<CodecEncoded> encode(const CodecModel& model, const CodecEncodeSettings& settings,
                                                   E& executor) {
    return encode_hac(model, settings, executor);
  }
  template <Executor E>
  [[nodiscard]] static Result<CodecDecoded> decode(std::span<const std::byte> bytes, const std::string& path,
                                                   const CodecDecodeSettings& settings, E& executor) {
    return decode_hac(bytes, path, settings, executor);
  }
};

struct ContextGsCodec {
  static constexpr ContainerProfile profile = ContainerProfile::context_gs;
  static constexpr const char* name = "context_gs";
  static constexpr const CodecSections& sections = ContextGsFormat::sections;
  [[nodiscard]] static bool codes(const CodecModel& model) {
    return !model.intra && (model.trained_gs || model.context_gs);
  }
  template <Executor E>
  [[nodiscard]] static Result<CodecEncoded> encode(const CodecModel& model, const CodecEncodeSettings& settings,
                                                   E& executor) {
    return encode_context_gs(model, settings, executor);
  }
  template <Executor E>
  [[nodiscard]] static Result<CodecDecoded> decode(std::span<const std::byte> bytes, const std::string& path,
                                                   const CodecDecodeSettings& settings, E& executor) {
    return decode_context_gs(bytes, path, settings, executor);
  }
};

struct HacPlusCodec {
  static constexpr ContainerProfile profile = ContainerProfile::hac_plus;
  static constexpr const char* name = "hac_plus";
  static constexpr const CodecSections& sections = HacPlusFormat::sections;
  [[nodiscard]] static bool codes(const CodecModel& model) { return model.intra.has_value(); }
  template <Executor E>
  [[nodiscard]] static Result<CodecEncoded> encode(const CodecModel& model, const CodecEncodeSettings& settings,
                                                   E& executor) {
    return encode_hac_plus(model, settings, executor);
  }
  template <Executor E>
  [[nodiscard]] static Result<CodecDecoded> decode(std::span<const std::byte> bytes, const std::string& path,
                                                   const CodecDecodeSettings& settings, E& executor) {
    return decode_hac_plus(bytes, path, settings, executor);
  }
};

/// What no codec of a list claims goes to its first, whose errors say what is wrong with it.
template <Codec First, Codec... Rest>
struct CodecList {
  template <class Added>
  using With = CodecList<First, Rest..., Added>;

  /// In the order of the list.
  [[nodiscard]] static constexpr std::array<const char*, 1 + sizeof...(Rest)> names() {
    return {First::name, Rest::name...};
  }

  /// use.template operator()<C>() of the codec whose files have this number in their header.
  template <class Use>
  [[nodiscard]] static auto of_profile(ContainerProfile profile, const Use& use) {
    return choose([&]<class C>() { return C::profile == profile; }, use);
  }
  /// … of the codec that writes this model.
  template <class Use>
  [[nodiscard]] static auto of_model(const CodecModel& model, const Use& use) {
    return choose([&]<class C>() { return C::codes(model); }, use);
  }

 private:
  template <class Wanted, class Use>
  [[nodiscard]] static auto choose(const Wanted& wanted, const Use& use) {
    std::optional<decltype(use.template operator()<First>())> chosen;
    const auto look = [&]<class C>() {
      if (!chosen && wanted.template operator()<C>()) chosen.emplace(use.template operator()<C>());
    };
    look.template operator()<First>();
    (look.template operator()<Rest>(), ...);
    if (!chosen) chosen.emplace(use.template operator()<First>());
    return std::move(*chosen);
  }
};

/// All codecs that CompMark writes and reads.
using ShippedCodecs = CodecList<HacCodec, ContextGsCodec, HacPlusCodec>;

}  // namespace compmark
