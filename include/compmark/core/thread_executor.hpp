// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A pool of std::threads. Chunks are handed out by an atomic counter: who runs a chunk varies, what a chunk is does not
// (law E2).
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"

namespace compmark {

/// Persistent pool; the calling thread is worker 0. One loop runs at a time; loops do not nest (a nested call runs
/// serially in place). Workers spin for a few microseconds before they sleep, because the loops of one training
/// iteration follow each other closely.
class ThreadExecutor {
 public:
  /// threads = 0 takes the hardware's number. Where the system does not give as many (limits of processes or of memory)
  /// there are fewer, which concurrency() says, and nothing is thrown.
  explicit ThreadExecutor(std::size_t threads = 0) {
    const std::size_t hardware = std::max<std::size_t>(1, std::thread::hardware_concurrency());
    if (!start(threads != 0 ? threads : hardware) && workers_.size() >= hardware) {
      // Their stacks may have taken all the memory there is, and more than there are processors are of no use.
      end();
      static_cast<void>(start(hardware));
    }
    concurrency_ = workers_.size() + 1;
  }
  ThreadExecutor(const ThreadExecutor&) = delete;
  ThreadExecutor& operator=(const ThreadExecutor&) = delete;
  ~ThreadExecutor() { end(); }

  [[nodiscard]] std::size_t concurrency() const { return concurrency_; }

  template <class Body>
  void for_chunks(std::size_t n, std::size_t grain, const Body& body) {
    if (n == 0) return;
    const Job job{&body, &run_body<Body>, n, grain};
    if (concurrency_ == 1 || n <= grain || busy_.exchange(true)) {
      for (std::size_t begin = 0; begin < n; begin += grain) job.call(job.body, begin, std::min(begin + grain, n), 0);
      return;
    }
    job_ = job;
    next_.store(0, std::memory_order_relaxed);
    pending_.store(concurrency_ - 1, std::memory_order_relaxed);
    generation_.fetch_add(1, std::memory_order_release);
    generation_.notify_all();
    work(0);
    for (int spin = 0; pending_.load(std::memory_order_acquire) != 0; ++spin) {
      if (spin < spin_limit) continue;
      const std::size_t left = pending_.load(std::memory_order_acquire);
      if (left != 0) pending_.wait(left, std::memory_order_acquire);
    }
    std::exception_ptr failure;
    std::swap(failure, failure_);
    busy_.store(false);
    if (failure) std::rethrow_exception(failure);
  }

 private:
  /// Workers up to `threads` with the caller. False if one could not be started; the others serve.
  [[nodiscard]] bool start(std::size_t threads) {
    try {
      for (std::size_t id = workers_.size() + 1; id < threads; ++id) workers_.emplace_back([this, id] { serve(id); });
    } catch (const std::exception&) {  // of std::thread, or of the vector
      return false;
    }
    return true;
  }
  void end() {
    stopping_.store(true);
    generation_.fetch_add(1);
    generation_.notify_all();
    for (std::thread& worker : workers_) worker.join();
    workers_.clear();
    stopping_.store(false);
    generation_.store(0);  // as those that are started next expect it
  }

  struct Job {
    const void* body = nullptr;
    void (*call)(const void*, std::size_t, std::size_t, std::size_t) = nullptr;
    std::size_t n = 0;
    std::size_t grain = 1;
  };

  /// One machine code of the body for every way to run it: inlined twice, a compiler may fuse multiply-adds in one copy
  /// and not in the other, and then one thread and two would differ in the last bit.
  template <class Body>
  COMPMARK_ONE_COPY static void run_body(const void* body, std::size_t begin, std::size_t end, std::size_t worker) {
    (*static_cast<const Body*>(body))(begin, end, worker);
  }

  void work(std::size_t worker) {
    try {
      for (;;) {
        const std::size_t begin = next_.fetch_add(1, std::memory_order_relaxed) * job_.grain;
        if (begin >= job_.n) return;
        job_.call(job_.body, begin, begin + job_.grain < job_.n ? begin + job_.grain : job_.n, worker);
      }
    } catch (...) {
      const std::lock_guard lock(failure_mutex_);
      if (!failure_) failure_ = std::current_exception();
      next_.store(job_.n / job_.grain + 1, std::memory_order_relaxed);  // nothing more is handed out
    }
  }

  void serve(std::size_t worker) {
    std::uint64_t seen = 0;
    for (;;) {
      for (int spin = 0; generation_.load(std::memory_order_acquire) == seen; ++spin) {
        if (spin >= spin_limit) generation_.wait(seen, std::memory_order_acquire);
      }
      seen = generation_.load(std::memory_order_acquire);
      if (stopping_.load()) return;
      work(worker);
      if (pending_.fetch_sub(1, std::memory_order_acq_rel) == 1) pending_.notify_one();
    }
  }

  static constexpr int spin_limit = 2000;

  std::size_t concurrency_ = 1;
  std::vector<std::thread> workers_;
  Job job_;
  std::atomic<std::size_t> next_{0};
  std::atomic<std::size_t> pending_{0};
  std::atomic<std::uint64_t> generation_{0};
  std::atomic<bool> busy_{false};
  std::atomic<bool> stopping_{false};
  std::mutex failure_mutex_;
  std::exception_ptr failure_;
};

}  // namespace compmark
