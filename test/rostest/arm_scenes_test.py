#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
arm_servo.launch before scenes with depth, as a user starts it: the arm arrives, and homography_tracker says what it follows.
"""
import os
import re
import sys
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

import rospy  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from view_servo.msg import Homography  # noqa: E402

PATIENCE = 120.0 * graph.SLOWDOWN  # for a run [s]
NEAR = 1.0                         # where the camera has to end, from where the view was stored [mm]
STRAIGHT = 0.1                     # likewise [degrees]


class ArmScenes(graph.GraphTest):
    def setUp(self):
        self.homographies, self.followed_as = [], set()
        self.subscribers = [rospy.Subscriber("/homography_tracker/homography", Homography, self.homographies.append),
                            rospy.Subscriber("/diagnostics", DiagnosticArray, self.take_diagnostics)]

    def tearDown(self):
        for subscriber in self.subscribers:
            subscriber.unregister()

    def take_diagnostics(self, message):
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            if status.message.startswith("tracking") and "Followed as" in values:
                self.followed_as.add(values["Followed as"])

    def arrive(self, *arguments):
        """Runs until the arm has arrived. @return the valid homographies on the way."""
        result = os.path.join(self.directory, "result")
        _, text = self.graph.run("roslaunch view_servo arm_servo.launch result:=%s patience:=%g %s" %
                                 (result, PATIENCE, " ".join(arguments)), PATIENCE)
        self.assertTrue(os.path.exists(result), text[-3000:])
        if graph.outcome_of_run(result) == 0:
            with open(result) as file:
                outcome = file.read()
            off = re.search(r"([\d.]+) mm and ([\d.]+) degrees", outcome)
            self.assertTrue(off, outcome)
            self.assertLess(float(off.group(1)), NEAR, outcome)
            self.assertLess(float(off.group(2)), STRAIGHT, outcome)
        return [homography for homography in self.homographies if homography.valid]

    def test_parts_are_followed_as_a_scene_from_near(self):
        valid = self.arrive("world:=parts", "start:=near", "target:=scene")
        self.assertIn("scene", self.followed_as)
        last = valid[-1]
        self.assertEqual((last.normal.x, last.normal.y, last.normal.z), (0.0, 0.0, 1.0))
        self.assertFalse(last.ambiguous)

    def test_parts_are_followed_as_a_scene_when_that_is_said(self):
        self.arrive("world:=parts", "start:=extreme", "groups:=distractors", "target:=scene")
        self.assertEqual(self.followed_as, {"scene"})

    def test_a_rack_is_followed_as_a_scene(self):
        self.arrive("world:=rack", "start:=far", "target:=scene")
        self.assertEqual(self.followed_as, {"scene"})

    def test_rice_is_followed_as_a_plane(self):
        self.arrive("world:=rice", "start:=near")
        self.assertEqual(self.followed_as, {"plane"})


if __name__ == "__main__":
    unittest.main(verbosity=2)
