// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on a mark, as open lists: on a picture that was rendered, and on a model. An attack is a type without
// members; picture_attacks.hpp and model_attacks.hpp hold those that are shipped, each with its list at the end.
//
//   expression                            meaning                                                            cost
//   A::name                               what a user calls it                                               -
//   A::amount                             an AttackAmount: usual, least and greatest strength, and its unit  -
//   A::apply(image, amount, seed)         PictureAttack: the AttackedPicture of an RGB image in [0, 1]       a pass
//   A::apply(arena, amount, seed)         ModelAttack: changes a model's numbers in place; Result<Done>      a pass
//   A::apply(arena, amount, seed, e)      RenderedAttack: the same, by the AnchorEvidence of its renders     a pass
//
// Laws (tests/watermark/attack): T1 the same seed gives the same bits; T2 pixels stay in [0, 1] and finite; T3 a model
// stays finite, and blocks that no render reads keep their values.
#pragma once

#include <charconv>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/number_text.hpp"

namespace compmark {

/// How strong an attack is, and may be.
struct AttackAmount {
  double usual = 0, least = 0, most = 0;
  std::string_view meaning;
  double step =
      0;  ///< strengths are `least` and whole steps above it; 0: any number. What is reported is what is done.
};

/// An image of its own size: a crop is smaller.
struct AttackedPicture {
  int height = 0, width = 0;
  std::vector<float> planes;  ///< [3, height, width]

  [[nodiscard]] ImageView<const float> view() const { return {planes.data(), 3, height, width}; }
};

template <class A>
concept Attack = requires {
  { A::name } -> std::convertible_to<std::string_view>;
  { A::amount } -> std::convertible_to<AttackAmount>;
};
template <class A>
concept PictureAttack = Attack<A> && requires(ImageView<const float> image) {
  { A::apply(image, double{}, std::uint64_t{}) } -> std::same_as<AttackedPicture>;
};
template <class A>
concept ModelAttack = Attack<A> && requires(ParameterArena<float>& arena) {
  { A::apply(arena, double{}, std::uint64_t{}) } -> std::same_as<Result<Done>>;
};

/// What renders say of each anchor, for attacks that ask (app/model_attack.hpp gathers it).
struct AnchorEvidence {
  std::vector<double> significance;  ///< [anchors] LightGaussian's, at least 0
  std::vector<double> opacity;       ///< [anchors] mean over the views that decode it, of its most opaque Gaussian
};
template <class A>
concept RenderedAttack = Attack<A> && requires(ParameterArena<float>& arena, const AnchorEvidence& evidence) {
  { A::apply(arena, double{}, std::uint64_t{}, evidence) } -> std::same_as<Result<Done>>;
};

template <Attack... Attacks>
struct AttackList {
  static constexpr std::size_t count = sizeof...(Attacks);
  template <class Added>
  using With = AttackList<Attacks..., Added>;

  /// Calls use.template operator()<A>() for each attack.
  template <class Use>
  static void each(const Use& use) {
    (use.template operator()<Attacks>(), ...);
  }
  [[nodiscard]] static std::string names() {
    std::string all;
    ((all += (all.empty() ? "" : ", ") + std::string(Attacks::name)), ...);
    return all;
  }
};

namespace detail {
/// The attack of `List` that a text names, "blur", or with its strength "blur:1.5": returns use.template
/// operator()<A>(strength).
template <class List, class Returned, class Use>
[[nodiscard]] Result<Returned> with_attack(std::string_view text, const Use& use) {
  const std::size_t colon = text.find(':');
  const std::string_view name = text.substr(0, colon);
  Result<Returned> result = Error{ErrorKind::invalid,
                                  {},
                                  "attack",
                                  "\"" + std::string(name.substr(0, 40)) + "\" is none of " + List::names(),
                                  "choose one of them"};
  List::each([&]<class A>() {
    if (name != A::name) return;
    const AttackAmount range = A::amount;
    double amount = range.usual;
    if (colon != std::string_view::npos) {
      const char* const end = text.data() + text.size();
      const auto [read, status] = std::from_chars(text.data() + colon + 1, end, amount);
      const auto on_a_step = [&] {
        const double steps = (amount - range.least) / range.step;
        return steps == std::floor(steps);
      };
      if (status != std::errc() || read != end || !(amount >= range.least && amount <= range.most) ||
          (range.step > 0 && !on_a_step())) {
        result = Error{ErrorKind::invalid,
                       {},
                       "attack",
                       "\"" + std::string(text.substr(0, 40)) + "\" has no strength from " + exact_text(range.least) +
                           " to " + exact_text(range.most) +
                           (range.step > 0 ? " in steps of " + exact_text(range.step) : ""),
                       "give " + std::string(range.meaning)};
        return;
      }
    }
    result = use.template operator()<A>(amount);
  });
  return result;
}
}  // namespace detail

/// Whether `text` names an attack of the list and a strength that it may have.
template <class List>
[[nodiscard]] Result<Done> check_attack(std::string_view text) {
  return detail::with_attack<List, Done>(text, []<Attack A>(double) { return Result<Done>(Done{}); });
}

/// Does to a picture what `text` names: an attack of the list, "blur", at its usual strength, or "blur:1.5". Error: the
/// list has no such attack, or its strength is out of its range.
template <class List>
[[nodiscard]] Result<AttackedPicture> attack_picture(std::string_view text, ImageView<const float> image,
                                                     std::uint64_t seed = 0) {
  return detail::with_attack<List, AttackedPicture>(
      text, [&]<PictureAttack A>(double amount) { return Result<AttackedPicture>(A::apply(image, amount, seed)); });
}
/// … to the numbers of a model, in place. An Error of the attack itself may leave the model half changed. `evidence` is
/// for an attack that needs_renders.
template <class List>
[[nodiscard]] Result<Done> attack_model(std::string_view text, ParameterArena<float>& arena, std::uint64_t seed = 0,
                                        const AnchorEvidence* evidence = nullptr) {
  return detail::with_attack<List, Done>(text, [&]<class A>(double amount) -> Result<Done> {
    if constexpr (RenderedAttack<A>) {
      if (evidence != nullptr) return A::apply(arena, amount, seed, *evidence);
      return Error{ErrorKind::invalid,
                   {},
                   "attack",
                   "\"" + std::string(A::name) + "\" looks at renders, and there are none",
                   "give what they say of each anchor (app/model_attack.hpp)"};
    } else {
      return A::apply(arena, amount, seed);
    }
  });
}
/// Whether attack_model needs AnchorEvidence for what `text` names. Error: that of check_attack.
template <class List>
[[nodiscard]] Result<bool> needs_renders(std::string_view text) {
  return detail::with_attack<List, bool>(text, []<class A>(double) { return Result<bool>(RenderedAttack<A>); });
}

}  // namespace compmark
