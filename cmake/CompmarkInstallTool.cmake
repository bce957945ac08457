# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Install rules of the tool, component compmark_tool: the program where it was built, the decoder that it looks for beside itself (in share/compmark/weights),
# and a man page and completions, which are written from what it prints for --help as soon as it is built. They are left out where it can't be run.
set(COMPMARK_ZSH_COMPLETION_DIR "${CMAKE_INSTALL_DATADIR}/zsh/site-functions"
    CACHE STRING "Where the completion of zsh is installed (Debian: share/zsh/vendor-completions)")

# compmark_install_tool(<target>)
function(compmark_install_tool tool)
  install(TARGETS ${tool} RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}" COMPONENT compmark_tool OPTIONAL)
  install(FILES "${PROJECT_SOURCE_DIR}/weights/universal3_64.safetensors" "${PROJECT_SOURCE_DIR}/weights/universal3_64.md"
          DESTINATION "${CMAKE_INSTALL_DATADIR}/compmark/weights" COMPONENT compmark_tool)
  if(CMAKE_CROSSCOMPILING OR NOT UNIX)
    return()
  endif()

  set(folder "${PROJECT_BINARY_DIR}/help")
  set(page compmark.1)
  set(pack)
  find_program(COMPMARK_GZIP gzip)
  if(COMPMARK_GZIP)
    set(page compmark.1.gz)
    set(pack COMMAND "${COMPMARK_GZIP}" -9nf "${folder}/compmark.1")
  endif()
  set(completions compmark.bash _compmark compmark.fish)
  list(TRANSFORM completions PREPEND "${folder}/" OUTPUT_VARIABLE pages)
  list(APPEND pages "${folder}/${page}")
  set(script "${PROJECT_SOURCE_DIR}/cmake/make_help_pages.sh")
  add_custom_command(OUTPUT ${pages} COMMAND sh "${script}" "$<TARGET_FILE:${tool}>" "${folder}" ${pack}
                     DEPENDS ${tool} "${script}" "${PROJECT_SOURCE_DIR}/cmake/help_pages.awk" COMMENT "Man page and completions" VERBATIM)
  add_custom_target(compmark_help_pages ALL DEPENDS ${pages})
  install(FILES "${folder}/${page}" DESTINATION "${CMAKE_INSTALL_MANDIR}/man1" COMPONENT compmark_tool OPTIONAL)
  install(FILES "${folder}/compmark.bash" DESTINATION "${CMAKE_INSTALL_DATADIR}/bash-completion/completions" RENAME compmark
          COMPONENT compmark_tool OPTIONAL)
  install(FILES "${folder}/_compmark" DESTINATION "${COMPMARK_ZSH_COMPLETION_DIR}" COMPONENT compmark_tool OPTIONAL)
  install(FILES "${folder}/compmark.fish" DESTINATION "${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d" COMPONENT compmark_tool OPTIONAL)
endfunction()
