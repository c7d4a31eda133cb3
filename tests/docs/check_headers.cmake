# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# cmake -DCC= -DCXX= -DINCLUDE= -DHEADERS=<list> -DWORK= -P check_headers.cmake
# A translation unit of one include line per header; twice, for the include guard.
set(strict -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Werror -fsyntax-only -I${INCLUDE})
if(NOT CXX)
  message(FATAL_ERROR "no C++ compiler found: install g++ or clang++")
endif()
if(NOT HEADERS)
  message(FATAL_ERROR "no headers in ${INCLUDE}")
endif()
file(MAKE_DIRECTORY ${WORK})
set(failed "")
foreach(header IN LISTS HEADERS)
  file(WRITE ${WORK}/alone.c "#include \"${header}\"\n#include \"${header}\"\ntypedef int not_empty_t;\n")
  file(WRITE ${WORK}/alone.cpp "#include \"${header}\"\n#include \"${header}\"\n")
  execute_process(COMMAND ${CC} -std=c99 ${strict} ${WORK}/alone.c RESULT_VARIABLE c_status)
  execute_process(COMMAND ${CXX} -std=c++17 ${strict} ${WORK}/alone.cpp RESULT_VARIABLE cxx_status)
  if(c_status OR cxx_status)
    list(APPEND failed ${header})
  endif()
endforeach()
if(failed)
  message(FATAL_ERROR "do not compile alone: ${failed}")
endif()
