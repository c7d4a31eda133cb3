# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# cmake -DEXIT=<status> [-DOUTPUT=<regex>] -P expect_exit.cmake -- <command>...
# Passes if the command ends with exactly this status and prints what is asked. CTest's WILL_FAIL would also be content
# with a command that could not even start.
set(command "")
set(seen FALSE)
math(EXPR last "${CMAKE_ARGC} - 1")
foreach(i RANGE ${last})
  if(seen)
    list(APPEND command "${CMAKE_ARGV${i}}")
  elseif("${CMAKE_ARGV${i}}" STREQUAL "--")
    set(seen TRUE)
  endif()
endforeach()

execute_process(COMMAND ${command} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
message("${output}")
if(NOT status STREQUAL EXIT)
  message(FATAL_ERROR "exit status ${status}, expected ${EXIT}: ${command}")
endif()
string(REGEX REPLACE "[ \r\n]+" " " output "${output}") # CMake wraps its own messages anywhere.
if(DEFINED OUTPUT AND NOT output MATCHES "${OUTPUT}")
  message(FATAL_ERROR "the output does not match \"${OUTPUT}\": ${command}")
endif()
