#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
A list of views as one goal of servo_25d, with the simulated arm: an approach view and a grasp view, to the end, cancelled
between the two and on the way, with a view that is not there, and with one that is deleted on the way.
"""
import os
import sys
import threading
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import arm_graph  # noqa: E402
import graph  # noqa: E402
from arm_poses import looking_at_the_box  # noqa: E402

import actionlib  # noqa: E402
import numpy  # noqa: E402
import rospy  # noqa: E402
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped  # noqa: E402
from std_msgs.msg import Bool  # noqa: E402
from view_servo.msg import ServoToViewGoal, ServoView  # noqa: E402

# Of the camera in the world [m], and its turn about its own axis [degrees].
START = (0.38, -0.12, 0.84, -12)
APPROACH = (0.44, 0.02, 0.76, 4)
GRASP = (0.50, 0.00, 0.74, 0)
# The printed face in each picture [px].
REGIONS = {"approach": "195 65 255 360", "grasp": "172 31 296 418"}
REST = 2.0e-3  # from a view where the arm has converged [m]


class ArmViews(arm_graph.ArmTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.lock = threading.Lock()
        cls.commands, cls.feedback, cls.poses = [], [], []
        cls.stop = rospy.Publisher("/stop", Bool, queue_size=1, latch=True)
        cls.start_arm([rospy.Subscriber("/cmd_vel", TwistStamped, cls.take_command),
                       rospy.Subscriber("/homography_tracker/camera_pose", PoseWithCovarianceStamped, cls.take_pose)])
        status, text = cls.graph.run("rosservice call /servo_25d/enable true")
        assert status == 0, text

    @classmethod
    def take_command(cls, message):
        twist = message.twist
        with cls.lock:
            cls.commands.append([twist.linear.x, twist.linear.y, twist.linear.z,
                                 twist.angular.x, twist.angular.y, twist.angular.z])

    @classmethod
    def take_feedback(cls, message):
        with cls.lock:
            cls.feedback.append(message)

    @classmethod
    def take_pose(cls, message):
        with cls.lock:
            cls.poses.append(message)

    def distance(self, pose):
        return numpy.linalg.norm(self.place - pose[:3])

    def hold(self, pose):
        status, text = self.graph.run("rosservice call /puma_sim/set_pose '%s'" % looking_at_the_box(*pose))
        self.assertEqual(status, 0, text)
        self.assertIn("success: True", text)
        graph.wait_until("the camera there", lambda: self.distance(pose) < 1e-4)

    def save(self, name, pose):
        self.hold(pose)
        status, text = self.graph.run("rosrun view_servo view save %s --overwrite --roi %s" % (name, REGIONS[name]))
        self.assertEqual(status, 0, text)

    def setUp(self):
        self.save("approach", APPROACH)
        self.save("grasp", GRASP)
        self.hold(START)
        with self.lock:
            self.commands.clear()
            self.feedback.clear()
            self.poses.clear()

    def tearDown(self):
        # One that has ended is not cancelled: actionlib would wait for its cancellation for ever.
        if self.client.gh is not None and self.client.gh.get_comm_state() != actionlib.CommState.DONE:
            self.client.cancel_goal()
            self.wait_for_result()

    def last(self):
        """The last feedback."""
        with self.lock:
            return self.feedback[-1] if self.feedback else None

    def number(self):
        """Of the view that the last feedback is about."""
        last = self.last()
        return last.number if last else 0

    def moving(self):
        with self.lock:
            return bool(self.commands) and any(self.commands[-1])

    def send(self, *names):
        """All but the last have a wide tolerance."""
        views = [ServoView(view=name, translation_tolerance=0.005, rotation_tolerance=0.02, dwell=0.2) for name in names[:-1]]
        self.client.send_goal(ServoToViewGoal(views=views + [ServoView(view=names[-1])], timeout=60.0),
                              feedback_cb=self.take_feedback)

    def end(self, state, words):
        """The goal must end so; the last command must be zero then, and the arm stand. Returns the result."""
        result = self.wait_for_result()
        self.assertEqual(self.client.get_state(), state, result)
        self.assertIn(words, result.message)
        graph.wait_until("zeros", lambda: not self.moving())
        places = []

        def stands():
            places.append(self.place)
            return len(places) > 1 and numpy.linalg.norm(places[-1] - places[-2]) < 1e-6

        graph.wait_until("the arm to stand", stands)
        return result

    def test_goes_to_both(self):
        self.send("approach", "grasp")
        graph.wait_until("the way to the second view", lambda: self.number() == 2)
        self.assertLess(self.distance(APPROACH), 0.007)
        result = self.end(actionlib.GoalStatus.SUCCEEDED, "view 'grasp', 2 of 2: ")
        self.assertEqual((result.success, result.reached), (True, 2))
        self.assertLess(self.distance(GRASP), REST)
        with self.lock:
            told = [(message.number, message.view, message.count) for message in self.feedback]
        self.assertEqual(sorted(set(told)), [(1, "approach", 2), (2, "grasp", 2)])
        self.assertEqual(told, sorted(told))
        self.check_poses()

    def check_poses(self):
        """Of the camera in the frame of the first view, by the tracker, once it knows the distance, until it is reached."""
        with self.lock:
            poses = [message for message in self.poses if message.header.frame_id == "view_approach"]
        self.assertGreater(len(poses), 5)
        way = numpy.linalg.norm(numpy.subtract(START[:3], APPROACH[:3]))
        for message, most in ((poses[0], 0.75 * way), (poses[-1], 0.007)):
            place = message.pose.pose.position
            variances = numpy.diag(numpy.reshape(message.pose.covariance, (6, 6)))
            self.assertTrue((variances > 0.0).all(), message)
            self.assertLess(numpy.linalg.norm((place.x, place.y, place.z)), most + 3.0 * numpy.sqrt(variances[:3].sum()), message)
        self.assertLess(variances[:3].max(), 4.0 * REST**2)

    def test_the_command_does_so_too(self):
        status, text = self.graph.run("rosrun view_servo view go approach grasp --approach 0.005 0.02")
        self.assertEqual(status, 0, text)
        self.assertIn("view 'approach', 1 of 2: drives to the view", text)
        self.assertIn("arrived: view 'grasp', 2 of 2: ", text)
        self.assertLess(self.distance(GRASP), REST)

    def test_is_cancelled_between(self):
        self.send("approach", "grasp")
        graph.wait_until("the first view", lambda: self.number() == 2)
        self.client.cancel_goal()
        self.assertEqual(self.end(actionlib.GoalStatus.PREEMPTED, "cancelled").reached, 1)
        self.assertGreater(self.distance(GRASP), 0.02)

    def test_is_cancelled_on_the_way(self):
        self.send("approach", "grasp")
        graph.wait_until("motion", self.moving)
        self.client.cancel_goal()
        self.assertEqual(self.end(actionlib.GoalStatus.PREEMPTED, "cancelled").reached, 0)
        self.assertGreater(self.distance(APPROACH), 0.02)

    def test_refuses_a_view_that_is_not_there(self):
        self.send("approach", "nothing")
        self.assertEqual(self.end(actionlib.GoalStatus.ABORTED, "cannot load view 'nothing'").reached, 0)
        self.assertLess(self.distance(START), 1e-4)
        with self.lock:
            self.assertFalse(any(any(command) for command in self.commands))

    def test_ends_where_a_view_has_been_deleted(self):
        self.send("approach", "grasp")
        graph.wait_until("motion", self.moving)
        self.stop.publish(True)  # so that it is still on its way when the view has gone, however slow this machine is
        graph.wait_until("the arm to be held", lambda: not self.moving())
        status, text = self.graph.run("rosrun view_servo view delete grasp")
        self.assertEqual(status, 0, text)
        self.assertEqual(self.number(), 1)
        self.stop.publish(False)
        result = self.end(actionlib.GoalStatus.ABORTED, "view 'grasp', 2 of 2: homographies on '/homography_tracker/homography'")
        self.assertIn("cannot load view 'grasp'", result.message)
        self.assertEqual(result.reached, 1)
        self.assertLess(self.distance(APPROACH), 0.01)


if __name__ == "__main__":
    unittest.main(verbosity=2)
