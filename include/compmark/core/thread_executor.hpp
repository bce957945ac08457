// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A pool of std::threads. Chunks are handed out by an atomic counter: who runs a chunk varies, what a chunk is does not
// (law E2).
//
// A loop is over when its chunks are done, not when every worker has said so: a worker that the system has no processor
// for is not waited for unless it came in. (Waiting for all, short loops by two threads took 31 times as long as by one
// beside two busy programs on two cores, and 24 times beside four; docs/notebook/measured.md.)
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
#include "compmark/core/processors.hpp"

namespace compmark {

namespace detail {
/// Tells the processor that this is a waiting loop: it leaves its shared parts to the other thread of the core.
inline void spin_pause() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}
}  // namespace detail

/// Persistent pool; the calling thread is worker 0. One loop runs at a time; loops do not nest (a nested call runs
/// serially in place). Workers spin for some microseconds before they sleep, because the loops of one training
/// iteration follow each other closely; one that came too late for a loop spins no more until it is in time again.
class ThreadExecutor {
 public:
  /// threads = 0 takes available_processors(). Where the system does not give as many (limits of processes or of memory)
  /// there are fewer, which concurrency() says, and nothing is thrown.
  explicit ThreadExecutor(std::size_t threads = 0) {
    const std::size_t processors = available_processors();
    if (!start(threads != 0 ? threads : processors) && workers_.size() >= processors) {
      // Their stacks may have taken all the memory there is, and more than there are processors are of no use.
      end();
      static_cast<void>(start(processors));
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
    job_ = job;  // nobody is inside: the gate is shut
    next_.store(0, std::memory_order_relaxed);
    gate_.store(gate_open, std::memory_order_release);
    generation_.fetch_add(1, std::memory_order_release);
    generation_.notify_all();
    work(0);
    // Nothing is left to hand out. Who is inside has a chunk or leaves at once; who comes now finds the gate shut.
    std::uint32_t inside = gate_.fetch_and(~gate_open, std::memory_order_acq_rel) & ~gate_open;
    for (int spin = 0; inside != 0; ++spin) {
      if (spin < spin_limit) {
        detail::spin_pause();
      } else {
        gate_.wait(inside, std::memory_order_acquire);
      }
      inside = gate_.load(std::memory_order_acquire);
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

  /// False where the loop is over already.
  [[nodiscard]] bool enter() {
    std::uint32_t gate = gate_.load(std::memory_order_relaxed);
    while ((gate & gate_open) != 0) {
      if (gate_.compare_exchange_weak(gate, gate + 1, std::memory_order_acquire, std::memory_order_relaxed))
        return true;
    }
    return false;
  }
  void leave() {
    if (gate_.fetch_sub(1, std::memory_order_acq_rel) == 1) gate_.notify_one();  // shut, and the last
  }

  void serve(std::size_t worker) {
    std::uint32_t seen = 0;
    int patience = spin_limit;
    for (;;) {
      for (int spin = 0; generation_.load(std::memory_order_acquire) == seen; ++spin) {
        if (spin < patience) {
          detail::spin_pause();
        } else {
          generation_.wait(seen, std::memory_order_acquire);
        }
      }
      seen = generation_.load(std::memory_order_acquire);
      if (stopping_.load()) return;
      if (!enter()) {
        patience = 0;
        continue;
      }
      work(worker);
      leave();
      patience = std::min(spin_limit, patience + spin_limit / 8);
    }
  }

  static constexpr std::uint32_t gate_open = std::uint32_t{1} << 31;  // below it: how many workers are inside
  static constexpr int spin_limit = 2000;

  std::size_t concurrency_ = 1;
  std::vector<std::thread> workers_;
  Job job_;
  // On cache lines of their own: the counter is written for every chunk, the others once a loop. 32 bits are what
  // atomic waiting needs no table for.
  alignas(128) std::atomic<std::size_t> next_{0};
  alignas(128) std::atomic<std::uint32_t> gate_{0};
  alignas(128) std::atomic<std::uint32_t> generation_{0};
  alignas(128) std::atomic<bool> busy_{false};
  std::atomic<bool> stopping_{false};
  std::mutex failure_mutex_;
  std::exception_ptr failure_;
};

}  // namespace compmark
