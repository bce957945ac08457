// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A list of edits, of which each is drawn or not for a picture, in the order of the list. EditedDecoder puts one before
// any message decoder: a mark that is learned with it is read from edited renders (docs/watermark.md), and a decoder
// without it has no such code. An empty list changes nothing and costs nothing.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/edit/augmentation_edit.hpp"
#include "compmark/watermark/edit/concept.hpp"
#include "compmark/watermark/edit/tone_edit.hpp"

namespace compmark {

template <PictureEdit... Edits>
struct EditChain {
  static constexpr std::size_t count = sizeof...(Edits);
  struct Settings {
    std::tuple<typename Edits::Settings...> edits;
    double none = 0.15;   ///< share of pictures that are not edited at all
    double share = 0.35;  ///< of the others, how often each edit is drawn
  };
  template <class T>
  struct Context {
    std::tuple<typename Edits::template Context<T>...> edits;
    std::tuple<typename Edits::Draw...> draws;
    std::array<bool, count> drawn{};
    std::array<ImageView<const T>, count + 1> images{};  ///< before each edit, and the last
    std::array<Buffer<T>, count> gradients;              ///< behind each edit
  };

  /// Draws which edits there are, and what of each. Takes 1 + 17 count random numbers.
  template <class T>
  static void draw(const Settings& settings, const Random& random, Context<T>& context) {
    const bool any = random.uniform(0) >= settings.none;
    for_each([&](auto index) {
      constexpr std::size_t i = index;
      using Edit = std::tuple_element_t<i, std::tuple<Edits...>>;
      const std::uint64_t first = 1 + i * (random_numbers_of_an_edit + 1);
      context.drawn[i] = any && random.uniform(first) < settings.share;
      if (context.drawn[i]) std::get<i>(context.draws) = Edit::draw(std::get<i>(settings.edits), random, first + 1);
    });
  }
  /// No edit until the next draw.
  template <class T>
  static void leave_out(Context<T>& context) {
    context.drawn = {};
  }

  /// The edited image; it lives until the next forward of the context.
  template <class T, Executor E>
  [[nodiscard]] static ImageView<const T> forward(ImageView<const T> image, Context<T>& context, E& executor) {
    context.images[0] = image;
    for_each([&](auto index) {
      constexpr std::size_t i = index;
      using Edit = std::tuple_element_t<i, std::tuple<Edits...>>;
      context.images[i + 1] = context.images[i];
      if (context.drawn[i])
        context.images[i + 1] =
            Edit::forward(context.images[i], std::get<i>(context.draws), std::get<i>(context.edits), executor);
    });
    return context.images[count];
  }
  /// Where the gradient behind the chain is to be added: d_image itself, if nothing was drawn. It is zero else.
  template <class T>
  [[nodiscard]] static ImageView<T> gradient(ImageView<T> d_image, Context<T>& context) {
    for (std::size_t i = count; i-- > 0;) {
      if (context.drawn[i]) return cleared(context, i);
    }
    return d_image;
  }
  /// ADDS the gradient, carried back through the chain, to d_image.
  template <class T, Executor E>
  static void backward(ImageView<T> d_image, Context<T>& context, E& executor) {
    std::size_t at = count;  // the last edit whose gradient is known
    while (at > 0 && !context.drawn[at - 1]) --at;
    while (at > 0) {
      std::size_t before = at - 1;  // the one before it
      while (before > 0 && !context.drawn[before - 1]) --before;
      const ImageView<T> target = before == 0 ? d_image : cleared(context, before - 1);
      for_each([&](auto index) {
        constexpr std::size_t i = index;
        using Edit = std::tuple_element_t<i, std::tuple<Edits...>>;
        if (i + 1 != at) return;
        Edit::backward(behind(context, i), std::get<i>(context.draws), target, std::get<i>(context.edits), executor);
      });
      at = before;
    }
  }

 private:
  template <class Call>
  static void for_each(Call&& call) {
    [&]<std::size_t... I>(std::index_sequence<I...>) { (call(std::integral_constant<std::size_t, I>{}), ...); }
    (std::make_index_sequence<count>{});
  }
  template <class T>
  [[nodiscard]] static ImageView<const T> behind(Context<T>& context, std::size_t i) {
    const ImageView<const T>& image = context.images[i + 1];
    return {context.gradients[i].data(), image.channels, image.height, image.width};
  }
  template <class T>
  [[nodiscard]] static ImageView<T> cleared(Context<T>& context, std::size_t i) {
    const ImageView<const T>& image = context.images[i + 1];
    context.gradients[i].resize(image.size());
    std::fill_n(context.gradients[i].data(), image.size(), T(0));
    return {context.gradients[i].data(), image.channels, image.height, image.width};
  }
};

/// What happens to pictures most often: they are resized, turned and cropped, their colours are changed, they become
/// softer or noisy, and are saved as JPEG.
using CommonEdits = EditChain<RotationEdit, CropEdit, ResizeEdit, ToneEdit, BlurEdit, NoiseEdit, JpegEdit>;

/// A message decoder that sees edited pictures where the caller draws them (draw_edits), and the picture itself where
/// not. It is frozen as any decoder; its files are those of `Decoder`.
template <class Decoder, class Edits>
class EditedDecoder {
 public:
  static constexpr bool is_absent = false;
  using Scalar = typename Decoder::Scalar;
  struct Context {
    typename Decoder::Context decoder;
    typename Edits::template Context<Scalar> edits;
  };

  EditedDecoder() = default;
  EditedDecoder(Decoder decoder, typename Edits::Settings settings)  // NOLINT(google-explicit-constructor)
      : decoder_(std::move(decoder)),
        settings_(std::move(settings)) {}

  [[nodiscard]] int bits() const { return decoder_.bits(); }
  [[nodiscard]] int minimum_size() const { return decoder_.minimum_size(); }
  [[nodiscard]] const Decoder& decoder() const { return decoder_; }

  /// The edits of the next passes of this context, drawn from a stream; without one the picture is not edited.
  void draw_edits(Context& context, const Random* random) const {
    if (random != nullptr) {
      Edits::draw(settings_, *random, context.edits);
    } else {
      Edits::leave_out(context.edits);
    }
  }
  template <Executor E>
  void forward(ImageView<const Scalar> image, std::span<Scalar> logits, Context& context, E& executor) const {
    const ImageView<const Scalar> edited = Edits::forward(image, context.edits, executor);
    const bool small = std::min(edited.height, edited.width) < decoder_.minimum_size();
    if (small) Edits::leave_out(context.edits);  // nothing can be read of it
    decoder_.forward(small ? image : edited, logits, context.decoder, executor);
  }
  template <Executor E>
  void backward(std::span<const Scalar> d_logits, ImageView<Scalar> d_image, Context& context, E& executor) const {
    decoder_.backward(d_logits, Edits::gradient(d_image, context.edits), context.decoder, executor);
    Edits::backward(d_image, context.edits, executor);
  }

 private:
  Decoder decoder_;
  typename Edits::Settings settings_;
};

}  // namespace compmark
