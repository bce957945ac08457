// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message decoder of any kind, chosen by its file, in one type that satisfies MessageDecoder. The tool holds one for
// --decoder FILE. The kinds are a list (decoder_formats.hpp), which a program may lengthen by its own:
//   StoredDecoder<float, DirectConvolution, ShippedDecoders<float, DirectConvolution>::With<MyFormat>>
// Cost: one branch a call. A program that knows its decoder names the type instead and has its sizes checked.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>

#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/decoder/decoder_formats.hpp"

namespace compmark {

namespace detail {
/// A decoder and its scratch by their format: two formats may have decoders or scratch of one type.
template <class Format>
struct DecoderOf {
  typename Format::Decoder decoder;
};
template <class Format>
struct DecoderScratch {
  typename Format::Decoder::Context scratch;
};
}  // namespace detail

template <class T = float, template <class> class Kernel = DirectConvolution,
          class Formats = ShippedDecoders<T, Kernel>>
class StoredDecoder;

template <class T, template <class> class Kernel, class... Formats>
class StoredDecoder<T, Kernel, DecoderFormats<Formats...>> {
 public:
  static constexpr bool is_absent = false;
  using Scalar = T;
  /// One for each kind; those that are not used are empty.
  struct Context : detail::DecoderScratch<Formats>... {};

  StoredDecoder() = default;
  /// `key` is needed by a carrier file, and by no other of the shipped kinds. A file that names no kind is read as the
  /// first of the list. Error: that of the kind, or that the list has none of this name.
  template <class TensorFile>
  [[nodiscard]] static Result<StoredDecoder> read(const TensorFile& file, const std::optional<DecoderKey>& key = {}) {
    static_assert((DecoderFormat<Formats, TensorFile> && ...),
                  "StoredDecoder: a format of the list lacks Decoder, kind or read (see "
                  "watermark/decoder/decoder_formats.hpp)");
    const auto named = file.metadata.find("kind");
    const bool names_one = named != file.metadata.end();
    std::optional<Result<StoredDecoder>> read;
    bool first = true;
    const auto try_format = [&]<class Format>(detail::DecoderOf<Format>*) {
      const bool wanted = names_one ? named->second == Format::kind : first;
      first = false;
      if (!wanted || read) return;
      Result<typename Format::Decoder> decoder = Format::read(file, key);
      if (decoder) {
        read.emplace(StoredDecoder(detail::DecoderOf<Format>{std::move(*decoder)}));
      } else {
        read.emplace(decoder.error());
      }
    };
    (try_format(static_cast<detail::DecoderOf<Formats>*>(nullptr)), ...);
    if (read) return std::move(*read);
    std::string known;
    ((known += (known.empty() ? "" : ", ") + std::string(Formats::kind)), ...);
    return Error{ErrorKind::unsupported, file.path, "__metadata__.kind",
                 "\"" + named->second.substr(0, 40) + "\" is none of " + known,
                 "check that this is a decoder file, or use a newer program"};
  }

  [[nodiscard]] int bits() const {
    return visit([](const auto& held) { return held.decoder.bits(); });
  }
  [[nodiscard]] int minimum_size() const {
    return visit([](const auto& held) { return held.decoder.minimum_size(); });
  }
  /// What the file asks a message loss to multiply logits by.
  [[nodiscard]] double logit_scale() const {
    return visit([](const auto& held) -> double {
      if constexpr (requires { held.decoder.logit_scale(); }) {
        return held.decoder.logit_scale();
      } else {
        return 1;
      }
    });
  }

  template <Executor E>
  void forward(ImageView<const T> image, std::span<T> logits, Context& context, E& executor) const {
    visit([&]<class Format>(const detail::DecoderOf<Format>& held) {
      held.decoder.forward(image, logits, static_cast<detail::DecoderScratch<Format>&>(context).scratch, executor);
    });
  }
  template <Executor E>
  void backward(std::span<const T> d_logits, ImageView<T> d_image, Context& context, E& executor) const {
    visit([&]<class Format>(const detail::DecoderOf<Format>& held) {
      held.decoder.backward(d_logits, d_image, static_cast<detail::DecoderScratch<Format>&>(context).scratch, executor);
    });
  }

 private:
  // Built in place: assigning to a variant makes g++ 12 at -O3 warn about its other alternatives.
  template <class Format>
  explicit StoredDecoder(detail::DecoderOf<Format> held)
      : held_(std::in_place_type<detail::DecoderOf<Format>>, std::move(held)) {}

  template <class Visit>
  decltype(auto) visit(const Visit& visitor) const {
    return std::visit(visitor, held_);
  }

  std::variant<detail::DecoderOf<Formats>...> held_;
};

}  // namespace compmark
