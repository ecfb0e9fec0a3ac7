# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
#
# The control law of an arm, as the target view_servo::servo. It links ViSP, so what links it comes under the GPL.
include(CMakeFindDependencyMacro)
find_dependency(view_servo_core)
include(${CMAKE_CURRENT_LIST_DIR}/view_servo_servo-targets.cmake)
