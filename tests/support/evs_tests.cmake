# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# How tests are declared. Labels: unit property vectors oracle golden target docs.
# A test that cannot run here (say, a recording is missing) prints why and exits 77: ctest shows it as skipped.
set(EVS_SKIP_CODE 77)

# evs_add_c_test(<label> <name> SOURCES <file>... [LIBS <target>...] [ARGS <arg>...] [DEFINES <macro>...]
#                [TIMEOUT <s>] [HOST_ONLY])
# builds test_<name> and adds it as the test <label>.<name>. In a cross build it becomes an image for the board and runs
# in QEMU; EVS_DATA_DIR is in its environment on the host.
function(evs_add_c_test label name)
  cmake_parse_arguments(PARSE_ARGV 2 arg "HOST_ONLY" "TIMEOUT" "SOURCES;LIBS;ARGS;DEFINES")
  if(CMAKE_CROSSCOMPILING AND (arg_HOST_ONLY OR NOT EVS_BOARD))
    return()
  endif()
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  add_executable(test_${name} ${arg_SOURCES})
  target_link_libraries(test_${name} PRIVATE evs::evs evs_unity evs_warnings ${arg_LIBS})
  target_compile_definitions(test_${name} PRIVATE ${arg_DEFINES})
  target_include_directories(test_${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests/support)
  if(CMAKE_CROSSCOMPILING)
    target_link_libraries(test_${name} PRIVATE evs_board)
  endif()
  target_link_libraries(test_${name} PRIVATE m)
  set_target_properties(test_${name} PROPERTIES C_STANDARD 99 C_EXTENSIONS OFF)
  add_test(NAME ${label}.${name} COMMAND test_${name} ${arg_ARGS})
  set_tests_properties(
    ${label}.${name} PROPERTIES LABELS ${label} TIMEOUT ${arg_TIMEOUT} SKIP_RETURN_CODE ${EVS_SKIP_CODE}
                                ENVIRONMENT "EVS_DATA_DIR=${EVS_DATA_DIR}")
  if(NOT arg_HOST_ONLY)
    set_property(GLOBAL APPEND PROPERTY EVS_TESTS_FOR_TARGETS ${label}.${name})
  endif()
endfunction()

# evs_add_unit_test(<module> [SOURCES <more files>...] [LIBS <target>...] [DEFINES <macro>...] [TIMEOUT <s>] [HOST_ONLY])
# tests one module of the library: test_<module>.c. HOST_ONLY is for what no microcontroller can do (say, read files).
function(evs_add_unit_test module)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES")
  evs_add_c_test(unit ${module} SOURCES test_${module}.c ${arg_SOURCES} ${arg_UNPARSED_ARGUMENTS})
endfunction()

# evs_add_property_test(<name> ...): property_<name>.c, random inputs from a fixed seed; same options as above.
function(evs_add_property_test name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES")
  evs_add_c_test(property property_${name} SOURCES property_${name}.c ${arg_SOURCES} ${arg_UNPARSED_ARGUMENTS})
endfunction()

# evs_add_script_test(<label> <name> COMMAND <command>... [TIMEOUT <s>]): a program or script; host only.
function(evs_add_script_test label name)
  cmake_parse_arguments(PARSE_ARGV 2 arg "" "TIMEOUT" "COMMAND")
  if(CMAKE_CROSSCOMPILING)
    return()
  endif()
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  add_test(NAME ${label}.${name} COMMAND ${arg_COMMAND})
  set_tests_properties(
    ${label}.${name} PROPERTIES LABELS ${label} TIMEOUT ${arg_TIMEOUT} SKIP_RETURN_CODE ${EVS_SKIP_CODE}
                                ENVIRONMENT "EVS_DATA_DIR=${EVS_DATA_DIR}")
endfunction()
