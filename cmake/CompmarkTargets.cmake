# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The INTERFACE targets and their header sets. Each header set is compiled alone by the target all_verify_interface_header_sets
# (configure with -DCMAKE_VERIFY_INTERFACE_HEADER_SETS=ON).
file(GLOB_RECURSE compmark_headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/include/compmark/*.hpp")

# The executor adaptors are the only headers that need more than the package's own dependencies: each is a component.
set(compmark_tbb_headers "${PROJECT_SOURCE_DIR}/include/compmark/core/tbb_executor.hpp")
set(compmark_openmp_headers "${PROJECT_SOURCE_DIR}/include/compmark/core/openmp_executor.hpp")
list(REMOVE_ITEM compmark_headers ${compmark_tbb_headers} ${compmark_openmp_headers})

# compmark_component(<name> <headers...>): target compmark_<name> (compmark for "compmark") with alias compmark::<name>.
function(compmark_component name)
  set(target compmark_${name})
  if(name STREQUAL compmark)
    set(target compmark)
  endif()
  set(headers)
  foreach(header IN LISTS ARGN)
    if(EXISTS "${header}")
      list(APPEND headers "${header}")
    endif()
  endforeach()
  add_library(${target} INTERFACE)
  add_library(compmark::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  target_sources(${target} INTERFACE FILE_SET HEADERS BASE_DIRS "${PROJECT_SOURCE_DIR}/include" FILES ${headers})
  target_compile_features(${target} INTERFACE cxx_std_20)
  if(NOT name STREQUAL compmark)
    target_link_libraries(${target} INTERFACE compmark)
  endif()
  set_property(GLOBAL APPEND PROPERTY COMPMARK_COMPONENTS ${target})
endfunction()

compmark_component(compmark ${compmark_headers})
target_link_libraries(compmark INTERFACE Eigen3::Eigen nlohmann_json::nlohmann_json nanoflann::nanoflann Threads::Threads
                                         compmark::stb)

compmark_component(tbb ${compmark_tbb_headers})
if(TARGET TBB::tbb)
  target_link_libraries(compmark_tbb INTERFACE TBB::tbb)
else()
  set_target_properties(compmark_tbb PROPERTIES VERIFY_INTERFACE_HEADER_SETS OFF)
endif()

compmark_component(openmp ${compmark_openmp_headers})
if(TARGET OpenMP::OpenMP_CXX)
  target_link_libraries(compmark_openmp INTERFACE OpenMP::OpenMP_CXX)
else()
  set_target_properties(compmark_openmp PROPERTIES VERIFY_INTERFACE_HEADER_SETS OFF)
endif()
