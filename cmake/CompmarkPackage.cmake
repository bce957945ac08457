# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Debian packages by "cpack -G DEB": compmark (the tool) and libcompmark-dev (the library), docs/packaging.md. A package that is given to others is built
# with the preset "package"; whoever builds it gives an address by -DCPACK_PACKAGE_CONTACT="Name <address>".
set(CPACK_PACKAGE_VENDOR "The CompMark authors")
if(NOT CPACK_PACKAGE_CONTACT)
  set(CPACK_PACKAGE_CONTACT "The CompMark authors <noreply@example.org>")
endif()
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "") # each package has its own
set(CPACK_RESOURCE_FILE_LICENSE "${PROJECT_SOURCE_DIR}/LICENSE")
set(CPACK_GENERATOR TGZ)
set(CPACK_SOURCE_IGNORE_FILES "/build/;/\\.git/")
set(CPACK_STRIP_FILES ON)
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(CPACK_COMPONENTS_ALL compmark_dev)
if(TARGET compmark_tool)
  list(PREPEND CPACK_COMPONENTS_ALL compmark_tool)
endif()
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)

set(CPACK_DEBIAN_COMPMARK_TOOL_PACKAGE_NAME compmark)
set(CPACK_DEBIAN_COMPMARK_TOOL_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_COMPMARK_TOOL_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_COMPMARK_TOOL_DESCRIPTION "train, mark and compress 3D Gaussian splats on the CPU
The compmark tool trains anchor-based 3D Gaussian splats from photographs
with known cameras, hides the message of an owner in them, writes them as one
small file, and tests whether the message is in a model or in pictures of it,
with a p-value. It needs no GPU.")
string(TOUPPER "${CMAKE_BUILD_TYPE}" build_type)
if("${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${build_type}}" MATCHES "-march=x86-64-v3") # what an older processor would say is "illegal instruction"
  set(CPACK_DEBIAN_COMPMARK_TOOL_PACKAGE_CONTROL_EXTRA "${PROJECT_SOURCE_DIR}/packaging/debian/preinst")
  set(CPACK_DEBIAN_COMPMARK_TOOL_PACKAGE_CONTROL_STRICT_PERMISSION ON)
endif()

# What compmark-config.cmake asks for; then what it takes where it is found.
set(CPACK_DEBIAN_COMPMARK_DEV_PACKAGE_NAME libcompmark-dev)
set(CPACK_DEBIAN_COMPMARK_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_COMPMARK_DEV_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_COMPMARK_DEV_PACKAGE_DEPENDS "libeigen3-dev, libnanoflann-dev, libstb-dev, nlohmann-json3-dev")
set(CPACK_DEBIAN_COMPMARK_DEV_PACKAGE_SUGGESTS "libtbb-dev, libwebp-dev, libxtensor-dev, libzstd-dev")
set(CPACK_DEBIAN_COMPMARK_DEV_DESCRIPTION "train, mark and compress 3D Gaussian splats (headers)
The header-only C++20 library behind the compmark tool, with its CMake and
pkg-config files. It trains and renders splats, hides and reads messages in
them, and writes and reads compressed files.")

# Each package has its copyright where Debian looks for it; a plain "cmake --install" has LICENSE instead.
if(TARGET compmark_tool)
  install(FILES "${PROJECT_SOURCE_DIR}/packaging/debian/copyright" DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/compmark"
          COMPONENT compmark_tool EXCLUDE_FROM_ALL)
endif()
install(FILES "${PROJECT_SOURCE_DIR}/packaging/debian/copyright" DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/libcompmark-dev"
        COMPONENT compmark_dev EXCLUDE_FROM_ALL)
include(CPack)
