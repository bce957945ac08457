# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The INTERFACE targets and their header sets, and the one compiled target. Each header set is compiled alone by the target all_verify_interface_header_sets
# (configure with -DCMAKE_VERIFY_INTERFACE_HEADER_SETS=ON).
file(GLOB_RECURSE compmark_headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/include/compmark/*.hpp")

# The functions of app are compiled by its tests; by themselves each of these headers would compile every recipe again.
list(FILTER compmark_headers EXCLUDE REGEX "/app/(run/)?detail/")

# Headers that need a library of their own, each a component: name, header, target of the library.
set(COMPMARK_OPTIONAL_COMPONENTS "tbb core/tbb_executor.hpp TBB::tbb" "openmp core/openmp_executor.hpp OpenMP::OpenMP_CXX"
                                 "xtensor io/xtensor_adaptor.hpp xtensor")

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
endfunction()

foreach(entry IN LISTS COMPMARK_OPTIONAL_COMPONENTS)
  separate_arguments(entry)
  list(GET entry 1 header)
  list(REMOVE_ITEM compmark_headers "${PROJECT_SOURCE_DIR}/include/compmark/${header}")
endforeach()
compmark_component(compmark ${compmark_headers})
target_link_libraries(compmark INTERFACE Eigen3::Eigen nlohmann_json::nlohmann_json nanoflann::nanoflann Threads::Threads
                                         compmark::stb)
foreach(found libzstd libwebp)
  if(TARGET compmark::${found})
    target_link_libraries(compmark INTERFACE $<BUILD_INTERFACE:compmark::${found}>)
  endif()
endforeach()

foreach(entry IN LISTS COMPMARK_OPTIONAL_COMPONENTS)
  separate_arguments(entry)
  list(GET entry 0 name)
  list(GET entry 1 header)
  list(GET entry 2 library)
  compmark_component(${name} "${PROJECT_SOURCE_DIR}/include/compmark/${header}")
  if(TARGET ${library})
    target_link_libraries(compmark_${name} INTERFACE ${library})
  else()
    set_target_properties(compmark_${name} PROPERTIES VERIFY_INTERFACE_HEADER_SETS OFF)
  endif()
endforeach()

include(CompmarkApp)
compmark_add_app("${PROJECT_SOURCE_DIR}/include/compmark/app" compmark)
