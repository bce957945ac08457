# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# libzstd, where it is found and COMPMARK_WITH_ZSTD is on: target compmark::libzstd, which compmark::compmark then links, so that every file of a program
# reads and writes SPZ 4 (include/compmark/io/splat/inflate.hpp, deflate.hpp). Without it such a file is refused in words, and all others are read.
option(COMPMARK_WITH_ZSTD "Read and write SPZ 4 through libzstd, where it is found" ON)
if(COMPMARK_WITH_ZSTD AND NOT TARGET compmark::libzstd)
  find_path(COMPMARK_ZSTD_INCLUDE_DIR zstd.h DOC "Folder that holds zstd.h")
  find_library(COMPMARK_ZSTD_LIBRARY zstd DOC "libzstd")
  if(COMPMARK_ZSTD_INCLUDE_DIR AND COMPMARK_ZSTD_LIBRARY)
    add_library(compmark::libzstd INTERFACE IMPORTED GLOBAL)
    target_include_directories(compmark::libzstd SYSTEM INTERFACE "${COMPMARK_ZSTD_INCLUDE_DIR}")
    target_link_libraries(compmark::libzstd INTERFACE "${COMPMARK_ZSTD_LIBRARY}")
    target_compile_definitions(compmark::libzstd INTERFACE COMPMARK_WITH_ZSTD)
  else()
    message(STATUS "compmark: libzstd was not found, so that SPZ 4 is not read (Debian, Ubuntu: libzstd-dev)")
  endif()
endif()
