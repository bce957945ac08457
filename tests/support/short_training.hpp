// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Under a sanitizer the trainings are short: they run the code, and the optimised builds compare their figures (4 minutes saved).
#pragma once

#if defined(__SANITIZE_ADDRESS__)
#define COMPMARK_SHORT_TRAININGS 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define COMPMARK_SHORT_TRAININGS 1
#endif
#endif
#if !defined(COMPMARK_SHORT_TRAININGS)
#define COMPMARK_SHORT_TRAININGS 0
#endif

namespace compmark::testing {
inline constexpr bool short_trainings = COMPMARK_SHORT_TRAININGS != 0;
}
