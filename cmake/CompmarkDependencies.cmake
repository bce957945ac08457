# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Installed packages first (Debian 12 has them all); where one is missing and COMPMARK_FETCH_DEPENDENCIES is on, a pinned release.
include(FetchContent)
set(FETCHCONTENT_QUIET ON)

# compmark_dependency(<package> <target> <git url> <tag> [find_package arguments...]): afterwards <target> exists.
function(compmark_dependency package target url tag)
  if(TARGET ${target})
    return()
  endif()
  find_package(${package} ${ARGN} QUIET GLOBAL)
  if(TARGET ${target})
    return()
  endif()
  if(NOT COMPMARK_FETCH_DEPENDENCIES)
    message(FATAL_ERROR "compmark needs ${package}: install it (Debian, Ubuntu: sh cmake/install_dependencies.sh) "
                        "or set COMPMARK_FETCH_DEPENDENCIES=ON")
  endif()
  message(STATUS "compmark: ${package} is not installed, fetching ${tag} of ${url}")
  string(TOLOWER ${package} name)
  FetchContent_Declare(${name} GIT_REPOSITORY ${url} GIT_TAG ${tag} GIT_SHALLOW ON SYSTEM)
  FetchContent_MakeAvailable(${name})
endfunction()

# What the fetched projects would otherwise build.
foreach(switch BUILD_TESTING EIGEN_BUILD_DOC EIGEN_BUILD_TESTING EIGEN_BUILD_PKGCONFIG NANOFLANN_BUILD_EXAMPLES
               NANOFLANN_BUILD_TESTS JSON_BuildTests BENCHMARK_ENABLE_TESTING BENCHMARK_ENABLE_INSTALL DOCTEST_WITH_TESTS
               CLI11_BUILD_TESTS CLI11_BUILD_EXAMPLES)
  if(NOT DEFINED ${switch})
    set(${switch} OFF)
  endif()
endforeach()

# Our targets are exported with what they link, so a fetched json has to be installed where they are; it is not by default where it is no project of its own.
if(NOT DEFINED JSON_Install)
  set(JSON_Install ${COMPMARK_INSTALL})
endif()

find_package(Threads REQUIRED)
compmark_dependency(Eigen3 Eigen3::Eigen https://gitlab.com/libeigen/eigen.git 3.4.0)
compmark_dependency(nlohmann_json nlohmann_json::nlohmann_json https://github.com/nlohmann/json.git v3.11.3)
compmark_dependency(nanoflann nanoflann::nanoflann https://github.com/jlblancoc/nanoflann.git v1.5.5)

# stb has no package file: COMPMARK_STB_INCLUDE_DIR is the folder that holds stb/stb_image.h and stb/stb_image_write.h.
find_path(COMPMARK_STB_INCLUDE_DIR stb/stb_image_write.h DOC "Folder that holds stb/stb_image.h and stb/stb_image_write.h")
if(NOT COMPMARK_STB_INCLUDE_DIR AND COMPMARK_FETCH_DEPENDENCIES)
  message(STATUS "compmark: stb is not installed, fetching it")
  FetchContent_Declare(stb GIT_REPOSITORY https://github.com/nothings/stb.git GIT_TAG 8b5f1f37b5b75829fc72d38e7b5d4bcbf8a26d55
                       SOURCE_DIR "${PROJECT_BINARY_DIR}/_deps/stb_parent/stb")
  FetchContent_GetProperties(stb)
  if(NOT stb_POPULATED)
    FetchContent_Populate(stb)
  endif()
  set(COMPMARK_STB_INCLUDE_DIR "${PROJECT_BINARY_DIR}/_deps/stb_parent" CACHE PATH "" FORCE)
endif()
if(NOT COMPMARK_STB_INCLUDE_DIR)
  message(FATAL_ERROR "compmark needs stb_image.h and stb_image_write.h: install stb (Debian, Ubuntu: libstb-dev) "
                      "or set COMPMARK_STB_INCLUDE_DIR")
endif()
if(NOT TARGET compmark::stb)
  add_library(compmark::stb INTERFACE IMPORTED GLOBAL)
  target_include_directories(compmark::stb SYSTEM INTERFACE "${COMPMARK_STB_INCLUDE_DIR}")
endif()

# Optional: each is a component of its own, with one header.
find_package(TBB QUIET)
find_package(OpenMP QUIET COMPONENTS CXX)
find_package(xtensor QUIET)
include(CompmarkOptionalLibrary)
