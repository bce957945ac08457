// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a reading says of the recipients of a key, as values (recipients.hpp finds them).
#pragma once

#include <cstddef>
#include <vector>

namespace compmark {

/// Of one recipient.
struct RecipientEvidence {
  std::size_t number = 0;   ///< 1 to the key's number of recipients
  std::size_t matches = 0;  ///< of the bits that name recipients
  double p_value = 1;       ///< probability that somebody who had no part scores as high; exact
  double p_corrected = 1;   ///< min(1, recipients * tries * p)
};

struct RecipientTrace {
  std::size_t recipients = 0;  ///< of the key
  std::size_t shared_bits = 0, shared_matches = 0;
  double shared_p_value = 1;  ///< probability that a random key's shared bits score as high
  double copy_p_value = 1;    ///< … that a random key's message of one copy scores as high as the nearest one's
  std::size_t naming_bits = 0;
  std::size_t undecided = 0;    ///< of them: a quarter of the usual weight or less, since copies may differ there
  double rate = 0;              ///< of naming anybody who had no part
  RecipientEvidence nearest{};  ///< the recipient of the highest score, named or not
  /// By score, the highest first: who is named where the owner is proven, and of whom nothing is said elsewhere.
  std::vector<RecipientEvidence> named{};
  bool owner_proven = false;  ///< by the message, or by a spread mark read beside it
};

}  // namespace compmark
