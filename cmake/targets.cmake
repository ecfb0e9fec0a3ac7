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
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${VIEW_SERVO_UNITY} UNITY_BUILD_BATCH_SIZE 8)
  if(VIEW_SERVO_UNITY)
    # GCC takes files that others include for headers, in which types of anonymous namespaces would be a fault.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
  if(VIEW_SERVO_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
    # What GCC takes for uninitialized depends on how it optimises; from version 13 on, Eigen's matrices in std::optional.
    if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND NOT CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
      target_compile_options(${target} PRIVATE -Wno-error=maybe-uninitialized)
    endif()
  endif()
endfunction()

# precompile(TARGET GROUP HEADER...): what nearly all files of a group's targets include is compiled once, with the first of
# them. They have to be compiled with the same options.
function(precompile target group)
  if(CMAKE_VERSION VERSION_LESS 3.16)
    return()
  endif()
  get_property(first GLOBAL PROPERTY VIEW_SERVO_PRECOMPILED_${group})
  if(first)
    target_precompile_headers(${target} REUSE_FROM ${first})
  else()
    target_precompile_headers(${target} PRIVATE ${ARGN})
    set_property(GLOBAL PROPERTY VIEW_SERVO_PRECOMPILED_${group} ${target})
  endif()
endfunction()

# precompile_ros(TARGET [GROUP]): for static libraries and programs that include much of ROS; of another group than others when
# the code is for shared libraries.
function(precompile_ros target)
  set(group NODES ${ARGN})
  list(GET group -1 group)
  # Of headers that are precompiled GCC warns although they are not ours: it takes parts of boost for uninitialized.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized> -Wno-uninitialized)
  precompile(${target} ${group} <actionlib/server/action_server.h> <diagnostic_updater/diagnostic_updater.h>
    <image_transport/image_transport.h> <message_filters/time_synchronizer.h> <ros/ros.h> <sensor_msgs/CameraInfo.h>
    <sensor_msgs/Image.h> <tf2_ros/transform_listener.h> <opencv2/core.hpp> <Eigen/Geometry>)
endfunction()

# link_visp(TARGET MODULE...). In a function, as ViSP's package sets compiler flags for all that follows in the same scope.
# Modules of Debian 11's, and those that they need, name files of an OpenCV that is not there; its libraries themselves know
# what they need.
function(link_visp target)
  find_package(VISP REQUIRED COMPONENTS ${ARGN})
  set(modules ${ARGN} ${VISP_LIBRARIES})
  set(seen)
  while(modules)
    list(GET modules 0 module)
    list(REMOVE_AT modules 0)
    if(TARGET ${module} AND NOT module IN_LIST seen)
      list(APPEND seen ${module})
      get_target_property(needed ${module} INTERFACE_LINK_LIBRARIES)
      set(present)
      foreach(library ${needed})
        if(library AND (NOT IS_ABSOLUTE "${library}" OR EXISTS "${library}"))
          list(APPEND present ${library})
        endif()
      endforeach()
      set_target_properties(${module} PROPERTIES INTERFACE_LINK_LIBRARIES "${present}")
      list(APPEND modules ${present})
    endif()
  endwhile()
  target_include_directories(${target} SYSTEM PRIVATE ${VISP_INCLUDE_DIRS})
  target_link_libraries(${target} PRIVATE ${ARGN})
endfunction()

# vs_executable(NAME [NODE] FILES file... LIBS library...): a program `NAME` by the target view_servo_NAME, as targets of all
# packages of a workspace share their names. It is installed. A NODE includes much of ROS.
function(vs_executable name)
  cmake_parse_arguments(ARG "NODE" "" "FILES;LIBS" ${ARGN})
  set(target ${PROJECT_NAME}_${name})
  add_executable(${target} ${ARG_FILES})
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name})
  configure_target(${target})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(${target} PRIVATE ${ARG_LIBS})
  if(ARG_NODE)
    precompile_ros(${target})
  endif()
  install(TARGETS ${target} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endfunction()

# export_library(NAME): a library without ROS, which projects that know no catkin find as the package view_servo_NAME, with
# the target view_servo::NAME, in the devel space and in the install space. It is installed as EXPORT view_servo_NAME-targets.
function(export_library name)
  set(package ${PROJECT_NAME}_${name})
  set(folder lib/cmake/${package})
  set_target_properties(${package} PROPERTIES EXPORT_NAME ${name})
  install(EXPORT ${package}-targets NAMESPACE ${PROJECT_NAME}:: DESTINATION ${folder})
  install(FILES cmake/${package}-config.cmake DESTINATION ${folder})
  export(EXPORT ${package}-targets NAMESPACE ${PROJECT_NAME}:: FILE ${CATKIN_DEVEL_PREFIX}/${folder}/${package}-targets.cmake)
  configure_file(cmake/${package}-config.cmake ${CATKIN_DEVEL_PREFIX}/${folder}/${package}-config.cmake COPYONLY)
endfunction()
