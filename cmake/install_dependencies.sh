#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Installs what is missing on Debian and Ubuntu (with sudo where needed); elsewhere names the packages. Argument "ci" adds the tools of .ci/run.
set -eu

optional="libzstd-dev libwebp-dev" # SPZ 4, and SOG files with WebP images
needed="g++ cmake ninja-build pkg-config git libeigen3-dev libstb-dev nlohmann-json3-dev libnanoflann-dev libcli11-dev doctest-dev libbenchmark-dev libxtensor-dev"
if [ "${1:-}" = ci ]; then
  needed="$needed clang-14 clang-format-14 libclang-rt-14-dev libomp-14-dev libtbb-dev ccache valgrind universal-ctags"
  optional="$optional chromium-headless-shell python3-numpy mandoc doxygen" # what needs them is skipped without
fi

if ! command -v dpkg-query >/dev/null 2>&1 || ! command -v apt-get >/dev/null 2>&1; then
  for tool in c++ cmake ninja; do
    if ! command -v "$tool" >/dev/null 2>&1; then
      echo "compmark: $tool is missing. Needed: a C++20 compiler (g++ 12 or clang 14, or newer), CMake 3.25, Ninja, and the libraries" >&2
      echo "  Eigen 3.4, stb, nlohmann-json 3, nanoflann, CLI11, doctest, Google Benchmark, xtensor" >&2
      echo "  (Fedora: gcc-c++ cmake ninja-build eigen3-devel stb-devel json-devel nanoflann-devel cli11-devel doctest-devel google-benchmark-devel xtensor-devel;" >&2
      echo "   macOS with Homebrew: cmake ninja eigen nlohmann-json nanoflann cli11 doctest google-benchmark xtensor)." >&2
      exit 1
    fi
  done
  exit 0 # a library that is missing is fetched by CMake
fi

is_installed() { dpkg-query -W -f='${Status}' "$1" 2>/dev/null | grep -q "ok installed"; }
missing=""
for package in $needed; do
  is_installed "$package" || missing="$missing $package"
done
wanted=""
for package in $optional; do # a package that this system does not know is not asked for
  is_installed "$package" || ! apt-cache show "$package" >/dev/null 2>&1 || wanted="$wanted $package"
done
[ -z "$missing$wanted" ] && exit 0

echo "compmark: installing$missing$wanted"
run=""
if [ "$(id -u)" -ne 0 ]; then
  if command -v sudo >/dev/null 2>&1; then
    run="sudo"
  elif [ -n "$missing" ]; then
    echo "compmark: these packages are missing and there is no sudo to install them with:$missing" >&2
    exit 1
  else
    exit 0
  fi
fi
export DEBIAN_FRONTEND=noninteractive
# shellcheck disable=SC2086 # words on purpose
install() { $run apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1; }
# shellcheck disable=SC2086 # words on purpose
if [ -n "$missing" ] && ! install $missing; then
  $run apt-get update -qq
  $run apt-get install -y -qq --no-install-recommends $missing >/dev/null
fi
for package in $wanted; do
  install "$package" || echo "compmark: $package could not be installed, what needs it is left out"
done
