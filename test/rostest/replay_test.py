#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
replay.launch with the package's sample: it ends by itself, with headings that are right and a page that shows the view. And
route.launch with a recorded drive, along which it follows the route.
"""
import math
import os
import signal
import sys
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

import rosbag  # noqa: E402
import rospy  # noqa: E402
from geometry_msgs.msg import Twist  # noqa: E402
from view_servo.msg import FollowRouteActionFeedback, FollowRouteActionResult, Heading  # noqa: E402

PATIENCE = 120.0 * graph.SLOWDOWN  # the bag takes 12 s
LARGEST_BAG = 1.5e6                # so that every installation can have it [bytes]
FAR = 0.3                          # where a heading means something [m]


def yaw_of(orientation):
    """Of the camera's optical axis, as the camera looks along the floor."""
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    return math.atan2(2.0 * (y * z - w * x), 2.0 * (x * z + w * y))


class Replay(graph.GraphTest):
    def test_the_sample(self):
        self.assertLess(os.path.getsize(os.path.join(ROOT, "samples", "desk.bag")), LARGEST_BAG)
        status, text = self.graph.run("roslaunch --wait view_servo replay.launch rviz:=false report:=pages "
                                      "play_options:=--rate=0.6", PATIENCE)
        self.assertEqual(status, 0, text)
        pages = os.path.join(self.directory, "pages")
        bag, page = (os.path.join(pages, name) for name in sorted(os.listdir(pages)))
        with open(page) as file:
            content = file.read()
        self.assertIn("no goal was driven to", content)
        self.assertIn("the stored view desk, from the bag", content)
        with rosbag.Bag(bag) as recorded:
            headings = [message for _, message, _ in recorded.read_messages(topics=["/heading"])]
            views = [message for _, message, _ in recorded.read_messages(topics=["/run_view"])]
            truths = {message.header.stamp: message.pose for _, message, _ in recorded.read_messages(topics=["/ground_truth"])}
        self.assertEqual((views[-1].width, views[-1].height), (640, 480))
        if graph.SLOWDOWN > 1.0:
            return  # too slow for images that come in real time
        right, told = 0, 0
        for heading in headings:
            truth = truths.get(heading.header.stamp)
            # The view is where odometry and the world have their origin; the camera is above the base's middle.
            if truth and heading.state != Heading.LOST and math.hypot(truth.position.x, truth.position.y) > FAR:
                told += 1
                wanted = math.atan2(-truth.position.y, -truth.position.x) - yaw_of(truth.orientation)
                difference = math.remainder(heading.heading - wanted, 2.0 * math.pi)
                right += abs(difference) < math.radians(5.0)
        self.assertGreater(told, 20)
        self.assertGreater(right, 0.9 * told, "of %d headings" % told)
        self.assertIn(Heading.ARRIVED, {heading.state for heading in headings})

    def test_a_drive_along_a_route(self):
        bag = os.path.join(self.directory, "drive.bag")
        recording = self.graph.start("roslaunch", "--wait", "view_servo", "record.launch", "bag:=" + bag, "compression:=none")
        status, text = self.graph.run("roslaunch --wait view_servo route.launch result:=" + bag + ".result", 2.0 * PATIENCE)
        self.assertEqual(status, 0, text)
        graph.outcome_of_run(bag + ".result")
        recording.send_signal(signal.SIGINT)
        recording.wait(PATIENCE)

        commands, passed, results = [], [], []
        for topic, kind, take in (("cmd_vel", Twist, commands.append),
                                  ("follow/feedback", FollowRouteActionFeedback, passed.append),
                                  ("follow/result", FollowRouteActionResult, results.append)):
            self.addCleanup(rospy.Subscriber(topic, kind, take, queue_size=1000).unregister)
        status, text = self.graph.run("roslaunch --wait view_servo route.launch bag:=%s route:=demo play_options:=--rate=0.6" % bag,
                                      2.0 * PATIENCE)
        self.assertEqual(status, 0, text)
        self.assertEqual(commands, [], "a dry run commands nothing")
        if graph.SLOWDOWN > 1.0:
            return  # too slow for images that come in real time
        self.assertTrue(results and results[0].result.success, text)
        views = list(dict.fromkeys(message.feedback.view for message in passed))
        self.assertGreater(len(views), 3)
        self.assertEqual(views, sorted(views), "one after the other")
        self.assertIn("arrived", text)


if __name__ == "__main__":
    unittest.main(warnings="ignore")  # ROS leaves sockets to the end
