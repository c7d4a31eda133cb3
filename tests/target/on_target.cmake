# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# Tests of a cross build: the archive itself, and the board that the other tests run on.
set(expect_exit ${PROJECT_SOURCE_DIR}/tests/support/expect_exit.cmake)
set(gate ${PROJECT_SOURCE_DIR}/lib/cmake/check_symbols.cmake)
string(REGEX REPLACE "nm$" "size" evs_size_tool "${CMAKE_NM}")

add_test(NAME symbols.evs COMMAND ${CMAKE_COMMAND} -DNM=${CMAKE_NM} -DSIZE=${evs_size_tool}
                                  -DARCHIVE=$<TARGET_FILE:evs> -P ${gate})

# A gate that lets everything through would pass the test above. These must be refused, each for its own reason.
set(reason_heap "calls .malloc.")
set(reason_double "calls .(__aeabi_dmul|__muldf3).")
set(reason_libm "calls .*atan2")
set(reason_stdio "calls .*printf")
set(reason_data "data [1-9]")
set(reason_bss "bss [1-9]")
set(sins heap double libm stdio data bss)
if(CMAKE_C_FLAGS MATCHES "fpv5-d16|cortex-m55")
  list(REMOVE_ITEM sins double) # These cores multiply doubles themselves: no call to be seen. The others would tell.
endif()
foreach(sin IN LISTS sins)
  add_library(evs_bad_${sin} STATIC bad_archive.c)
  target_compile_definitions(evs_bad_${sin} PRIVATE SIN_${sin})
  add_test(NAME symbols.refuses_${sin}
           COMMAND ${CMAKE_COMMAND} -DEXIT=1 -DOUTPUT=${reason_${sin}} -P ${expect_exit} -- ${CMAKE_COMMAND} -DNM=${CMAKE_NM}
                   -DSIZE=${evs_size_tool} -DARCHIVE=$<TARGET_FILE:evs_bad_${sin}> -P ${gate})
  set_tests_properties(symbols.refuses_${sin} PROPERTIES LABELS target)
endforeach()
set_tests_properties(symbols.evs PROPERTIES LABELS target)

if(EVS_BOARD)
  add_executable(test_board test_board.c)
  target_link_libraries(test_board PRIVATE evs_board evs_warnings m)
  target_compile_options(test_board PRIVATE -UNDEBUG) # It asserts on purpose.
  foreach(test IN ITEMS "check:42:by printf 7:check a,b" "assert:98:assertion failed:assert" "fault:99:exception:fault")
    string(REPLACE ":" ";" test "${test}")
    list(POP_FRONT test name status output args)
    separate_arguments(args)
    add_test(NAME board.${name}
             COMMAND ${CMAKE_COMMAND} -DEXIT=${status} -DOUTPUT=${output} -P ${expect_exit} -- ${CMAKE_CROSSCOMPILING_EMULATOR}
                     $<TARGET_FILE:test_board> ${args})
    set_tests_properties(board.${name} PROPERTIES LABELS target TIMEOUT 60)
  endforeach()
endif()
