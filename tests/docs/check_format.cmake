# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# cmake -DCLANG_FORMAT= -DSOURCE= -P check_format.cmake
execute_process(COMMAND ${CLANG_FORMAT} --version OUTPUT_VARIABLE version COMMAND_ERROR_IS_FATAL ANY)
if(NOT version MATCHES "version 14\\.")
  message(FATAL_ERROR "needs clang-format 14, this is ${version}")
endif()
file(GLOB_RECURSE sources ${SOURCE}/lib/*.[ch] ${SOURCE}/drivers/*.[ch] ${SOURCE}/host_tools/*.[ch] ${SOURCE}/tests/*.[ch])
execute_process(COMMAND ${CLANG_FORMAT} --dry-run -Werror ${sources} COMMAND_ERROR_IS_FATAL ANY)
