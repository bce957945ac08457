# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The library as an overlay port, from the tree that it lies in. A port of a registry takes a release instead, with vcpkg_from_git or vcpkg_from_github.
get_filename_component(SOURCE_PATH "${CURRENT_PORT_DIR}/../../.." ABSOLUTE)
set(VCPKG_BUILD_TYPE release) # header-only

# The headers include <stb/stb_image.h>. vcpkg's stb has had its headers in include/ and in include/stb/.
set(stb "${CURRENT_INSTALLED_DIR}/include")
if(NOT EXISTS "${stb}/stb/stb_image_write.h")
  set(stb "${CURRENT_PACKAGES_DIR}/include")
  foreach(header stb_image.h stb_image_write.h)
    file(WRITE "${stb}/stb/${header}" "#include <${header}>\n")
  endforeach()
endif()

vcpkg_cmake_configure(
  SOURCE_PATH "${SOURCE_PATH}"
  OPTIONS
    -DCOMPMARK_BUILD_TESTS=OFF
    -DCOMPMARK_BUILD_BENCHMARKS=OFF
    -DCOMPMARK_BUILD_EXAMPLES=OFF
    -DCOMPMARK_FETCH_DEPENDENCIES=OFF
    "-DCOMPMARK_STB_INCLUDE_DIR=${stb}"
)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH share/cmake/compmark)
vcpkg_fixup_pkgconfig()

# A library that was not chosen is not taken either where another port has installed it. A static libwebp does not link alone, so it can't be chosen.
foreach(library zstd webp)
  if(NOT library IN_LIST FEATURES)
    vcpkg_replace_string("${CURRENT_PACKAGES_DIR}/share/compmark/CompmarkOptionalLibrary.cmake" "\ncompmark_optional_library(${library} "
                         "\n# compmark_optional_library(${library} ")
  endif()
endforeach()
file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/share/doc")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
