# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
#
# How this project's targets are made.
include(CMakeParseArguments)

# Our own warnings and language level, for one target.
function(configure_target target)
  target_compile_features(${target} PUBLIC cxx_std_17)
  set_target_properties(${target} PROPERTIES CXX_STANDARD 17 CXX_STANDARD_REQUIRED ON CXX_EXTENSIONS OFF)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wpedantic)
  if(VIEW_SERVO_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()

# precompile(TARGET HEADER...): what nearly all of a target's files include is compiled once.
# precompile(TARGET REUSE_FROM OTHER): once for both.
function(precompile target first)
  if(CMAKE_VERSION VERSION_LESS 3.16)
    return()
  endif()
  if(first STREQUAL "REUSE_FROM")
    target_precompile_headers(${target} REUSE_FROM ${ARGN})
  else()
    target_precompile_headers(${target} PRIVATE ${first} ${ARGN})
  endif()
endfunction()

# link_visp(TARGET MODULE...). In a function, as ViSP's package sets compiler flags for all that follows in the same scope.
function(link_visp target)
  find_package(VISP REQUIRED COMPONENTS ${ARGN})
  target_include_directories(${target} SYSTEM PRIVATE ${VISP_INCLUDE_DIRS})
  target_link_libraries(${target} PRIVATE ${ARGN})
endfunction()

# vs_executable(NAME FILES file... LIBS library...): a program `NAME` by the target view_servo_NAME, as targets of all packages
# of a workspace share their names. It is installed.
function(vs_executable name)
  cmake_parse_arguments(ARG "" "" "FILES;LIBS" ${ARGN})
  set(target ${PROJECT_NAME}_${name})
  add_executable(${target} ${ARG_FILES})
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name})
  configure_target(${target})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(${target} PRIVATE ${ARG_LIBS})
  install(TARGETS ${target} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endfunction()
