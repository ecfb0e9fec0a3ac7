#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""Whole runs during which the nodes that tell a driver where its view is are stopped for a while by SIGSTOP, as a machine
that is short of memory or processors does: the robot stands, says why, and arrives after they go on."""
import os
import signal
import sys
import time
import unittest

import rospy
from geometry_msgs.msg import Twist, TwistStamped

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

from view_servo.msg import ServoStatus  # noqa: E402

PATIENCE = 180.0 * graph.SLOWDOWN  # [s]
STOPPED = 2.0  # how long [s]


def is_zero(twist):
    return not any((twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y, twist.angular.z))


class StoppedPeers(graph.GraphTest):
    def setUp(self):
        self.commands = []  # (steady time, twist)
        self.statuses = []
        self.stopped = []
        self.subscribers = []

    def tearDown(self):
        for subscriber in self.subscribers:
            subscriber.unregister()
        for pid in self.stopped:
            os.kill(pid, signal.SIGCONT)

    def moves(self):
        return bool(self.commands) and not is_zero(self.commands[-1][1])

    def stop(self, nodes, master=False):
        self.stopped = [self.graph.pid_of(node) for node in nodes]
        if master:
            self.stopped.append(self.graph.master.getPid(graph.CALLER)[2])
        for pid in self.stopped:
            os.kill(pid, signal.SIGSTOP)
        return time.monotonic()

    def go_on(self):
        while self.stopped:
            os.kill(self.stopped.pop(), signal.SIGCONT)

    def kill(self, nodes):
        for node in nodes:
            os.kill(self.graph.pid_of(node), signal.SIGKILL)
        return time.monotonic()

    def last_motion(self):
        return max(moment for moment, twist in self.commands if not is_zero(twist))

    def listen(self, message, twist_of):
        def take_command(command):
            self.commands.append((time.monotonic(), twist_of(command)))

        self.subscribers = [rospy.Subscriber("/cmd_vel", message, take_command, queue_size=1000),
                            rospy.Subscriber("/status", ServoStatus, self.statuses.append, queue_size=1000)]

    def begin(self, launch_file):
        """@return the process of roslaunch and the file that tells the outcome, when the robot moves."""
        result = os.path.join(self.directory, launch_file + ".result")
        process = self.graph.start("roslaunch", "--wait", "view_servo", launch_file, "result:=" + result)
        graph.wait_until("motion", self.moves, PATIENCE)
        return process, result

    def assert_arrives(self, process, result):
        process.wait(PATIENCE)
        with open(result) as outcome:
            self.assertTrue(outcome.read().startswith("0"), self.graph.log())
        self.assertTrue(is_zero(self.commands[-1][1]))
        self.assertTrue(all(status.reason for status in self.statuses))

    def test_arm(self):
        self.listen(TwistStamped, lambda command: command.twist)
        process, result = self.begin("arm_servo.launch")
        since = self.stop(["/homography_tracker"])
        graph.wait_until("a stand", lambda: not self.moves(), 5.0)
        graph.wait_until("the end of the pause", lambda: time.monotonic() > since + STOPPED)
        self.assertFalse(self.moves())
        self.assertLess(self.last_motion() - since, 1.0)
        self.assertEqual(self.statuses[-1].state, ServoStatus.LOST)
        self.assertNotEqual(self.statuses[-1].reason, "")
        self.go_on()
        self.assert_arrives(process, result)

    def test_base(self):
        self.listen(Twist, lambda command: command)
        process, result = self.begin("homing.launch")
        since = self.stop(["/point_matcher", "/line_matcher"])
        graph.wait_until("the end of the pause", lambda: time.monotonic() > since + STOPPED)
        self.go_on()
        self.assert_arrives(process, result)

    def test_route_while_the_master_hangs(self):
        """The follower has asked the master where a recognizer is when its view is not found; nothing may wait for that."""
        self.listen(Twist, lambda command: command)
        process, result = self.begin("route.launch")
        drives = "view 'demo_003', "
        graph.wait_until("the third view", lambda: any(drives in status.reason for status in self.statuses), PATIENCE)
        since = self.stop(["/point_matcher", "/line_matcher"], master=True)
        asked = since + 2.0  # when the view has not been found for so long
        graph.wait_until("a stand", lambda: time.monotonic() > asked + 1.0 and not self.moves(), 15.0 * graph.SLOWDOWN)
        graph.wait_until("further commands", lambda: self.commands[-1][0] > asked + 1.5)
        self.assertNotEqual(self.statuses[-1].reason, "")
        self.go_on()
        self.assert_arrives(process, result)

    def test_arm_whose_tracker_dies(self):
        self.listen(TwistStamped, lambda command: command.twist)
        process, _ = self.begin("arm_servo.launch")
        since = self.kill(["/homography_tracker"])
        process.wait(PATIENCE)  # it ends with a node that it needs
        self.assertLess(self.last_motion() - since, 1.0)
        self.assertTrue(is_zero(self.commands[-1][1]))

    def test_base_whose_matchers_die_and_return(self):
        self.listen(Twist, lambda command: command)
        process, result = self.begin("homing.launch")
        since = self.kill(["/point_matcher", "/line_matcher"])
        graph.wait_until("the end of the pause", lambda: time.monotonic() > since + STOPPED)
        for matcher in ("point_matcher", "line_matcher"):  # with the parameters that the launch file gave them
            self.graph.start("rosrun", "view_servo", matcher, "image_raw:=camera/image_raw",
                             "camera_info:=camera/camera_info", "wanted_view:=homing/wanted_view")
        self.assert_arrives(process, result)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], warnings="ignore")  # of rospy
