// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The algebra of a fit: Gram matrices, Cholesky factors (GFLOP/s, of multiply-adds) and eigenpairs (largest relative
// error over eigenvalues that span eight decades), and what Eigen takes for the same; kernel ridge regression has no
// peer there. One thread. docs/rationale.md says why Eigen is not what the library uses.
#pragma GCC diagnostic ignored \
    "-Wmaybe-uninitialized"  // false in g++ 12's own AVX-512 header, once Eigen's products are inlined
#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/math/cholesky.hpp"
#include "compmark/math/eigen_pairs.hpp"
#include "compmark/math/kernel_ridge.hpp"
#include "compmark/math/row_products.hpp"

namespace {

using namespace compmark;

Eigen::MatrixXd random_matrix(std::size_t n) {
  const Random random(n, 0, random_stage("bench algebra"));
  Eigen::MatrixXd g(n, n);
  for (std::size_t i = 0; i < n * n; ++i) g.data()[i] = random.normal(i);
  return g;
}
std::vector<double> positive(std::size_t n) {
  const Eigen::MatrixXd g = random_matrix(n);
  const Eigen::MatrixXd a = g * g.transpose() / static_cast<double>(n) + Eigen::MatrixXd::Identity(g.rows(), g.cols());
  return {a.data(), a.data() + a.size()};
}
double decade(std::size_t k, std::size_t n) {
  return std::pow(10.0, -8.0 * static_cast<double>(k) / static_cast<double>(n));
}
std::vector<double> decades(std::size_t n) {
  const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(random_matrix(n)).householderQ();
  Eigen::VectorXd values(static_cast<Eigen::Index>(n));
  for (std::size_t k = 0; k < n; ++k) values[static_cast<Eigen::Index>(k)] = decade(k, n);
  Eigen::MatrixXd a = q * values.asDiagonal() * q.transpose();
  a = ((a + a.transpose()) / 2).eval();
  return {a.data(), a.data() + a.size()};
}

void cholesky(benchmark::State& state, bool peer) {
  const std::size_t n = static_cast<std::size_t>(state.range(0));
  const std::vector<double> matrix = positive(n);
  std::vector<double> work;
  SerialExecutor executor;
  for (auto _ : state) {
    work = matrix;
    if (peer) {
      Eigen::Map<Eigen::MatrixXd> view(work.data(), state.range(0), state.range(0));
      Eigen::Ref<Eigen::MatrixXd> in_place(view);
      const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(in_place);
      benchmark::DoNotOptimize(factor.info());
    } else {
      benchmark::DoNotOptimize(cholesky_in_place(std::span<double>(work), n, executor));
    }
    benchmark::DoNotOptimize(work.data());
  }
  const double flops = std::pow(static_cast<double>(n), 3) / 3;
  state.counters["GFLOP"] = benchmark::Counter(1e-9 * flops, benchmark::Counter::kIsIterationInvariantRate);
}
/// Of 320 rows, those of a fit's features.
void gram(benchmark::State& state, bool peer) {
  constexpr std::size_t rows = 320;
  const std::size_t columns = static_cast<std::size_t>(state.range(0));
  const Random random(columns, 0, random_stage("bench gram"));
  std::vector<float> table(rows * columns);
  for (std::size_t i = 0; i < table.size(); ++i) table[i] = static_cast<float>(random.normal(i));
  SerialExecutor executor;
  for (auto _ : state) {
    if (peer) {  // in double, as ours
      using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      const Eigen::MatrixXd wide = Eigen::Map<const Rows>(table.data(), rows, state.range(0)).cast<double>();
      Eigen::MatrixXd product = Eigen::MatrixXd::Zero(rows, rows);
      product.selfadjointView<Eigen::Lower>().rankUpdate(wide);
      benchmark::DoNotOptimize(product.data());
    } else {
      benchmark::DoNotOptimize(row_products(std::span<const float>(table), rows, columns, executor).data());
    }
  }
  const double flops = static_cast<double>(rows * (rows + 1) / 2 * columns);
  state.counters["GFLOP"] = benchmark::Counter(1e-9 * flops, benchmark::Counter::kIsIterationInvariantRate);
}
/// In 128 dimensions with 192 targets, pairs left out together: as a fit has it, of fewer points.
void ridge(benchmark::State& state) {
  const std::size_t n = static_cast<std::size_t>(state.range(0)), dimensions = 128, targets = 192;
  const Random random(n, 0, random_stage("bench ridge"));
  std::vector<double> points(n * dimensions), values(n * targets);
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = random.normal(i) / 16;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = random.normal(points.size() + i);
  SerialExecutor executor;
  for (auto _ : state) {
    const std::optional<KernelRidge> fit =
        kernel_ridge(std::span<const double>(points), std::span<const double>(values), n, 0.01, executor, 2);
    if (!fit) state.SkipWithError("no fit");
    benchmark::DoNotOptimize(fit);
  }
  state.counters["points"] = benchmark::Counter(static_cast<double>(n), benchmark::Counter::kIsIterationInvariantRate);
}
void eigenpairs(benchmark::State& state, bool peer) {
  const std::size_t n = static_cast<std::size_t>(state.range(0));
  const std::vector<double> matrix = decades(n);
  std::vector<double> values, vectors;
  for (auto _ : state) {
    if (peer) {
      const Eigen::Map<const Eigen::MatrixXd> view(matrix.data(), state.range(0), state.range(0));
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(view);
      values.assign(solver.eigenvalues().data(), solver.eigenvalues().data() + n);
      std::reverse(values.begin(), values.end());
    } else {
      std::vector<double> work = matrix;
      symmetric_eigen(work, n, values, vectors);
    }
  }
  double worst = 0;
  for (std::size_t k = 0; k < n; ++k) worst = std::max(worst, std::abs(values[k] / decade(k, n) - 1));
  state.counters["relative error"] = worst;
}

}  // namespace

BENCHMARK_CAPTURE(gram, own, false)->Arg(16384)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(gram, eigen, true)->Arg(16384)->Unit(benchmark::kMillisecond);
BENCHMARK(ridge)->Arg(512)->Arg(1024)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(cholesky, own, false)->Arg(64)->Arg(256)->Arg(1024)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(cholesky, eigen, true)->Arg(64)->Arg(256)->Arg(1024)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(eigenpairs, own, false)->Arg(64)->Arg(128)->Arg(320)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(eigenpairs, eigen, true)->Arg(64)->Arg(128)->Arg(320)->Unit(benchmark::kMillisecond);
