# SPDX-License-Identifier: MIT
# SPDX-FileCopyrightText: 2026 the evstab authors
#
# Finds or fetches Unity (the unit test framework) and makes the target evs_unity from it. In this order:
#   1. an installed Unity that was built with double support (host builds only);
#   2. its sources: EVS_UNITY_DIR if set, else what an earlier configure run left in EVS_DEPS_DIR;
#   3. the PyPI source package pytest-unity, which carries them;
#   4. Unity's own repository.
# The package is checked against its hash; whatever is fetched stays in the build folder.
set(unity_sdist pytest_unity-0.1.0.tar.gz)
set(unity_sdist_hash cd3ceb4aeb4f7866f935957f91874999d8ae13ff014684464ade0b7071e28298)
set(unity_git_tag v2.6.1)

if(DEFINED ENV{EVS_DEPS_DIR})
  set(default_deps_dir "$ENV{EVS_DEPS_DIR}")
else()
  set(default_deps_dir ${PROJECT_SOURCE_DIR}/build/_deps)
endif()
set(EVS_DEPS_DIR "${default_deps_dir}" CACHE PATH "Where downloads are kept, shared by all build folders")
set(EVS_UNITY_DIR "" CACHE PATH "Folder that holds unity.c and unity.h; empty: find or fetch it")

set(evs_unity_found FALSE)
if(NOT EVS_UNITY_DIR AND NOT CMAKE_CROSSCOMPILING)
  find_package(unity CONFIG QUIET)
  if(TARGET unity::framework)
    include(CheckCSourceCompiles)
    set(CMAKE_REQUIRED_LIBRARIES unity::framework)
    check_c_source_compiles(
      "#define UNITY_INCLUDE_DOUBLE
       #include <unity.h>
       void setUp(void) {} void tearDown(void) {}
       int main(void) { UNITY_BEGIN(); TEST_ASSERT_DOUBLE_WITHIN(1.0, 1.0, 1.0); return UNITY_END(); }"
      EVS_UNITY_HAS_DOUBLE)
    unset(CMAKE_REQUIRED_LIBRARIES)
    if(EVS_UNITY_HAS_DOUBLE)
      add_library(evs_unity INTERFACE)
      target_link_libraries(evs_unity INTERFACE unity::framework)
      target_compile_definitions(evs_unity INTERFACE UNITY_INCLUDE_DOUBLE UNITY_SUPPORT_64)
      set(evs_unity_found TRUE)
    endif()
  endif()
endif()

# The PyPI package; leaves unity.c in ${dir} or does nothing.
function(evs_fetch_unity_from_pypi dir)
  find_package(Python3 QUIET COMPONENTS Interpreter)
  if(NOT Python3_FOUND)
    return()
  endif()
  message(STATUS "Unity: fetching ${unity_sdist} from PyPI")
  set(work ${EVS_DEPS_DIR}/unity-download)
  file(REMOVE_RECURSE ${work})
  # "--no-binary pytest-unity", not ":all:": the latter would compile the packages that its build needs as well.
  execute_process(
    COMMAND ${Python3_EXECUTABLE} -m pip download --quiet --disable-pip-version-check --no-deps --no-binary pytest-unity
            --dest ${work} pytest-unity==0.1.0
    RESULT_VARIABLE failed
    ERROR_VARIABLE why)
  if(failed)
    message(STATUS "Unity: pip failed: ${why}")
    return()
  endif()
  file(SHA256 ${work}/${unity_sdist} hash)
  if(NOT hash STREQUAL unity_sdist_hash)
    message(FATAL_ERROR "Unity: ${unity_sdist} has hash ${hash}, not ${unity_sdist_hash}. Not used.")
  endif()
  file(ARCHIVE_EXTRACT INPUT ${work}/${unity_sdist} DESTINATION ${work} PATTERNS "*/vendor/unity/src/*" "*/vendor/unity/LICENSE.txt")
  file(COPY ${work}/pytest_unity-0.1.0/vendor/unity/src/ ${work}/pytest_unity-0.1.0/vendor/unity/LICENSE.txt
       DESTINATION ${dir})
  file(REMOVE_RECURSE ${work})
endfunction()

if(NOT evs_unity_found)
  set(unity_dir "${EVS_UNITY_DIR}")
  if(NOT unity_dir)
    set(unity_dir ${EVS_DEPS_DIR}/unity)
    file(MAKE_DIRECTORY ${EVS_DEPS_DIR})
    file(LOCK ${EVS_DEPS_DIR}/unity.lock TIMEOUT 300) # Two build folders may be configured at the same time.
    if(NOT EXISTS ${unity_dir}/unity.c)
      evs_fetch_unity_from_pypi(${unity_dir})
    endif()
    file(LOCK ${EVS_DEPS_DIR}/unity.lock RELEASE)
    if(NOT EXISTS ${unity_dir}/unity.c)
      include(FetchContent)
      FetchContent_Declare(unity_src GIT_REPOSITORY https://github.com/ThrowTheSwitch/Unity.git GIT_TAG ${unity_git_tag}
                           SOURCE_SUBDIR none) # Its sources only, not its build.
      FetchContent_MakeAvailable(unity_src)
      set(unity_dir ${unity_src_SOURCE_DIR}/src)
    endif()
  endif()
  if(NOT EXISTS ${unity_dir}/unity.c)
    message(FATAL_ERROR "No Unity: set EVS_UNITY_DIR to the folder of unity.c, or -DEVS_BUILD_TESTS=OFF")
  endif()

  add_library(evs_unity STATIC ${unity_dir}/unity.c)
  target_include_directories(evs_unity SYSTEM PUBLIC ${unity_dir})
  target_compile_definitions(evs_unity PUBLIC UNITY_INCLUDE_DOUBLE UNITY_SUPPORT_64) # 64 bits: off on 32-bit cores
  if(EVS_BOARD)
    target_compile_definitions(evs_unity PUBLIC "UNITY_OUTPUT_CHAR(c)=board_putc(c)"
                                                "UNITY_OUTPUT_CHAR_HEADER_DECLARATION=board_putc(int c)")
  endif()
endif()
