// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/quantizer/int8_quantizer.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/splat/quantizer/concept.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;

// Its steps come from the data: an attack on a finished model, and what a distortion layer may train for.
static_assert(Quantizer<Int8Quantizer<float>>);
static_assert(!Int8Quantizer<float>::is_absent);

template <class T>
struct Tensor {
  std::string name;
  std::size_t rows = 0, columns = 0;
  std::vector<T> x;
  [[nodiscard]] MatrixView<const T> view() const { return {x.data(), rows, columns}; }
};

template <class T, class F>
Tensor<T> make(std::string name, std::size_t rows, std::size_t columns, const F& f) {
  Tensor<T> tensor{std::move(name), rows, columns, std::vector<T>(rows * columns)};
  for (std::size_t i = 0; i < tensor.x.size(); ++i) tensor.x[i] = static_cast<T>(f(i));
  return tensor;
}

template <class T>
std::vector<Tensor<T>> tensors() {
  using L = std::numeric_limits<T>;
  const Random random(3, 0, random_stage("int8 tensors"));
  const auto normal = [&](std::size_t i) { return random.normal(i); };
  std::vector<Tensor<T>> list;
  list.push_back(make<T>("normal", 37, 30, normal));
  list.push_back(make<T>("positive", 10, 7, [&](std::size_t i) { return 5 + random.uniform(i); }));
  list.push_back(make<T>("negative", 10, 7, [&](std::size_t i) { return -5 - random.uniform(i); }));
  list.push_back(make<T>("zeros", 9, 6, [](std::size_t) { return 0; }));
  list.push_back(make<T>("constant", 9, 6, [](std::size_t) { return 0.3; }));
  list.push_back(make<T>("negative constant", 9, 6, [](std::size_t) { return -7; }));
  list.push_back(make<T>("one column constant", 40, 3, [&](std::size_t i) { return i % 3 == 1 ? 4.0 : normal(i); }));
  list.push_back(make<T>("an outlier", 50, 6, [&](std::size_t i) { return i == 77 ? 1e6 : normal(i); }));
  list.push_back(make<T>("columns of very different size", 50, 6,
                         [&](std::size_t i) { return std::pow(100.0, static_cast<double>(i % 6)) * normal(i); }));
  list.push_back(make<T>("extremes", 6, 5, [&](std::size_t i) {
    return i % 3 == 0 ? L::max() : i % 3 == 1 ? L::lowest() : static_cast<T>(normal(i));
  }));
  list.push_back(make<T>("greatest", 4, 4, [&](std::size_t) { return L::max(); }));
  list.push_back(make<T>("denormals", 20, 5,
                         [&](std::size_t i) { return static_cast<T>(static_cast<double>(i) - 50) * L::denorm_min(); }));
  list.push_back(make<T>("least normals", 20, 5, [&](std::size_t i) { return static_cast<T>(normal(i)) * L::min(); }));
  list.push_back(make<T>("minus zero", 5, 3, [](std::size_t) { return -0.0; }));
  list.push_back(make<T>("one", 1, 1, [](std::size_t) { return 1; }));
  list.push_back(make<T>("none", 0, 4, normal));
  for (std::size_t columns = 1; columns < 35; columns += 3)
    list.push_back(make<T>("of " + std::to_string(columns), 67 / columns + 3, columns, normal));
  return list;
}

template <class T>
std::vector<Int8Quantizer<T>> quantizers() {
  std::vector<Int8Quantizer<T>> list;
  for (const Int8Scheme scheme : {Int8Scheme::affine, Int8Scheme::symmetric}) {
    for (const Int8Channels channels : {Int8Channels::tensor, Int8Channels::rows, Int8Channels::columns}) {
      for (const double least : {0x1p-23, static_cast<double>(std::numeric_limits<T>::min())}) {
        list.push_back(*Int8Quantizer<T>::create({scheme, channels, least}));
      }
    }
  }
  return list;
}

template <class T>
std::size_t channel_of(const Int8Quantizer<T>& quantizer, std::size_t i, std::size_t columns) {
  switch (quantizer.settings().channels) {
    case Int8Channels::tensor:
      return 0;
    case Int8Channels::rows:
      return i / columns;
    default:
      return i % columns;
  }
}

/// Values further than s / 2 (1 + 2^-13 eps / 2^-23) from themselves: 255 times a rounding of each of quotient and
/// product, and two of s.
template <class T>
std::size_t beyond_half_a_step(const Tensor<T>& tensor, const std::vector<T>& out, const auto& scale_of_value) {
  const long double slack = 255.0L * 4 * std::numeric_limits<T>::epsilon();
  std::size_t count = 0;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const long double error = std::abs(static_cast<long double>(out[i]) - static_cast<long double>(tensor.x[i]));
    count += error <= static_cast<long double>(scale_of_value(i)) / 2 * (1 + slack) ? 0 : 1;
  }
  return count;
}

TEST_CASE_TEMPLATE("quantizer/int8: no value moves by more than half a step", T, float, double) {
  for (const Int8Quantizer<T>& quantizer : quantizers<T>()) {
    for (const Tensor<T>& tensor : tensors<T>()) {
      CAPTURE(tensor.name);
      CAPTURE(static_cast<int>(quantizer.settings().channels));
      typename Int8Quantizer<T>::Context context;
      std::vector<T> out(tensor.x.size());
      REQUIRE(quantizer.forward(tensor.view(), {out.data(), tensor.rows, tensor.columns}, context));
      for (const auto& scale : context.scales.span()) {
        REQUIRE(scale.scale >= static_cast<T>(quantizer.settings().least_scale));
        REQUIRE(std::abs(scale.zero_point) <= 128);
        REQUIRE(scale.zero_point == std::nearbyint(scale.zero_point));
      }
      CHECK(beyond_half_a_step(tensor, out, [&](std::size_t i) {
              return context.scales[channel_of(quantizer, i, tensor.columns)].scale;
            }) == 0);
    }
  }
}

TEST_CASE_TEMPLATE("quantizer/int8: control: the formula as it is written fails where a range is nothing or too large",
                   T, float, double) {
  std::vector<std::string> failed;
  for (const Tensor<T>& tensor : tensors<T>()) {
    if (tensor.x.empty()) continue;
    T low = 0, high = 0;
    for (const T x : tensor.x) low = std::min(low, x), high = std::max(high, x);
    const T s = (high - low) / 255, z = -128 - std::nearbyint(low / s);
    std::vector<T> out;
    for (const T x : tensor.x) {
      T k = std::nearbyint(x / s) + z;
      k = k < -128 ? T(-128) : k > 127 ? T(127) : k;
      out.push_back((k - z) * s);
    }
    if (beyond_half_a_step(tensor, out, [&](std::size_t) { return s; }) != 0) failed.push_back(tensor.name);
  }
  const auto has = [&](const char* name) { return std::find(failed.begin(), failed.end(), name) != failed.end(); };
  CHECK(has("zeros"));       // 0 / 0
  CHECK(has("minus zero"));  // …
  CHECK(has("denormals"));   // a scale without digits
  CHECK(has("extremes"));    // infinity
  CHECK_FALSE(has("normal"));
}

TEST_CASE_TEMPLATE("quantizer/int8: packs give what one value gives; integers and scales give it back", T, float,
                   double) {
  for (const Int8Quantizer<T>& quantizer : quantizers<T>()) {
    for (const Tensor<T>& tensor : tensors<T>()) {
      CAPTURE(tensor.name);
      const std::size_t n = tensor.x.size();
      typename Int8Quantizer<T>::Context context;
      std::vector<T> out(n), plain(n), decoded(n), in_place = tensor.x;
      REQUIRE(quantizer.forward(tensor.view(), {out.data(), tensor.rows, tensor.columns}, context));
      // The reference: extremes one by one, then one value at a time.
      std::vector<std::pair<T, T>> extremes(context.scales.size(), {T(0), T(0)});
      for (std::size_t i = 0; i < n; ++i) {
        auto& [low, high] = extremes[channel_of(quantizer, i, tensor.columns)];
        low = std::min(low, tensor.x[i]);
        high = std::max(high, tensor.x[i]);
      }
      std::vector<std::int8_t> symbols(n), one_by_one(n);
      for (std::size_t i = 0; i < n; ++i) {
        const auto& [low, high] = extremes[channel_of(quantizer, i, tensor.columns)];
        const typename Int8Quantizer<T>::Scale scale = quantizer.scale_of(low, high);
        plain[i] = Int8Quantizer<T>::value(tensor.x[i], scale);
        one_by_one[i] = static_cast<std::int8_t>(Int8Quantizer<T>::symbol(tensor.x[i], scale));
      }
      CHECK(out == plain);
      quantizer.encode(tensor.view(), context, symbols);
      CHECK(symbols == one_by_one);
      quantizer.decode(symbols, context, {decoded.data(), tensor.rows, tensor.columns});
      CHECK(decoded == out);
      REQUIRE(quantizer.forward({in_place.data(), tensor.rows, tensor.columns},
                                {in_place.data(), tensor.rows, tensor.columns}, context));
      CHECK(in_place == out);
    }
  }
}

TEST_CASE("quantizer/int8: closed form: both schemes on four numbers") {
  const std::vector<float> x{-127.5f, 0, 63.75f, 127.5f};  // ranges of which s is exact
  const auto check = [&](Int8Scheme scheme, const std::vector<float>& y, std::vector<std::int8_t> wanted, float scale,
                         float zero) {
    const auto quantizer = Int8Quantizer<float>::create({scheme, Int8Channels::tensor});
    Int8Quantizer<float>::Context context;
    REQUIRE(quantizer->fit({y.data(), 1, 4}, context));
    std::vector<std::int8_t> symbols(4);
    quantizer->encode({y.data(), 1, 4}, context, symbols);
    CHECK(symbols == wanted);
    CHECK(context.scales[0].scale == scale);
    CHECK(context.scales[0].zero_point == zero);
  };
  // lo / s = -127.5 is a tie: to -128, so z = 0, and hi / s = 127.5 is held at 127.
  check(Int8Scheme::affine, x, {-128, 0, 64, 127}, 1, 0);
  check(Int8Scheme::symmetric, x, {-128, 0, 64, 127}, 1, 0);
  check(Int8Scheme::affine, {0, 1, 2, 255}, {-128, -127, -126, 127}, 1, -128);
  check(Int8Scheme::affine, {-255, -1, -2, 0}, {-128, 126, 125, 127}, 1, 127);
  check(Int8Scheme::symmetric, {0, 1, 2, 127.5f}, {0, 1, 2, 127}, 1, 0);
}

TEST_CASE("quantizer/int8: constants come back, and finer channels are never coarser") {
  const auto tensor_wise = Int8Quantizer<float>::create({});
  Int8Quantizer<float>::Context whole, fine;
  for (const Tensor<float>& tensor : tensors<float>()) {
    if (tensor.name == "constant" || tensor.name == "negative constant") {
      std::vector<float> out(tensor.x.size());
      REQUIRE(tensor_wise->forward(tensor.view(), {out.data(), tensor.rows, tensor.columns}, whole));
      // s and 255 s: two roundings
      CHECK(std::abs(out[0] - tensor.x[0]) <= std::numeric_limits<float>::epsilon() * std::abs(tensor.x[0]));
    }
    if (tensor.x.empty()) continue;
    REQUIRE(tensor_wise->fit(tensor.view(), whole));
    for (const Int8Channels channels : {Int8Channels::rows, Int8Channels::columns}) {
      REQUIRE(Int8Quantizer<float>::create({Int8Scheme::affine, channels})->fit(tensor.view(), fine));
      CHECK(fine.scales.size() == (channels == Int8Channels::rows ? tensor.rows : tensor.columns));
      for (const auto& scale : fine.scales.span()) CHECK(scale.scale <= whole.scales[0].scale);
    }
  }
}

TEST_CASE("quantizer/int8: what is not finite is refused where it is") {
  const Tensor<float> good = make<float>("good", 11, 6, [](std::size_t i) { return i; });
  Int8Quantizer<float>::Context context;
  for (const Int8Quantizer<float>& quantizer : quantizers<float>()) {
    for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                            -std::numeric_limits<float>::infinity()}) {
      for (const std::size_t at : {std::size_t{0}, std::size_t{33}, std::size_t{65}}) {
        Tensor<float> tensor = good;
        tensor.x[at] = bad;
        const Result<Done> refused = quantizer.forward(tensor.view(), {tensor.x.data(), 11, 6}, context);
        REQUIRE_FALSE(refused);
        CHECK(refused.error().field == "row " + std::to_string(at / 6) + ", column " + std::to_string(at % 6));
        CHECK(tensor.x[1] == good.x[1]);  // nothing was written
      }
    }
  }
  for (const double least : {0.0, -1.0, 1e-39, 2.0, std::nan("")}) {
    CHECK_FALSE(Int8Quantizer<float>::create({Int8Scheme::affine, Int8Channels::tensor, least}));
  }
}

TEST_CASE("quantizer/int8: gradients pass straight through, and are added") {
  const auto quantizer = Int8Quantizer<double>::create({});
  Int8Quantizer<double>::Context context;
  const Random random(6, 0, 1);
  std::vector<double> x(60), out(60), residual(60), d_out(60), d_x(60, 0.0);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = 2 * random.normal(i);
  REQUIRE(quantizer->forward({x.data(), 12, 5}, {out.data(), 12, 5}, context));
  for (std::size_t i = 0; i < x.size(); ++i) {
    residual[i] = out[i] - x[i];
    d_out[i] = std::cos(out[i]);
  }
  Int8Quantizer<double>::backward(d_out, d_x);
  const auto loss = [&] {
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += std::sin(x[i] + residual[i]);
    return sum;
  };
  CHECK(testing::gradient_law(loss, x, d_x) == "");
  const std::vector<double> zero(60, 0.0);
  CHECK(testing::gradient_law(loss, x, zero) != "");  // the true derivative of rounding
  Int8Quantizer<double>::backward(d_out, d_x);
  CHECK(d_x[7] == 2 * d_out[7]);
}

}  // namespace
