// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "train_marked.hpp"

#include <compmark/recipes/captures.hpp>
#include <compmark/recipes/marked_codecs.hpp>
#include <compmark/recipes/scaffold.hpp>

#include "train_recipe.hpp"

namespace tool {

Error no_message_in(const std::string& recipe) {
  return {ErrorKind::unsupported,
          {},
          "--recipe",
          "\"" + recipe + "\" cannot carry a message in this tool",
          "this tool marks scaffold, hac and context_gs, alone or with +mask or +alpha, compmark-host and "
          "compmark-paper-host with a decoder that is there (--decoder), and finished models with +exposure or of "
          "fit-codec too: train with one of them (--recipe)"};
}

int train_marked(const TrainOptions& options, TrainSettings settings, const MarkInput& mark) {
  using namespace recipes;
  if (options.recipe == "scaffold") {
    if (mark.for_compression) return run<MarkedForCompression<Scaffold, Decoder>>(options, settings, &mark);
    return run<Marked<Scaffold, Decoder>>(options, settings, &mark);
  }
  // The whole published method, which has the noise of quantization in it.
  if (options.recipe == "compmark-host") return run<CompMarkGs<CompMarkHost, Decoder>>(options, settings, &mark);
  if (options.recipe == "compmark-paper-host") return run<CompMarkGsPaper<Decoder>>(options, settings, &mark);
  if (mark.for_compression) {
    return fail({ErrorKind::unsupported,
                 {},
                 "--for-compression",
                 "works with the recipe scaffold only",
                 "leave the option out, or choose --recipe scaffold"});
  }
  if (options.recipe == "scaffold+mask") return run<Marked<ScaffoldMasked, Decoder>>(options, settings, &mark);
  if (options.recipe == "scaffold+alpha") return run<Marked<ScaffoldAlpha, Decoder>>(options, settings, &mark);
  return fail(no_message_in(options.recipe));
}

}  // namespace tool
