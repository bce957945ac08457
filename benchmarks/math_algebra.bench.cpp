// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The algebra of a fit, Cholesky factors (GFLOP/s) and eigenpairs (largest relative error over eigenvalues that span
// eight decades), and what Eigen takes for the same. One thread. Eigen is faster; docs/rationale.md says why it is not
// what the library uses.
#pragma GCC diagnostic ignored \
    "-Wmaybe-uninitialized"  // false in g++ 12's own AVX-512 header, once Eigen's products are inlined
#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/math/cholesky.hpp"
#include "compmark/math/eigen_pairs.hpp"

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

BENCHMARK_CAPTURE(cholesky, own, false)->Arg(64)->Arg(256)->Arg(1024)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(cholesky, eigen, true)->Arg(64)->Arg(256)->Arg(1024)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(eigenpairs, own, false)->Arg(64)->Arg(128)->Arg(320)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(eigenpairs, eigen, true)->Arg(64)->Arg(128)->Arg(320)->Unit(benchmark::kMillisecond);
