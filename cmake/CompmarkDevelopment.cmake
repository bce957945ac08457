# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# What only our own tests, benchmarks and examples get: warnings, output folder, compiler cache. Nothing here reaches a consumer.
if(PROJECT_IS_TOP_LEVEL)
  set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/bin")
  set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
  if(NOT DEFINED CMAKE_CXX_COMPILER_LAUNCHER)
    find_program(COMPMARK_CCACHE ccache)
    if(COMPMARK_CCACHE)
      set(CMAKE_CXX_COMPILER_LAUNCHER "${COMPMARK_CCACHE}")
    endif()
  endif()
  # These two are longer in the compiler than anything else, and are there already.
  set_target_properties(compmark_app compmark_app_run PROPERTIES CXX_COMPILER_LAUNCHER "${CMAKE_CXX_COMPILER_LAUNCHER}")
  if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
    set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
  endif()
  # Flags are the builder's choice, here too (a package must run on other machines), but nobody should train with four lanes of sixteen unawares.
  string(TOUPPER "${CMAKE_BUILD_TYPE}" compmark_build_type)
  if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang" AND NOT "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${compmark_build_type}}" MATCHES "-march=|-mcpu=|-mavx")
    message(NOTICE "compmark: these flags are for the oldest machine of this architecture, and training takes several times as long; "
                   "\"cmake --preset release\" builds for this one (-march=native)")
  endif()
endif()

add_library(compmark_warnings INTERFACE)
if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
  # Tests instantiate packs wider than the machine's registers; no such function is ever called across files, so their ABI is nobody's.
  # g++ 12 sees an overlap of 2^63 bytes in std::string's operator+ (its bug 105651).
  target_compile_options(compmark_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-psabi
                         $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
                         $<$<BOOL:${COMPMARK_WARNINGS_AS_ERRORS}>:-Werror>)
endif()

# Two thirds of the machine code of the tool's 37 objects were the same in several of them; a group of files compiles it once.
option(COMPMARK_UNITY_BUILD "Compile the files of the tool in two groups and those of a test module in one: the whole in less than half the time, a change of one file in more" ON)

# compmark_program(<target> <sources...>): an executable of our own.
function(compmark_program target)
  add_executable(${target} ${ARGN})
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
  target_link_libraries(${target} PRIVATE compmark::compmark compmark_warnings)
endfunction()
