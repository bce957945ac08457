# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# compmark::app, the functions of compmark/app compiled once (compmark/app/compiled.hpp): a static library of whoever builds it, so that its flags are those
# of the program. It is not in the package as a binary: templates of two sets of flags do not mix. Nothing is compiled until something links it.
function(compmark_add_app source library)
  if(TARGET compmark_app)
    return()
  endif()
  add_library(compmark_app STATIC EXCLUDE_FROM_ALL "${source}")
  add_library(compmark::app ALIAS compmark_app)
  set_target_properties(compmark_app PROPERTIES CXX_EXTENSIONS OFF)
  target_compile_definitions(compmark_app PUBLIC COMPMARK_APP_COMPILED)
  target_link_libraries(compmark_app PUBLIC ${library})
endfunction()
