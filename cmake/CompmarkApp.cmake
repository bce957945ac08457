# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# compmark::app, the functions of compmark/app compiled once (compmark/app/compiled.hpp): a static library of whoever builds it, so that its flags are those
# of the program. It is not in the package as a binary: templates of two sets of flags do not mix. Nothing is compiled until something links it.
# compmark::app_run is the part that trains (compmark/app/run), which takes minutes of a compiler; it links the other.
function(compmark_add_app folder library)
  if(TARGET compmark_app)
    return()
  endif()
  add_library(compmark_app STATIC EXCLUDE_FROM_ALL "${folder}/app_models.cpp" "${folder}/app_export.cpp" "${folder}/app.cpp")
  target_compile_definitions(compmark_app PUBLIC COMPMARK_APP_COMPILED)
  target_link_libraries(compmark_app PUBLIC ${library})
  add_library(compmark_app_run STATIC EXCLUDE_FROM_ALL "${folder}/run/app_run.cpp" "${folder}/run/app_run_codecs.cpp")
  target_link_libraries(compmark_app_run PUBLIC compmark_app)
  # For shared libraries too (bindings/c); a function of theirs is not one that another library may replace, so that nothing is lost by it.
  set_target_properties(compmark_app PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_compile_options(compmark_app PRIVATE -fno-semantic-interposition)
  foreach(name app app_run)
    add_library(compmark::${name} ALIAS compmark_${name})
    set_target_properties(compmark_${name} PROPERTIES CXX_EXTENSIONS OFF)
  endforeach()
endfunction()
