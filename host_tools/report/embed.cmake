# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# Files into a C source: cmake -DOUT=assets.c "-DFILES=report.html.in|report.css" -P embed.cmake
# report.css becomes `const char evr_asset_report_css[]`. Bytes, not a string literal: C allows only short ones.
string(REPLACE "|" ";" files "${FILES}")
set(text "/* Made by embed.cmake. */\n#include \"assets.h\"\n")
foreach(file IN LISTS files)
  get_filename_component(name "${file}" NAME)
  string(REGEX REPLACE "\\.in$" "" name "${name}")
  string(MAKE_C_IDENTIFIER "${name}" name)
  file(READ "${file}" hex HEX)
  string(REGEX REPLACE "(..)" "0x\\1," hex "${hex}")
  if(hex MATCHES "0x[89a-f].,")
    message(FATAL_ERROR "${file}: has a character beyond ASCII; write it as an escape")
  endif()
  string(REPLACE "0x0a," "0x0a,\n    " hex "${hex}") # A line is a line.
  string(APPEND text "\nconst char evr_asset_${name}[] = {\n    ${hex}0x00};\n")
endforeach()
file(WRITE "${OUT}" "${text}")
