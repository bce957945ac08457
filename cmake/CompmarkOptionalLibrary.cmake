# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Libraries that compmark::compmark links where they are found, so that every file of a program reads and writes what they are for; without them such files
# are refused in words. Each has an option COMPMARK_WITH_<NAME>, a target compmark::lib<name> and a macro COMPMARK_WITH_<NAME>.
#   libzstd  SPZ 4 (include/compmark/io/splat/inflate.hpp, deflate.hpp)
#   libwebp  WebP images of SOG files (include/compmark/io/splat/sog_image.hpp); without it they have PNG images

# compmark_optional_library(<name> <header> <what it is for> <what is said where it is missing>)
function(compmark_optional_library name header purpose missing)
  string(TOUPPER ${name} upper)
  option(COMPMARK_WITH_${upper} "${purpose} through lib${name}, where it is found" ON)
  if(NOT COMPMARK_WITH_${upper} OR TARGET compmark::lib${name})
    return()
  endif()
  find_path(COMPMARK_${upper}_INCLUDE_DIR ${header} DOC "Folder that holds ${header}")
  find_library(COMPMARK_${upper}_LIBRARY ${name} DOC "lib${name}")
  if(NOT COMPMARK_${upper}_INCLUDE_DIR OR NOT COMPMARK_${upper}_LIBRARY)
    message(STATUS "compmark: lib${name} was not found, so that ${missing} (Debian, Ubuntu: lib${name}-dev)")
    return()
  endif()
  add_library(compmark::lib${name} INTERFACE IMPORTED GLOBAL)
  target_include_directories(compmark::lib${name} SYSTEM INTERFACE "${COMPMARK_${upper}_INCLUDE_DIR}")
  target_link_libraries(compmark::lib${name} INTERFACE "${COMPMARK_${upper}_LIBRARY}")
  target_compile_definitions(compmark::lib${name} INTERFACE COMPMARK_WITH_${upper})
endfunction()

compmark_optional_library(zstd zstd.h "Read and write SPZ 4" "SPZ 4 is not read")
compmark_optional_library(webp webp/encode.h "Read and write WebP images of SOG files" "SOG files have PNG images alone")
