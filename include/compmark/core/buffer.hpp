// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Growing scratch memory. A Buffer never shrinks and never initialises, so that after warm-up an iteration allocates
// nothing.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

#include "compmark/core/huge_pages.hpp"

namespace compmark {

/// 64-byte aligned storage of trivial values, grow-only. The capacity is padded by one cache line, so that a kernel may
/// load or store a whole 64-byte pack that starts at any element of the buffer.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>, "Buffer holds plain values: it moves them as bytes");

 public:
  Buffer() = default;
  explicit Buffer(std::size_t count) { resize(count); }
  Buffer(const Buffer& other) { *this = other; }
  Buffer(Buffer&& other) noexcept
      : data_(std::move(other.data_)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  Buffer& operator=(const Buffer& other) {
    if (this != &other) {
      resize(other.size_);
      for (std::size_t i = 0; i < size_; ++i) data()[i] = other.data()[i];
    }
    return *this;
  }
  Buffer& operator=(Buffer&& other) noexcept {
    data_ = std::move(other.data_);
    size_ = std::exchange(other.size_, 0);
    capacity_ = std::exchange(other.capacity_, 0);
    return *this;
  }
  ~Buffer() = default;

  /// Sets the size. New memory is taken only above the capacity, with half as much again to spare; the contents are
  /// then lost. Without memory std::bad_alloc is thrown and the buffer is empty.
  void resize(std::size_t count) {
    if (count > capacity_) {
      const std::size_t wanted = with_spare(count);
      data_.reset();
      size_ = 0;  // as the capacity: what is left where there is no memory is an empty buffer
      capacity_ = 0;
      data_.reset(static_cast<T*>(::operator new (wanted * sizeof(T) + alignment, std::align_val_t{alignment})));
      detail::prefer_huge_pages(data_.get(), wanted * sizeof(T));
      capacity_ = wanted;
    }
    size_ = count;
  }
  void resize(std::size_t count, T value) {
    resize(count);
    for (std::size_t i = 0; i < count; ++i) data()[i] = value;
  }
  /// Grows to `count` and keeps the contents; what is new becomes `value`. Memory is taken as by resize(), so that
  /// growing a little many times costs a constant a value.
  void extend(std::size_t count, T value) {
    if (count > capacity_) {
      Buffer grown(with_spare(count));
      std::copy_n(data(), size_, grown.data());
      grown.size_ = size_;
      *this = std::move(grown);
    }
    for (std::size_t i = size_; i < count; ++i) data()[i] = value;
    size_ = count;
  }

  [[nodiscard]] T* data() { return data_.get(); }
  [[nodiscard]] const T* data() const { return data_.get(); }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t capacity_bytes() const { return capacity_ * sizeof(T); }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] T& operator[](std::size_t i) { return data_.get()[i]; }
  [[nodiscard]] const T& operator[](std::size_t i) const { return data_.get()[i]; }
  [[nodiscard]] std::span<T> span() { return {data(), size_}; }
  [[nodiscard]] std::span<const T> span() const { return {data(), size_}; }
  [[nodiscard]] T* begin() { return data(); }
  [[nodiscard]] T* end() { return data() + size_; }
  [[nodiscard]] const T* begin() const { return data(); }
  [[nodiscard]] const T* end() const { return data() + size_; }

  static constexpr std::size_t alignment = alignof(T) > 64 ? alignof(T) : 64;

 private:
  [[nodiscard]] std::size_t with_spare(std::size_t count) const { return std::max(count, capacity_ + capacity_ / 2); }
  struct Free {
    void operator()(T* pointer) const { ::operator delete (pointer, std::align_val_t{alignment}); }
  };
  std::unique_ptr<T, Free> data_;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

}  // namespace compmark
