# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# Writes commit.h with the commit of the source, at every build, touching the file only when it changed:
#   cmake -DSOURCE_DIR=... -DOUT=.../commit.h -P commit.cmake
# "unknown" outside of git: a source archive, or one that was unpacked inside somebody else's repository.
set(commit unknown)
find_program(GIT git)
if(GIT)
  execute_process(COMMAND ${GIT} -C ${SOURCE_DIR} rev-parse --show-toplevel OUTPUT_VARIABLE top ERROR_QUIET
                  OUTPUT_STRIP_TRAILING_WHITESPACE)
  file(REAL_PATH ${SOURCE_DIR} source)
  if(top)
    file(REAL_PATH ${top} top)
  endif()
  if(top STREQUAL source)
    execute_process(COMMAND ${GIT} -C ${SOURCE_DIR} describe --tags --always --dirty RESULT_VARIABLE failed
                    OUTPUT_VARIABLE described ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
    if(NOT failed AND described MATCHES "^[A-Za-z0-9._+/-]+$")
      set(commit ${described})
    endif()
  endif()
endif()
set(text "#define EVT_COMMIT \"${commit}\"\n")
if(EXISTS ${OUT})
  file(READ ${OUT} old)
endif()
if(NOT old STREQUAL text)
  file(WRITE ${OUT} ${text})
endif()
