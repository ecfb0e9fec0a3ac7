// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
//
// A process of one node: the build defines VIEW_SERVO_NODE as the constant of nodes.h that says which.
#include "nodes/nodes.h"

int main(int argc, char** argv)
{
  return view_servo::VIEW_SERVO_NODE.run(argc, argv);
}
