// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/math/binomial.hpp>
#include <compmark/watermark/proof/recipient_score.hpp>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

using namespace compmark;

namespace {

/// A Tardos code of its own: biases, the words of `colluders`, and what is read where each bit is that of one of them.
struct DrawnCode {
  DrawnCode(std::uint64_t number, std::size_t bits, double cutoff, std::size_t colluders)
      : random(17, number, random_stage("test/recipient score")) {
    for (std::size_t i = 0; i < bits; ++i) bias.push_back(tardos_bias(random.uniform(next++), cutoff));
    for (std::size_t c = 0; c < colluders; ++c) words.push_back(word());
    for (std::size_t i = 0; i < bits; ++i) read.push_back(words[random.bits(next++) % colluders][i]);
    for (std::size_t i = 0; i < bits; ++i) terms.push_back(symmetric_term(read[i] ? bias[i] : 1 - bias[i], 1));
  }
  std::vector<bool> word() {
    std::vector<bool> drawn;
    for (const double p : bias) drawn.push_back(random.uniform(next++) < p);
    return drawn;
  }
  [[nodiscard]] std::int64_t score(const std::vector<bool>& of) const {
    std::int64_t sum = 0;
    for (std::size_t i = 0; i < of.size(); ++i) sum += of[i] == read[i] ? terms[i].match : terms[i].mismatch;
    return sum;
  }
  [[nodiscard]] std::size_t matches(const std::vector<bool>& of) const {
    std::size_t count = 0;
    for (std::size_t i = 0; i < of.size(); ++i) count += of[i] == read[i] ? 1 : 0;
    return count;
  }
  Random random;
  std::uint64_t next = 0;
  std::vector<double> bias;
  std::vector<std::vector<bool>> words;
  std::vector<bool> read;
  std::vector<ScoreTerm> terms;
};

}  // namespace

TEST_CASE("proof/recipient_score: the tail is that of all words, one by one") {
  const Random random(5, 0, random_stage("test/enumeration"));
  std::uint64_t next = 0;
  double naive_error = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const std::size_t bits = 1 + static_cast<std::size_t>(random.bits(next++) % 11);
    std::vector<ScoreTerm> terms;
    for (std::size_t i = 0; i < bits; ++i) {
      ScoreTerm term =
          symmetric_term(0.02 + 0.96 * random.uniform(next), trial % 3 == 0 ? 1 : random.uniform(next + 1));
      next += 2;
      if (trial % 7 == 0 && i == 0) term = {3, 3, 0.3};    // says nothing
      if (trial % 7 == 1 && i == 0) term = {-5, 40, 0.1};  // a match that counts against
      terms.push_back(term);
    }
    std::vector<std::int64_t> scores;
    std::vector<double> chances;
    for (std::size_t word = 0; word < std::size_t{1} << bits; ++word) {
      std::int64_t score = 0;
      double chance = 1;
      for (std::size_t i = 0; i < bits; ++i) {
        const bool match = (word >> i & 1u) != 0;
        score += match ? terms[i].match : terms[i].mismatch;
        chance *= match ? terms[i].probability : 1 - terms[i].probability;
      }
      scores.push_back(score);
      chances.push_back(chance);
    }
    const ScoreTail tail(terms);
    for (const std::int64_t score : scores) {
      double exact = 0;
      for (std::size_t word = 0; word < scores.size(); ++word) exact += scores[word] >= score ? chances[word] : 0;
      CHECK(tail(score) == doctest::Approx(exact).epsilon(1e-12));
      // As if all words were equally likely: the error that biases make.
      double flat = 0;
      for (const std::int64_t other : scores) flat += other >= score ? 1.0 / static_cast<double>(scores.size()) : 0;
      naive_error = std::max(naive_error, std::abs(flat - exact));
    }
    const std::int64_t most = *std::max_element(scores.begin(), scores.end());
    CHECK(tail(most + 1) == 0);
    CHECK(tail(*std::min_element(scores.begin(), scores.end())) == 1);
  }
  CHECK(naive_error > 0.1);
}

TEST_CASE("proof/recipient_score: with fair bits it is the binomial tail, to the last bit of 1e-38") {
  const std::vector<ScoreTerm> terms(128, symmetric_term(0.5, 1));
  const ScoreTail tail(terms);
  for (const std::size_t matches : {0u, 30u, 64u, 90u, 120u, 127u, 128u}) {
    const auto steps = static_cast<std::int64_t>(score_steps);
    const std::int64_t score = steps * (2 * static_cast<std::int64_t>(matches) - 128);
    CHECK(tail(score) == doctest::Approx(binomial_tail(matches, 128)).epsilon(1e-12));
  }
}

TEST_CASE("proof/recipient_score: the score of the innocent has mean 0 and deviation 1") {
  for (const double q : {0.02, 0.1, 0.3, 0.5, 0.8, 0.97}) {
    const ScoreTerm term = symmetric_term(q, 1);
    const double match = term.match / score_steps, mismatch = term.mismatch / score_steps;
    CHECK(std::abs(q * match + (1 - q) * mismatch) < 0.003);
    CHECK(q * match * match + (1 - q) * mismatch * mismatch == doctest::Approx(1).epsilon(0.02));
  }
  CHECK(symmetric_term(0.3, 0).match == 0);
}

TEST_CASE("proof/recipient_score: biases follow the cut-off arcsine law") {
  for (const double cutoff : {0.01, 0.1, 0.4}) {
    const double least = std::asin(std::sqrt(cutoff)), range = std::numbers::pi / 2 - 2 * least;
    for (int i = 0; i <= 100; ++i) {
      const double u = i / 100.0, p = tardos_bias(u, cutoff);
      CHECK(p >= cutoff);
      CHECK(p <= 1 - cutoff);
      CHECK((std::asin(std::sqrt(p)) - least) / range == doctest::Approx(u).epsilon(1e-9));
      CHECK(tardos_bias(1 - u, cutoff) == doctest::Approx(1 - p).epsilon(1e-9));
    }
  }
  CHECK(tardos_bias(0.2, 0.5) == 0.5);
  CHECK(tardos_bias(1, 0.5) == 0.5);
}

TEST_CASE("proof/recipient_score: bits that the logits leave open count little, and no code word is looked at") {
  const std::vector<double> logits{2, -2, 1, -0.5, 0, 9};
  const std::vector<std::size_t> shared{0, 1};
  const std::vector<double> weights = bit_weights(logits, shared);
  CHECK(weights == std::vector<double>{1, 1, 0.25, 0.0625, 0, 1});
  CHECK(bit_weights(std::vector<double>{0, 0, 3}, shared) == std::vector<double>{0, 0, 1});
}

TEST_CASE(
    "proof/recipient_score: somebody who had no part is accused at the rate that is stated; by plain matches, more "
    "often") {
  // Each bit is that of one of three colluders. The innocent have the same biases, and so many bits in common with them.
  constexpr std::size_t words = 20000, bits = 32;
  for (const double rate : {0.05, 0.01}) {
    std::size_t accused = 0, by_matches = 0;
    for (std::size_t i = 0; i < words / 20; ++i) {
      DrawnCode code(i, bits, 0.02, 3);
      const ScoreTail tail(code.terms);
      for (int one = 0; one < 20; ++one) {
        const std::vector<bool> innocent = code.word();
        accused += tail(code.score(innocent)) <= rate ? 1 : 0;
        by_matches += binomial_tail(code.matches(innocent), bits) <= rate ? 1 : 0;
      }
    }
    CAPTURE(rate);
    CHECK(clopper_pearson(accused, words).contains(rate));
    CHECK(clopper_pearson(by_matches, words).low > 2 * rate);
  }
}

TEST_CASE("proof/recipient_score: with few bits, the bias 1/2 names more colluders than smaller cut-offs do") {
  constexpr std::size_t codes = 400;
  for (const std::size_t bits : {24u, 32u}) {
    for (const std::size_t colluders : {1u, 2u}) {
      std::vector<std::size_t> caught;
      for (const double cutoff : {0.5, 0.2, 0.05}) {
        std::size_t count = 0;
        for (std::size_t i = 0; i < codes; ++i) {
          const DrawnCode code(i + 7000, bits, cutoff, colluders);
          const ScoreTail tail(code.terms);
          count += std::any_of(code.words.begin(), code.words.end(),
                               [&](const auto& word) { return tail(code.score(word)) <= 1e-3 / 100; });
        }
        caught.push_back(count);
      }
      CAPTURE(bits);
      CAPTURE(colluders);
      CAPTURE(caught[0]);
      CAPTURE(caught[1]);
      CAPTURE(caught[2]);
      if (colluders == 1) {
        CHECK(caught[0] == codes);
        CHECK(caught[2] < caught[0]);
      } else {
        CHECK(caught[0] + 12 >= caught[1]);
        CHECK(caught[0] + 12 >= caught[2]);
      }
    }
  }
}
