# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# cmake -DNM=<nm> -DSIZE=<size> -DARCHIVE=<libevs.a> -P check_symbols.cmake
#
# The symbol gate: refuses a cross-built library that calls anything but its own functions, the three memory functions
# and the compiler's integer helpers, or that holds data which changes. So no heap, no stdio, no libm, no floating point
# (on a core without a unit for it that is a call of __aeabi_dmul and the like), no state outside the caller's memory.
# It is a list of what is allowed, hence nobody can forget to forbid something.
set(allowed
    "evs_.*" # Defined in another file of the library.
    "memset|memcpy|memmove|__aeabi_mem(set|cpy|move|clr)[48]?"
    "__assert_func|__assert_no_args" # EVS_ASSERT in builds without NDEBUG.
    # Integer helpers of libgcc: 64-bit and, on small cores, all division; shifts, multiplication, leading zeros, switch.
    "__aeabi_(u?idiv(mod)?|idiv0|u?ldivmod|ldiv0|lmul|llsl|llsr|lasr|l?cmp|ulcmp)"
    "__(u?(div|mod|divmod)|mul|ashl|ashr|lshr|neg|u?cmp|clz|ctz|ffs|popcount|bswap)[sd]i[234]"
    "__gnu_thumb1_case_(uqi|sqi|uhi|shi|si)")
list(JOIN allowed "|" allowed)

execute_process(COMMAND ${NM} ${ARCHIVE} OUTPUT_VARIABLE listing COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL " [Uvw] [^\n]+" used "${listing}")
list(TRANSFORM used REPLACE "^ [Uvw] " "")
list(REMOVE_DUPLICATES used)
list(FILTER used EXCLUDE REGEX "^(${allowed})$")
string(REGEX MATCHALL "[0-9a-f]+ [bBdDgGsSC] [^\n]+" mutable "${listing}")
string(REGEX MATCHALL "[0-9a-f]+ T evs_[^\n]+" own "${listing}")

execute_process(COMMAND ${SIZE} -t ${ARCHIVE} OUTPUT_VARIABLE sizes COMMAND_ERROR_IS_FATAL ANY)
if(NOT sizes MATCHES "([0-9]+)[ \t]+([0-9]+)[ \t]+([0-9]+)[ \t]+[0-9]+[ \t]+[0-9a-f]+[ \t]+\\(TOTALS\\)")
  message(FATAL_ERROR "cannot read what ${SIZE} prints:\n${sizes}")
endif()
set(text ${CMAKE_MATCH_1})
set(data ${CMAKE_MATCH_2})
set(bss ${CMAKE_MATCH_3})

if(used OR mutable OR data OR bss)
  message(FATAL_ERROR "symbol gate: ${ARCHIVE} calls [${used}], keeps [${mutable}], .data ${data}, .bss ${bss} bytes")
endif()
if(NOT own)
  message(FATAL_ERROR "symbol gate: ${ARCHIVE} defines no evs_ function: not our library, or nm printed nothing")
endif()
message(STATUS "symbol gate: ${ARCHIVE} is clean, ${text} bytes of text")
