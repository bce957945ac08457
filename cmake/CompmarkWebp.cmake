# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# libwebp, where it is found and COMPMARK_WITH_WEBP is on: target compmark::libwebp, which compmark::compmark then links, so that every file of a program
# reads and writes SOG files of WebP images (include/compmark/io/splat/sog_image.hpp). Without it they have PNG images, and others are refused in words.
option(COMPMARK_WITH_WEBP "Read and write WebP images of SOG files through libwebp, where it is found" ON)
if(COMPMARK_WITH_WEBP AND NOT TARGET compmark::libwebp)
  find_path(COMPMARK_WEBP_INCLUDE_DIR webp/encode.h DOC "Folder that holds webp/encode.h")
  find_library(COMPMARK_WEBP_LIBRARY webp DOC "libwebp")
  if(COMPMARK_WEBP_INCLUDE_DIR AND COMPMARK_WEBP_LIBRARY)
    add_library(compmark::libwebp INTERFACE IMPORTED GLOBAL)
    target_include_directories(compmark::libwebp SYSTEM INTERFACE "${COMPMARK_WEBP_INCLUDE_DIR}")
    target_link_libraries(compmark::libwebp INTERFACE "${COMPMARK_WEBP_LIBRARY}")
    target_compile_definitions(compmark::libwebp INTERFACE COMPMARK_WITH_WEBP)
  else()
    message(STATUS "compmark: libwebp was not found, so that SOG files have PNG images alone (Debian, Ubuntu: libwebp-dev)")
  endif()
endif()
