# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# cmake -DWAY=<way> -DSOURCE= -DWORK= -DCC= -DGENERATOR= -DVERSION= -P use_package.cmake
# Builds and runs tests/docs/consumer in one of the four ways to use the library.
set(consumer ${SOURCE}/tests/docs/consumer)
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

function(configure source binary)
  run(${CMAKE_COMMAND} -S ${source} -B ${binary} -G ${GENERATOR} -DCMAKE_C_COMPILER=${CC} -DCMAKE_BUILD_TYPE=Release ${ARGN})
  run(${CMAKE_COMMAND} --build ${binary})
endfunction()

function(install_library)
  configure(${SOURCE} ${WORK}/library -DEVS_BUILD_TESTS=OFF -DEVS_BUILD_HOST_TOOLS=OFF -DCMAKE_INSTALL_PREFIX=${WORK}/prefix)
  run(${CMAKE_COMMAND} --install ${WORK}/library)
endfunction()

if(WAY STREQUAL "add_subdirectory" OR WAY STREQUAL "source_list")
  configure(${consumer}/${WAY} ${WORK}/build -DEVSTAB=${SOURCE})
elseif(WAY STREQUAL "find_package")
  install_library()
  configure(${consumer}/find_package ${WORK}/build -DCMAKE_PREFIX_PATH=${WORK}/prefix -DEVS_WANTED=${VERSION})
  # A version of the future must be refused, or the version file says nothing.
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${consumer}/find_package -B ${WORK}/refused -G ${GENERATOR}
                          -DCMAKE_C_COMPILER=${CC} -DCMAKE_PREFIX_PATH=${WORK}/prefix -DEVS_WANTED=99.0
                  RESULT_VARIABLE status OUTPUT_QUIET ERROR_QUIET)
  if(status EQUAL 0)
    message(FATAL_ERROR "find_package(evs 99.0) was satisfied by ${VERSION}")
  endif()
elseif(WAY STREQUAL "pkg_config")
  find_program(pkg_config NAMES pkg-config pkgconf)
  if(NOT pkg_config)
    message(FATAL_ERROR "no pkg-config found: install it")
  endif()
  install_library()
  file(GLOB_RECURSE pc ${WORK}/prefix/evs.pc)
  cmake_path(GET pc PARENT_PATH pc_dir)
  set(ENV{PKG_CONFIG_PATH} ${pc_dir})
  run(${pkg_config} --exact-version=${VERSION} evs)
  execute_process(COMMAND ${pkg_config} --cflags --libs evs OUTPUT_VARIABLE flags COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(flags UNIX_COMMAND "${flags}")
  file(MAKE_DIRECTORY ${WORK}/build)
  run(${CC} -std=c99 ${consumer}/main.c ${flags} -o ${WORK}/build/consumer)
else()
  message(FATAL_ERROR "WAY is \"${WAY}\"")
endif()

execute_process(COMMAND ${WORK}/build/consumer OUTPUT_VARIABLE output COMMAND_ERROR_IS_FATAL ANY)
if(NOT output STREQUAL "${VERSION}\nEVS_OK\n")
  message(FATAL_ERROR "the consumer printed \"${output}\"")
endif()
