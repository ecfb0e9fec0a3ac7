#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""A simulated run where a real robot listens to the same commands: it must not move."""
import os
import subprocess
import sys
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

import rospy  # noqa: E402
from geometry_msgs.msg import Twist  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402


class ForeignRobot(graph.GraphTest):
    def check(self, topic, *arguments):
        """A run with a robot that listens on a topic."""
        commands = []
        odometry = rospy.Publisher("/wheels/odom", Odometry, queue_size=1)
        subscriber = rospy.Subscriber(topic, Twist, commands.append)
        self.addCleanup(odometry.unregister)
        self.addCleanup(subscriber.unregister)
        run = subprocess.run(["roslaunch", "view_servo", "homing.launch", *arguments], env=self.graph.environment,
                             cwd=self.directory, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                             universal_newlines=True, timeout=120.0 * graph.SLOWDOWN, check=False)
        self.assertIn("'%s' listens on '%s', too, and would move with the simulated robot: for a real robot add sim:=false" % (
            rospy.get_name(), topic), run.stdout)
        self.assertFalse(any(command.linear.x or command.linear.y or command.angular.z for command in commands))

    def test_does_not_move(self):
        self.check("/cmd_vel")

    def test_does_not_move_by_commands_of_another_name(self):
        self.check("/mobile_base/commands", "cmd_vel:=/mobile_base/commands")


if __name__ == "__main__":
    unittest.main(verbosity=2, warnings="ignore")  # ROS leaves sockets to the end
