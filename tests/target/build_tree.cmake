# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# cmake -DSOURCE=<dir> -DBINARY=<dir> -DTARGET=<target> -DARGUMENTS=<a|b|c> -P build_tree.cmake: configure and build.
string(REPLACE "|" ";" ARGUMENTS "${ARGUMENTS}")
execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE} -B ${BINARY} -G Ninja ${ARGUMENTS} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${BINARY} --target ${TARGET} COMMAND_ERROR_IS_FATAL ANY)
