# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# With EVS_TARGET_TESTS a host build covers the other builds too: each is configured and compiled by a test of its own
# (target.<name>.build), and every test that it holds appears here as target.<name>.<test>. So one ctest run, with one
# closing line, tells about all of them.
set(targets_with_board m4f m7 m55 rv32)
set(targets_without_board m0plus m33)
set(targets_root ${PROJECT_BINARY_DIR}/target)

# evs_add_tree(<name> [TARGET <build target>] <CMake argument>...): a build folder ${targets_root}/<name> as a test that
# others can require as the fixture tree_<name>.
function(evs_add_tree name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "TARGET" "")
  if(NOT arg_TARGET)
    set(arg_TARGET all)
  endif()
  string(REPLACE ";" "|" arguments "${arg_UNPARSED_ARGUMENTS}")
  add_test(NAME target.${name}.build
           COMMAND ${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR} -DBINARY=${targets_root}/${name} -DTARGET=${arg_TARGET}
                   "-DARGUMENTS=-DEVS_DEPS_DIR=${EVS_DEPS_DIR}|-DEVS_DATA_DIR=${EVS_DATA_DIR}|-DEVS_UNITY_DIR=${EVS_UNITY_DIR}|-DEVS_RECORDINGS_DIR=${EVS_RECORDINGS_DIR}|-DPython3_EXECUTABLE=${Python3_EXECUTABLE}|-DEVS_WERROR=ON|${arguments}"
                   -P ${CMAKE_CURRENT_SOURCE_DIR}/build_tree.cmake)
  # Each build takes all cores by itself.
  set_tests_properties(target.${name}.build PROPERTIES LABELS target TIMEOUT 900 FIXTURES_SETUP tree_${name} RUN_SERIAL ON)
endfunction()

# One test of a tree, run by the tree's own ctest: it knows the emulator and the arguments.
function(evs_add_tree_test tree test)
  string(REPLACE "." "\\." pattern "${test}")
  add_test(NAME target.${tree}.${test}
           COMMAND ${CMAKE_CTEST_COMMAND} --test-dir ${targets_root}/${tree} --output-on-failure --no-tests=error
                   -R "^${pattern}$")
  set_tests_properties(
    target.${tree}.${test} PROPERTIES LABELS target TIMEOUT 600 FIXTURES_REQUIRED tree_${tree}
                                      SKIP_REGULAR_EXPRESSION "\\*\\*\\*Skipped")
endfunction()

find_package(Python3 REQUIRED COMPONENTS Interpreter)
get_property(portable_tests GLOBAL PROPERTY EVS_TESTS_FOR_TARGETS)
get_property(golden_tests GLOBAL PROPERTY EVS_GOLDEN_TESTS)
foreach(target IN LISTS targets_with_board targets_without_board)
  evs_add_tree(${target} -DCMAKE_BUILD_TYPE=Release --toolchain ${PROJECT_SOURCE_DIR}/lib/cmake/${target}.cmake)
  foreach(test IN ITEMS evs refuses_heap refuses_libm refuses_stdio refuses_data refuses_bss)
    evs_add_tree_test(${target} symbols.${test})
  endforeach()
endforeach()
foreach(target IN ITEMS m0plus m4f m33 rv32) # The others multiply doubles in hardware: nothing there to refuse.
  evs_add_tree_test(${target} symbols.refuses_double)
endforeach()
foreach(target IN LISTS targets_with_board)
  foreach(test IN ITEMS board.check board.assert board.fault docs.examples ${portable_tests})
    evs_add_tree_test(${target} ${test})
  endforeach()
endforeach()

# The output bits again, from other compilers, optimization levels and kernels of the host.
find_program(EVS_GCC NAMES gcc)
find_program(EVS_CLANG NAMES clang)
foreach(compiler IN ITEMS gcc clang)
  string(TOUPPER EVS_${compiler} path)
  foreach(level IN ITEMS O0 O3)
    foreach(simd IN ITEMS simd nosimd)
      set(tree ${compiler}-${level}-${simd})
      set(no_simd OFF)
      if(simd STREQUAL "nosimd")
        set(no_simd ON)
      endif()
      evs_add_tree(${tree} TARGET evs_replay -DCMAKE_C_COMPILER=${${path}} -DCMAKE_BUILD_TYPE=Debug
                   -DCMAKE_C_FLAGS_DEBUG=-${level} -DEVS_NO_SIMD=${no_simd} -DEVS_BUILD_HOST_TOOLS=OFF)
      foreach(test IN LISTS golden_tests)
        evs_add_tree_test(${tree} ${test})
      endforeach()
    endforeach()
  endforeach()
endforeach()

# The instruction counter, on a program whose counts are known: 10 calls of nothing, of 201 instructions, of the same.
if(TARGET evcount)
  foreach(target IN LISTS targets_with_board)
    set(board_m4f mps2-an386)
    set(board_m7 mps2-an500)
    set(board_m55 mps3-an547)
    set(board_rv32 riscv32-virt)
    evs_add_script_test(target ${target}.count_is_exact COMMAND
      ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tests/bench/count_insns.py $<TARGET_FILE:evcount>
      ${CMAKE_CURRENT_SOURCE_DIR}/run_qemu.sh ${board_${target}} ${targets_root}/${target}/tests/bench/bench_loop
      --expect 0=10:0 1=10:2010 2=10:2010)
    set_tests_properties(target.${target}.count_is_exact PROPERTIES FIXTURES_REQUIRED tree_${target})
  endforeach()
endif()

# The numbers in docs/, measured on what was just built.
set(memory_table ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tests/support/memory_table.py ${targets_root})
evs_add_script_test(docs memory COMMAND ${memory_table} --check ${PROJECT_SOURCE_DIR}/docs/memory.md)
set_tests_properties(docs.memory PROPERTIES FIXTURES_REQUIRED "tree_m0plus;tree_m4f;tree_m7;tree_m55;tree_rv32")

set(bench_table ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tests/bench/bench_table.py ${targets_root})
set(update_performance "")
if(TARGET evcount)
  evs_add_script_test(docs performance COMMAND ${bench_table} $<TARGET_FILE:evcount>
                      --check ${PROJECT_SOURCE_DIR}/docs/performance.md)
  set_tests_properties(docs.performance PROPERTIES FIXTURES_REQUIRED "tree_m4f;tree_m7;tree_m55;tree_rv32")
  set(update_performance COMMAND ${bench_table} $<TARGET_FILE:evcount> --write ${PROJECT_SOURCE_DIR}/docs/performance.md)
endif()

# Builds the targets and writes the numbers into docs/ again.
add_custom_target(
  evs_update_docs
  COMMAND ${CMAKE_CTEST_COMMAND} --output-on-failure -R "^target[.](m|rv)[a-z0-9]+[.]build$"
  COMMAND ${memory_table} --write ${PROJECT_SOURCE_DIR}/docs/memory.md
  ${update_performance}
  COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tests/support/cost_table.py --write
  WORKING_DIRECTORY ${PROJECT_BINARY_DIR}
  USES_TERMINAL VERBATIM)
