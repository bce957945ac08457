#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Builds and runs tests/consumer/consumer.cpp three ways against a fresh install prefix, and the projects of examples/embedding.
#   run.sh <build folder of the project> [find_package|add_subdirectory|pkg_config|embedding]
set -eu
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "$1" && pwd)
way=${2:-all}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
compiler=${CXX:-c++}

if [ "$way" != add_subdirectory ]; then
  cmake --install "$build" --prefix "$scratch/prefix" >/dev/null
  # The installed files name no path of the build or the source.
  if grep -rIl -e "$build" -e "$here" "$scratch/prefix"; then
    echo "installed files name paths of this build"
    exit 1
  fi
  mv "$scratch/prefix" "$scratch/moved" # a prefix can be moved
fi
for kind in find_package add_subdirectory; do
  [ "$way" = "$kind" ] || [ "$way" = all ] || continue
  cmake -S "$here/$kind" -B "$scratch/$kind" -G Ninja -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_PREFIX_PATH="$scratch/moved" >"$scratch/log" 2>&1 ||
    { cat "$scratch/log"; exit 1; }
  cmake --build "$scratch/$kind" >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
  "$scratch/$kind/consumer"
done
if [ "$way" = pkg_config ] || [ "$way" = all ]; then
  PKG_CONFIG_PATH="$scratch/moved/share/pkgconfig${PKG_CONFIG_PATH:+:$PKG_CONFIG_PATH}"
  export PKG_CONFIG_PATH
  # shellcheck disable=SC2046 # words on purpose
  "$compiler" "$here/consumer.cpp" -o "$scratch/consumer" $(pkg-config --cflags --libs compmark)
  "$scratch/consumer"
fi
if [ "$way" = embedding ] || [ "$way" = all ]; then
  project="$here/../../examples/embedding"
  cmake -S "$project" -B "$scratch/embedding" -G Ninja -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_PREFIX_PATH="$scratch/moved" \
    -DCMAKE_CXX_FLAGS="-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror" >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
  cmake --build "$scratch/embedding" >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
  # Who only decodes reads no header of a rasterizer, nor of anything that trains.
  ninja -C "$scratch/embedding" -t deps CMakeFiles/read_compressed.dir/read_compressed.cpp.o >"$scratch/deps"
  grep -q 'compmark/codec/cmk.hpp' "$scratch/deps" || { echo "the list of headers is empty"; exit 1; }
  if grep -E 'compmark/(raster|anchor|loss|effect|optim|pipeline|recipes|mark)/' "$scratch/deps"; then
    echo "read_compressed reads more than the codec"
    exit 1
  fi
  "$scratch/embedding/read_compressed" "$here/../golden/codec/hac_small.cmk"
  "$scratch/embedding/read_compressed" "$here/../golden/codec/context_gs_small.cmk"
  "$scratch/embedding/mark_in_memory"
fi
