# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
#
# The part of view_servo that needs no ROS, as the target view_servo::core.
include(CMakeFindDependencyMacro)
find_dependency(Eigen3)
find_dependency(OpenCV COMPONENTS core imgproc imgcodecs calib3d video)
find_dependency(Threads)
include(${CMAKE_CURRENT_LIST_DIR}/view_servo_core-targets.cmake)
