// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A stage is what a recipe may have beyond its six required types: an exposure, a message, a rate. It is one type that
// brings everything of its own: its blocks in the arena (Handles), what it does in an iteration (Phase, an input), what
// its forward pass leaves for the backward pass (Context), and its hooks. A recipe names its stages as a StageList;
// Pipeline and Trainer call the hooks in the order of the list, those of a backward pass in the reverse order, and know
// nothing else of them. What a recipe leaves out is in no list: no member, no branch, no symbol.
//
// Derive a stage from Stage<Mine> and write the hooks it needs; a hook that it does not write does nothing. A hook of
// the wrong signature does not compile, because it hides the empty one of its name. `pass` is what a hook works on
// (ForwardPass, LossPass, BackwardPass), `own` the stage's part of it (StageOf, StageOfLoss). docs/concepts/Stage.md
// has the table with the order. Cost: none but the hooks'.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

namespace compmark {

namespace detail {
/// Replaces an absent stage; a type of its own for each, so that none takes room.
template <class Absentee>
struct Nothing {};
}  // namespace detail

/// Base of every stage: nothing of its own, and hooks that do nothing. Self makes the empty types of two stages
/// distinct.
template <class Self>
struct Stage {
  struct Handles {};
  struct Phase {};
  struct Context {};
  template <class R>
  struct TrainingState {};

  /// Whether `attributes` or `before_culling` change what the decoder reads of the anchors.
  static constexpr bool changes_attributes = false;
  /// Whether `gaussians` takes the opacity of some of them.
  static constexpr bool masks_gaussians = false;
  /// Whether context.error_map() says where the image is wrong, for growing to look at.
  static constexpr bool keeps_error_map = false;
  /// The parts of a photograph that the stage reads, beyond its colours over a constant background.
  static constexpr bool needs_target_planes = false, needs_alpha = false, needs_pixel_weights = false;

  // The model: blocks, their first values, and how fast they train.
  template <class Arena, class Anchors>
  static Handles add_parameters(Arena& /*arena*/, const Anchors& /*anchors*/, std::size_t /*views*/) {
    return {};
  }
  template <class Arena, class Blocks, class Seed>
  static void initialise(Arena& /*arena*/, const Blocks& /*blocks*/, Seed /*seed*/) {}
  template <class Arena, class Blocks, class Settings>
  static void set_schedules(Arena& /*arena*/, const Blocks& /*blocks*/, const Settings& /*settings*/) {}
  template <class Arena, class Anchors, class Blocks>
  static void bake(Arena& /*arena*/, const Anchors& /*anchors*/, const Blocks& /*blocks*/) {}

  // A training: its numbers, the phase of an iteration, and what follows the step of the optimiser.
  template <class R, class Settings>
  static void configure(const Settings& /*settings*/) {}
  template <class Iteration, class Phase>
  static void set_phase(const Iteration& /*iteration*/, Phase& /*phase*/) {}
  /// The phase of a sampled novel view of the same iteration, from that of the photographed one.
  template <class Phase>
  static void leave_photograph(Phase& /*phase*/) {}
  /// The phase of the unmarked model's render of the same view, which a marked one is compared with: no message, and
  /// nothing rounded.
  template <class Phase>
  static void leave_mark(Phase& /*phase*/) {}
  template <class Iteration, class Model, class Blocks>
  static void prepare_model(const Iteration& /*iteration*/, Model& /*model*/, const Blocks& /*blocks*/) {}
  template <class Iteration>
  static void weigh_losses(const Iteration& /*iteration*/, double& /*image_weight*/) {}
  template <class Training, class State>
  static void after_backward(const Training& /*training*/, State& /*state*/) {}
  template <class Arena, class Blocks, class Rates>
  static void after_step(Arena& /*arena*/, const Blocks& /*blocks*/, const Rates& /*rates*/) {}

  // The forward pass, in this order.
  template <class Pass, class Own, class Columns>
  static void before_culling(const Pass& /*pass*/, const Own& /*own*/, Columns& /*columns*/) {}
  template <class Phase>
  static constexpr bool reads_all_features(const Phase& /*phase*/) {
    return false;
  }
  /// Takes rows of anchors that the view would decode away.
  template <class Phase, class Rows>
  static void choose_visible(const Phase& /*phase*/, Rows& /*visible*/) {}
  template <class Pass, class Own, class Columns>
  static void attributes(const Pass& /*pass*/, const Own& /*own*/, Columns& /*columns*/) {}
  template <class Pass, class Own>
  static void gaussians(const Pass& /*pass*/, const Own& /*own*/) {}
  template <class Phase, class Color>
  static void background(const Phase& /*phase*/, Color& /*color*/) {}
  template <class Pass, class Own>
  static void image(const Pass& /*pass*/, const Own& /*own*/) {}

  // The losses: before and after the photometric one, and those of the stage. `no_loss` in place of all where a caller
  // has a loss of its own.
  template <class Pass, class Own, class Image>
  static void before_photometric(const Pass& /*pass*/, const Own& /*own*/, Image& /*compared*/) {}
  template <class Pass, class Own, class Report>
  static void after_photometric(const Pass& /*pass*/, const Own& /*own*/, Report& /*report*/) {}
  template <class Pass, class Own, class Report>
  static void loss(const Pass& /*pass*/, const Own& /*own*/, Report& /*report*/) {}
  template <class Own, class Image>
  static void no_loss(const Own& /*own*/, const Image& /*image*/) {}

  // The backward pass, in this order.
  template <class Pass, class Own>
  static void image_backward(const Pass& /*pass*/, const Own& /*own*/) {}
  template <class Own, class Image, class Planes>
  static void plane_gradients(const Own& /*own*/, const Image& /*image*/, Planes& /*planes*/) {}
  template <class Pass, class Own>
  static void gaussians_backward(const Pass& /*pass*/, const Own& /*own*/) {}
  template <class Pass, class Own>
  static void attributes_backward(const Pass& /*pass*/, const Own& /*own*/) {}
};

/// Stages in the order in which they are called.
template <class... S>
struct StageList {
  static constexpr std::size_t count = sizeof...(S);

  /// call.template operator()<S>() for every stage, first to last.
  template <class Call>
  static constexpr void forward(Call&& call) {
    (call.template operator()<S>(), ...);
  }
  /// … last to first.
  template <class Call>
  static constexpr void backward(Call&& call) {
    if constexpr (count != 0) {
      int order = 0;  // an assignment evaluates its right side first
      ((call.template operator()<S>(), order) = ... = 0);
      static_cast<void>(order);
    } else {
      static_cast<void>(call);
    }
  }
  /// Whether that holds for any stage.
  static constexpr bool changes_attributes = (S::changes_attributes || ...);
  static constexpr bool masks_gaussians = (S::masks_gaussians || ...);
  static constexpr bool needs_target_planes = (S::needs_target_planes || ...);
  static constexpr bool needs_alpha = (S::needs_alpha || ...);
  static constexpr bool needs_pixel_weights = (S::needs_pixel_weights || ...);
};

namespace detail {
template <class... Lists>
struct JoinStages;
template <class... A>
struct JoinStages<StageList<A...>> {
  using type = StageList<A...>;
};
template <class... A, class... B, class... More>
struct JoinStages<StageList<A...>, StageList<B...>, More...> : JoinStages<StageList<A..., B...>, More...> {};
}  // namespace detail
/// Lists one after the other.
template <class... Lists>
using JoinStages = typename detail::JoinStages<Lists...>::type;

// The kinds of StageMembers: a stage's members in a model, in an iteration, in a context and in a pipeline.
template <class S>
using StageHandles = typename S::Handles;
template <class S>
using StagePhase = typename S::Phase;
template <class S>
using StageContext = typename S::Context;
template <class S>
using StageItself = S;

/// One member of a StageMembers; a base, so that an empty one takes no room.
template <class S, template <class> class Kind>
struct StageMember {
  [[no_unique_address]] Kind<S> value{};
};

namespace detail {
// Finds the member of a stage that is a template by the template alone: Exposure's stage, whatever its exposure.
template <template <class...> class S, template <class> class Kind, class... A>
[[nodiscard]] constexpr StageMember<S<A...>, Kind>& find_member(StageMember<S<A...>, Kind>& member) {
  return member;
}
template <template <class...> class S, template <class> class Kind, class... A>
[[nodiscard]] constexpr const StageMember<S<A...>, Kind>& find_member(const StageMember<S<A...>, Kind>& member) {
  return member;
}
}  // namespace detail

/// For every stage of a list what `Kind` says: StageHandles, StagePhase, StageContext, StageItself.
template <class List, template <class> class Kind>
struct StageMembers;
template <class... S, template <class> class Kind>
struct StageMembers<StageList<S...>, Kind> : StageMember<S, Kind>... {
  /// Of one stage, by its type or by its template.
  template <class Which>
  [[nodiscard]] constexpr auto& of() {
    return static_cast<StageMember<Which, Kind>&>(*this).value;
  }
  template <class Which>
  [[nodiscard]] constexpr const auto& of() const {
    return static_cast<const StageMember<Which, Kind>&>(*this).value;
  }
  template <template <class...> class Which>
  [[nodiscard]] constexpr auto& of() {
    return detail::find_member<Which, Kind>(*this).value;
  }
  template <template <class...> class Which>
  [[nodiscard]] constexpr const auto& of() const {
    return detail::find_member<Which, Kind>(*this).value;
  }
};

/// What each stage of a list keeps between the iterations of a training of recipe R.
template <class List, class R>
struct TrainingStates;
template <class S, class R>
struct TrainingStateMember {
  [[no_unique_address]] typename S::template TrainingState<R> value{};
};
template <class... S, class R>
struct TrainingStates<StageList<S...>, R> : TrainingStateMember<S, R>... {
  template <class Which>
  [[nodiscard]] constexpr auto& of() {
    return static_cast<TrainingStateMember<Which, R>&>(*this).value;
  }
  template <class Which>
  [[nodiscard]] constexpr const auto& of() const {
    return static_cast<const TrainingStateMember<Which, R>&>(*this).value;
  }
};

namespace detail {
template <class List, template <class...> class Which>
struct FindStage {
  using type = void;
};
template <class First, class... S, template <class...> class Which>
struct FindStage<StageList<First, S...>, Which> : FindStage<StageList<S...>, Which> {};
template <class... A, class... S, template <class...> class Which>
struct FindStage<StageList<Which<A...>, S...>, Which> {
  using type = Which<A...>;
};
}  // namespace detail
/// The stage of a list that is of this template; void if there is none.
template <class List, template <class...> class Which>
using FindStage = typename detail::FindStage<List, Which>::type;
/// Whether a list has a stage of this template.
template <class List, template <class...> class Which>
inline constexpr bool has_stage = !std::is_void_v<FindStage<List, Which>>;

namespace detail {
template <class List>
struct ErrorMapStage {
  using type = void;
};
template <class First, class... S>
struct ErrorMapStage<StageList<First, S...>>
    : std::conditional_t<First::keeps_error_map, std::type_identity<First>, ErrorMapStage<StageList<S...>>> {};
}  // namespace detail
/// The first stage of a list whose context has an error map of the image for growing to look at; void if there is none.
template <class List>
using ErrorMapStage = typename detail::ErrorMapStage<List>::type;

/// A stage's part of a forward or backward pass.
template <class S>
struct StageOf {
  const typename S::Handles& blocks;
  const typename S::Phase& phase;  ///< that of the forward pass
  typename S::Context& context;
};
/// … of the losses, which see no parameters.
template <class S>
struct StageOfLoss {
  const typename S::Phase& phase;
  typename S::Context& context;
};

/// Iteration `t` (from 1) of a training of `total`.
struct StageIteration {
  std::int64_t t = 0, total = 0;
  std::uint64_t seed = 0;
};

}  // namespace compmark
