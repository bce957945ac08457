#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Builds and runs tests/consumer/consumer.cpp three ways against a fresh install prefix, and the projects of examples/embedding. "folders" installs the project
# anew into folders that lie outside of its prefix.
#   run.sh <build folder of the project> [find_package|add_subdirectory|pkg_config|folders|embedding]
set -eu
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "$1" && pwd)
way=${2:-all}
# Of one name beside the build, not a temporary one: a compiler cache knows the compilations then, two minutes of them.
scratch="$build/consumer/$way"
rm -rf "$scratch"
mkdir -p "$scratch"
trap 'rm -rf "$scratch"' EXIT
compiler=${CXX:-c++}
cached=$(command -v ccache || true)
[ -z "$cached" ] || export CMAKE_CXX_COMPILER_LAUNCHER="$cached"

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
  # The project round ours has no cache of its own: whether we would give it one is what is tested.
  without=
  [ "$kind" = find_package ] || without="env -u CMAKE_CXX_COMPILER_LAUNCHER"
  $without cmake -S "$here/$kind" -B "$scratch/$kind" -G Ninja -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_PREFIX_PATH="$scratch/moved" >"$scratch/log" 2>&1 ||
    { cat "$scratch/log"; exit 1; }
  cmake --build "$scratch/$kind" >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
  "$scratch/$kind/consumer"
  [ "$kind" = find_package ] || continue
  # What is linked with compmark::app decodes a file, and says of a codec's test file without a recipe what it lacks.
  if "$scratch/$kind/viewer" "$here/../golden/codec/hac_small.cmk" "$scratch/view.png" 2>"$scratch/words"; then
    echo "viewer rendered a file that has no recipe"
    exit 1
  fi
  grep -q 'META.recipe: is missing' "$scratch/words" || { cat "$scratch/words"; exit 1; }
done
if [ "$way" = pkg_config ] || [ "$way" = all ]; then
  PKG_CONFIG_PATH="$scratch/moved/share/pkgconfig${PKG_CONFIG_PATH:+:$PKG_CONFIG_PATH}"
  export PKG_CONFIG_PATH
  # shellcheck disable=SC2046 # words on purpose
  $cached "$compiler" -c "$here/consumer.cpp" -o "$scratch/consumer.o" $(pkg-config --cflags compmark)
  # shellcheck disable=SC2046 # words on purpose
  "$compiler" "$scratch/consumer.o" -o "$scratch/consumer" $(pkg-config --libs compmark)
  "$scratch/consumer"
fi
if [ "$way" = folders ] || [ "$way" = all ]; then
  # Each folder that GNUInstallDirs names may be given as an absolute one. Nothing is built: what would be is optional.
  away="$scratch/away"
  cmake -S "$here/../.." -B "$scratch/folders" -G Ninja -DCMAKE_CXX_COMPILER="$compiler" -DCOMPMARK_BUILD_TESTS=OFF -DCOMPMARK_BUILD_BENCHMARKS=OFF \
    -DCMAKE_INSTALL_PREFIX="$scratch/own" -DCMAKE_INSTALL_LIBDIR="$away/libraries" -DCMAKE_INSTALL_INCLUDEDIR="$away/headers" \
    -DCMAKE_INSTALL_DATADIR="$away/data" >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
  cmake --install "$scratch/folders" >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
  mkdir "$scratch/asks"
  cat >"$scratch/asks/CMakeLists.txt" <<'ASKS'
cmake_minimum_required(VERSION 3.25)
project(asks CXX)
find_package(compmark REQUIRED)
file(WRITE "${CMAKE_BINARY_DIR}/asks.cpp" "#include <compmark/version.hpp>\nint main() { return *compmark::version == 0; }\n")
add_executable(asks "${CMAKE_BINARY_DIR}/asks.cpp")
target_link_libraries(asks PRIVATE compmark::compmark)
get_target_property(sources compmark_app SOURCES)
foreach(source IN LISTS sources)
  if(NOT EXISTS "${source}")
    message(FATAL_ERROR "compmark::app lacks ${source}")
  endif()
endforeach()
ASKS
  cmake -S "$scratch/asks" -B "$scratch/asks/build" -G Ninja -DCMAKE_CXX_COMPILER="$compiler" -Dcompmark_DIR="$away/data/cmake/compmark" >"$scratch/log" 2>&1 ||
    { cat "$scratch/log"; exit 1; }
  cmake --build "$scratch/asks/build" >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
  "$scratch/asks/build/asks"
  # shellcheck disable=SC2046 # words on purpose
  PKG_CONFIG_PATH="$away/data/pkgconfig${PKG_CONFIG_PATH:+:$PKG_CONFIG_PATH}" "$compiler" -fsyntax-only "$scratch/asks/build/asks.cpp" \
    $(PKG_CONFIG_PATH="$away/data/pkgconfig${PKG_CONFIG_PATH:+:$PKG_CONFIG_PATH}" pkg-config --cflags compmark)
  # The Python module takes the library from its folder, wherever that is. An empty one stands for it, which it names as it fails to load it.
  mkdir -p "$away/libraries"
  : >"$away/libraries/libcompmark.so.1"
  for python in python3 /usr/bin/python3; do # one of one's own may be before the system's, which has numpy
    "$python" -c 'import numpy' 2>/dev/null || continue
    words=$(env -u COMPMARK_LIBRARY PYTHONPATH="$scratch/own/lib/python3/dist-packages" PYTHONDONTWRITEBYTECODE=1 "$python" -c 'import compmark' 2>&1 || true)
    echo "$words" | grep -qF "$away/libraries/libcompmark.so.1" || { echo "the Python module looks for the library elsewhere: $words"; exit 1; }
  done
fi
if [ "$way" = embedding ] || [ "$way" = all ]; then
  project="$here/../../examples/embedding"
  cmake -S "$project" -B "$scratch/embedding" -G Ninja -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_PREFIX_PATH="$scratch/moved" \
    -DCMAKE_CXX_FLAGS="-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror" >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
  cmake --build "$scratch/embedding" >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
  # Who only decodes reads the codec, what all share, files, and of the context models the half that computes in integers: no rasterizer, no data set, no
  # floating-point context, nothing that trains. What is allowed is named, so that a new header of training is seen wherever it lies.
  allowed='compmark/((core|io)/(detail/)?[a-z0-9_]+|math/morton|codec/(coder|container|integer)/[a-z0-9_]+'
  allowed="$allowed|codec/context_gs/(anchor_levels|context_gs_(context|decoder|encoder|format|integers|prior))"
  allowed="$allowed|codec/hac/(hac_(context|decoder|encoder|format)|hash_grid_layout)"
  allowed="$allowed|codec/hac_plus/(coarse_coding|hac_plus_(coding|decoder|encoder|format)|intra_fit))\.hpp\$"
  headers_of() { ninja -C "$scratch/embedding" -t deps "CMakeFiles/$1.dir/$1.cpp.o" | sed -n 's|.*/include/\(compmark/.*\)|\1|p' | sort -u; }
  headers_of read_compressed >"$scratch/headers"
  grep -q 'compmark/codec/container/cmk.hpp' "$scratch/headers" || { echo "the list of headers is empty"; exit 1; }
  if grep -vE "$allowed" "$scratch/headers"; then
    echo "read_compressed reads more than the codec"
    exit 1
  fi
  # What of the library is in the program: names of functions and types, the standard library's of our types among them. NearAnchors is the codec's.
  trains='compmark::.*(Trainer|Training|[Rr]aster|[Pp]ipeline|Adam|[Bb]ackward|[Gg]radient|Loss|Anchors|HashGrid<|Embedder|Distortion)'
  names_of() { nm -C --defined-only "$scratch/embedding/$1" | cut -d ' ' -f 3- | grep 'compmark::' | sed 's/NearAnchors/Near/g' | sort -u; }
  names_of read_compressed >"$scratch/names"
  grep -q 'compmark::.*[Dd]ecode' "$scratch/names" || { echo "the list of names is empty"; exit 1; }
  if grep -E "$trains" "$scratch/names"; then
    echo "read_compressed holds code of training"
    exit 1
  fi
  # Control: both would have seen the program that trains, by headers of every kind and by its code.
  headers_of mark_in_memory | grep -vE "$allowed" >"$scratch/foreign" || true
  for header in splat/raster/tile splat/training/trainer splat/optim/adam splat/loss/l1 splat/anchor/growth watermark/embed/residual \
    watermark/embed/distortion scene/dataset metric/psnr codec/hac/hac_model codec/context_gs/context_gs_model codec/hac/hash_grid math/dense; do
    grep -qx "compmark/$header.hpp" "$scratch/foreign" || { echo "the control's compmark/$header.hpp was not seen"; exit 1; }
  done
  names_of mark_in_memory | grep -E "$trains" >"$scratch/foreign" || true
  for name in Trainer Raster Pipeline ackward; do
    grep -q "$name" "$scratch/foreign" || { echo "the control's code of $name was not seen"; exit 1; }
  done
  "$scratch/embedding/read_compressed" "$here/../golden/codec/hac_small.cmk"
  "$scratch/embedding/read_compressed" "$here/../golden/codec/context_gs_small.cmk"
  "$scratch/embedding/mark_in_memory"
fi
