#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The library alone, configured in ways that are not the usual one, installed, and found by another project:  configure.sh <project root>
# Nothing is compiled, and nothing comes from a network.
#   fetched    a dependency that is not installed is fetched (here from a folder), and installed with our targets
#   absolute   the folder of the headers is not below the prefix, as distributions give it
set -eu
root=$(cd "$1" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
fail() {
  echo "configure: $*"
  exit 1
}
# configured <name> [option]...: into build.<name>; what CMake says is in <name>.txt
configured() {
  name=$1
  shift
  cmake -S "$root" -B "$scratch/build.$name" -G Ninja -DCMAKE_INSTALL_PREFIX="$scratch/prefix.$name" -DCOMPMARK_BUILD_TESTS=OFF -DCOMPMARK_BUILD_EXAMPLES=OFF \
    -DCOMPMARK_BUILD_BENCHMARKS=OFF "$@" >"$scratch/$name.txt" 2>&1
}
# found <name> [option]...: another project finds the package, and the headers lie where each of the two ways of finding them says.
mkdir "$scratch/user"
cat >"$scratch/user/CMakeLists.txt" <<'END'
cmake_minimum_required(VERSION 3.25)
project(user LANGUAGES CXX)
find_package(compmark REQUIRED)
file(WRITE "${CMAKE_BINARY_DIR}/main.cpp" "int main() {}")
add_executable(user "${CMAKE_BINARY_DIR}/main.cpp")
target_link_libraries(user PRIVATE compmark::app)
get_target_property(folders compmark::compmark INTERFACE_INCLUDE_DIRECTORIES)
foreach(folder IN LISTS folders compmark_include_dir)
  string(REGEX REPLACE "^\\$<BUILD_INTERFACE:(.*)>$" "\\1" folder "${folder}") # of a set of headers
  if(NOT EXISTS "${folder}/compmark/compmark.hpp")
    message(FATAL_ERROR "no headers in ${folder}")
  endif()
endforeach()
END
found() {
  name=$1
  shift
  cmake --install "$scratch/build.$name" >"$scratch/log" 2>&1 || { cat "$scratch/log"; fail "$name is not installed"; }
  cmake -S "$scratch/user" -B "$scratch/user.$name" -G Ninja -DCMAKE_PREFIX_PATH="$scratch/prefix.$name" "$@" >"$scratch/log" 2>&1 ||
    { cat "$scratch/log"; fail "$name is not found"; }
  includedir=$(sed -n 's/^includedir=//p' "$scratch/prefix.$name/share/pkgconfig/compmark.pc")
  # shellcheck disable=SC2016 # pkg-config's words
  case $includedir in
    /*) ;;
    '${prefix}/'*) includedir=$(sed -n 's/^prefix=//p' "$scratch/prefix.$name/share/pkgconfig/compmark.pc")/${includedir#*/} ;;
    *) fail "compmark.pc has the folder $includedir" ;;
  esac
  # shellcheck disable=SC2016
  case $includedir in '${pcfiledir}/'*) includedir=$scratch/prefix.$name/share/pkgconfig/${includedir#*/} ;; esac
  [ -f "$includedir/compmark/compmark.hpp" ] || fail "$name: compmark.pc says $includedir, where there are no headers"
}

# What json's own project does of its installation, in a few lines.
json=$scratch/json
mkdir -p "$json/include/nlohmann"
: >"$json/include/nlohmann/json.hpp"
cat >"$json/CMakeLists.txt" <<'END'
cmake_minimum_required(VERSION 3.13)
project(nlohmann_json VERSION 3.11.3 LANGUAGES CXX)
string(COMPARE EQUAL "${CMAKE_SOURCE_DIR}" "${CMAKE_CURRENT_SOURCE_DIR}" main_project)
option(JSON_Install "Install" ${main_project})
add_library(nlohmann_json INTERFACE)
add_library(nlohmann_json::nlohmann_json ALIAS nlohmann_json)
target_include_directories(nlohmann_json INTERFACE $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:include>)
if(JSON_Install)
  install(FILES include/nlohmann/json.hpp DESTINATION include/nlohmann)
  install(TARGETS nlohmann_json EXPORT nlohmann_jsonTargets)
  install(EXPORT nlohmann_jsonTargets NAMESPACE nlohmann_json:: DESTINATION share/cmake/nlohmann_json FILE nlohmann_jsonConfig.cmake)
endif()
END
fetches="-DFETCHCONTENT_FULLY_DISCONNECTED=ON -DFETCHCONTENT_SOURCE_DIR_NLOHMANN_JSON=$json -DCMAKE_DISABLE_FIND_PACKAGE_nlohmann_json=ON"
# shellcheck disable=SC2086 # words on purpose
configured fetched $fetches || { cat "$scratch/fetched.txt"; fail "with a fetched json"; }
grep -q 'nlohmann_json is not installed, fetching' "$scratch/fetched.txt" || fail "json was not fetched, so that nothing is tested"
found fetched
[ -f "$scratch/prefix.fetched/include/nlohmann/json.hpp" ] || fail "the fetched json is not installed"
# Control: exported without it, our targets name one that nobody has.
# shellcheck disable=SC2086
if configured control $fetches -DJSON_Install=OFF; then fail "a json that is not installed is not seen"; fi
grep -q 'nlohmann_json.* not in any export set' "$scratch/control.txt" || { cat "$scratch/control.txt"; fail "another error"; }

configured absolute -DCMAKE_INSTALL_INCLUDEDIR="$scratch/headers" || { cat "$scratch/absolute.txt"; fail "with an absolute folder of headers"; }
found absolute
[ -f "$scratch/headers/compmark/compmark.hpp" ] || fail "the headers are not where they were wanted"
configured deeper -DCMAKE_INSTALL_INCLUDEDIR=include/of/splats || { cat "$scratch/deeper.txt"; fail "with another folder of headers"; }
found deeper
echo "configure: all is found"
