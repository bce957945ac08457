# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Install rules of the library, component compmark_dev: headers, exported targets, config and version files, pkg-config file. Nothing installed names a path of
# this machine. Those of the tool are in CompmarkInstallTool.cmake.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(package_dir "${CMAKE_INSTALL_DATADIR}/cmake/compmark")
# A component whose dependency is missing here is not exported; its header is installed all the same.
set(exported compmark)
foreach(entry IN LISTS COMPMARK_OPTIONAL_COMPONENTS)
  separate_arguments(entry)
  list(GET entry 0 name)
  list(GET entry 2 library)
  if(TARGET ${library})
    list(APPEND exported compmark_${name})
  endif()
endforeach()
install(TARGETS ${exported} EXPORT compmark-targets FILE_SET HEADERS DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" COMPONENT compmark_dev)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/include/compmark" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" COMPONENT compmark_dev)
install(EXPORT compmark-targets NAMESPACE compmark:: DESTINATION "${package_dir}" COMPONENT compmark_dev)

configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/compmark-config.cmake.in"
                              "${PROJECT_BINARY_DIR}/compmark-config.cmake" INSTALL_DESTINATION "${package_dir}"
                              PATH_VARS CMAKE_INSTALL_INCLUDEDIR)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/compmark-config-version.cmake"
                                 COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
install(FILES "${PROJECT_BINARY_DIR}/compmark-config.cmake" "${PROJECT_BINARY_DIR}/compmark-config-version.cmake"
        "${PROJECT_SOURCE_DIR}/cmake/CompmarkApp.cmake" "${PROJECT_SOURCE_DIR}/cmake/CompmarkOptionalLibrary.cmake"
        DESTINATION "${package_dir}" COMPONENT compmark_dev)

# A prefix can be moved, but for folders that were given as absolute ones.
if(IS_ABSOLUTE "${CMAKE_INSTALL_DATADIR}")
  set(pc_prefix "${CMAKE_INSTALL_PREFIX}")
else()
  file(RELATIVE_PATH up "/prefix/${CMAKE_INSTALL_DATADIR}/pkgconfig" "/prefix")
  string(REGEX REPLACE "/$" "" up "${up}")
  set(pc_prefix "\${pcfiledir}/${up}")
endif()
set(pc_includedir "\${prefix}/${CMAKE_INSTALL_INCLUDEDIR}")
if(IS_ABSOLUTE "${CMAKE_INSTALL_INCLUDEDIR}")
  set(pc_includedir "${CMAKE_INSTALL_INCLUDEDIR}")
endif()
configure_file("${PROJECT_SOURCE_DIR}/cmake/compmark.pc.in" "${PROJECT_BINARY_DIR}/compmark.pc" @ONLY)
install(FILES "${PROJECT_BINARY_DIR}/compmark.pc" DESTINATION "${CMAKE_INSTALL_DATADIR}/pkgconfig" COMPONENT compmark_dev)
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/compmark")
