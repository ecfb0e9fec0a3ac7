#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
Markers of homing and homography_tracker in simulation: the view and the ways end where the truth has them, everything is
deleted at the end of a goal, and nothing is published while nobody subscribes.
"""
import math
import os
import signal
import sys
import threading
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

import rospy  # noqa: E402
from geometry_msgs.msg import PoseStamped  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from view_servo.srv import GetView  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

PATIENCE = 120.0 * graph.SLOWDOWN  # for a run [s]
START = (-0.906, 0.423)            # of the base in the world desk, a metre from where it looks from [m]
NEAR = 0.02                        # [m]
TURNED = math.radians(1.0)


def planar(pose):
    """x, y, and the yaw of the z axis, as a camera looks along the floor."""
    q = pose.orientation
    return (pose.position.x, pose.position.y,
            math.atan2(2.0 * (q.y * q.z - q.w * q.x), 2.0 * (q.x * q.z + q.w * q.y)))


def compose(a, b):
    c, s = math.cos(a[2]), math.sin(a[2])
    return (a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], a[2] + b[2])


def inverse(a):
    c, s = math.cos(a[2]), math.sin(a[2])
    return (-c * a[0] - s * a[1], s * a[0] - c * a[1], -a[2])


def added(message):
    return {marker.ns: marker for marker in message.markers if marker.action == Marker.ADD}


class Markers(graph.GraphTest):
    def setUp(self):
        self.lock = threading.Lock()
        self.messages, self.truth, self.odometry = [], None, None
        self.process = None
        self.subscribers = [rospy.Subscriber("/ground_truth", PoseStamped, self.take_truth),
                            rospy.Subscriber("/odom", Odometry, self.take_odometry)]

    def tearDown(self):
        for subscriber in self.subscribers:
            subscriber.unregister()
        if self.process:
            self.process.send_signal(signal.SIGINT)
            self.process.wait(PATIENCE)

    def take_truth(self, message):
        self.truth = message.pose

    def take_odometry(self, message):
        self.odometry = message

    def take_markers(self, message):
        with self.lock:
            self.messages.append(message)

    def so_far(self):
        with self.lock:
            return list(self.messages)

    def listen(self, topic):
        self.subscribers.append(rospy.Subscriber(topic, MarkerArray, self.take_markers))
        return self.subscribers[-1]

    def run_to_its_end(self, file):
        """A simulated run, whose nodes go on when it has ended. Returns whether it is one to judge markers by."""
        result = os.path.join(self.directory, file + ".result")
        self.process = self.graph.start("roslaunch", "view_servo", file, "exit:=false", "result:=" + result,
                                        "patience:=%g" % PATIENCE)
        graph.wait_until("the end of the run", lambda: os.path.exists(result) and os.path.getsize(result), 2.0 * PATIENCE)
        return graph.outcome_of_run(result) == 0  # with sanitizers, a base may be too slow to arrive

    def shown_until_the_end(self):
        """The markers that were shown last; all of them have to be deleted then."""
        graph.wait_until("the deletion", lambda: self.so_far() and not added(self.so_far()[-1]))
        messages = self.so_far()
        last, deletion = [message for message in messages if added(message)][-1], messages[-1]
        self.assertEqual({marker.ns for marker in deletion.markers}, set(added(last)))
        self.assertEqual({marker.action for marker in deletion.markers}, {Marker.DELETE})
        for message in messages:
            for marker in added(message).values():
                for point in marker.points + [marker.pose.position]:
                    self.assertTrue(all(map(math.isfinite, (point.x, point.y, point.z))), marker.ns)
        return added(last)

    def command(self, line):
        status, text = self.graph.run(line, PATIENCE)
        self.assertEqual(status, 0, text)

    def assert_near(self, place, wanted, what):
        self.assertLess(math.hypot(place[0] - wanted[0], place[1] - wanted[1]), NEAR, "%s at %s" % (what, place))

    def test_base(self):
        """Of two goals: nobody subscribes during the first one."""
        if not self.run_to_its_end("homing.launch"):
            return
        first_ended = rospy.Time.now()
        self.command("rosrun view_servo view save anew")  # nothing is learnt of it yet
        goal = planar(self.truth)
        self.command("rosservice call /nomad_sim/set_pose '{pose: {position: {x: %g, y: %g}, orientation: {w: 1.0}}}'" % START)
        markers = self.listen("/homing/markers")
        graph.wait_until("a connection", lambda: markers.get_num_connections() > 0)
        self.command("rosrun view_servo view go anew --enable")
        shown = self.shown_until_the_end()
        # What had been published before would have come at once, as it is latched.
        self.assertGreater(self.so_far()[0].markers[0].header.stamp, first_ended)
        parts = [set(added(message)) for message in self.so_far()]
        self.assertIn("direction", set.union(*parts))  # at first only that is known
        self.assertFalse([part for part in parts if {"direction", "view"} <= part])
        self.assertEqual(set(shown), {"camera", "view", "way_to_go", "way_driven", "points"})
        self.assertEqual({shown[part].header.frame_id for part in set(shown) - {"camera"}}, {"odom"})
        self.assertEqual(shown["camera"].header.frame_id, "camera_optical_frame")

        # Odometry did not notice that the base was put at its start: where the base is now places its frame in the world.
        now = planar(self.truth)
        base = self.odometry.pose.pose
        base_in_odom = (base.position.x, base.position.y, 2.0 * math.atan2(base.orientation.z, base.orientation.w))
        odom_in_world = compose(now, inverse(base_in_odom))  # the camera is above the base's middle
        frustum = compose(odom_in_world, planar(shown["view"].pose))
        self.assert_near(frustum, goal, "the view")
        self.assertLess(abs(math.remainder(frustum[2] - goal[2], 2.0 * math.pi)), TURNED)
        to_go, driven = shown["way_to_go"].points, shown["way_driven"].points
        for point, wanted, what in ((to_go[-1], goal, "the end of the way to go"),
                                    (driven[-1], now, "the end of the way driven"),
                                    (driven[0], START, "the beginning of the way driven")):
            self.assert_near(compose(odom_in_world, (point.x, point.y, 0.0)), wanted, what)
        supporting = [colour for colour in shown["points"].colors if colour.g > colour.r]
        self.assertGreater(len(supporting), 0.5 * len(shown["points"].colors))

    def test_arm(self):
        self.listen("/homography_tracker/markers")
        if not self.run_to_its_end("arm_servo.launch"):
            return
        shown = self.shown_until_the_end()
        self.assertEqual(set(shown), {"camera", "view", "way_to_go", "way_driven", "points", "plane"})
        self.assertEqual(shown["camera"].header.frame_id, "camera_optical_frame")
        rospy.wait_for_service("/view_store/get", PATIENCE)
        view = rospy.ServiceProxy("/view_store/get", GetView)("demo").pose  # by tf, when it was stored
        marker = shown["view"]
        self.assertEqual(marker.header.frame_id, view.header.frame_id)
        found, wanted = marker.pose.position, view.pose.position
        self.assertLess(math.dist((found.x, found.y, found.z), (wanted.x, wanted.y, wanted.z)), NEAR)
        q, p = marker.pose.orientation, view.pose.orientation
        self.assertLess(2.0 * math.acos(min(1.0, abs(q.x * p.x + q.y * p.y + q.z * p.z + q.w * p.w))), TURNED)
        self.assertEqual(len(shown["plane"].points), 6)


if __name__ == "__main__":
    unittest.main()
