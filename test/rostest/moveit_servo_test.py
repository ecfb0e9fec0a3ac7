#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
servo_25d drives an arm whose commands go through a program that treats twists as moveit_servo does. That is played here: it
knows the links of robot_description only, turns a twist from the frame in its header into the planning frame without moving
it to another point, scales it when commands have no units, and has the tip of its group follow it. It takes its settings from
the page that says what to set, and others that people have.
"""
import copy
import os
import sys
import threading
import unittest
import xml.etree.ElementTree

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import arm_graph  # noqa: E402
import documents  # noqa: E402
import graph  # noqa: E402
from arm_poses import looking_at_the_box  # noqa: E402

import numpy  # noqa: E402
import rospy  # noqa: E402
import yaml  # noqa: E402
from geometry_msgs.msg import TwistStamped  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from view_servo.msg import ServoError, ServoToViewGoal  # noqa: E402

START = (0.42, 0.10, 0.80, 25)  # of the camera in the world [m], and its turn about its own axis [degrees]
GOAL = (0.50, 0.00, 0.74, 0)
REACHED = 2.0e-3  # [m]
TIPS = {"camera": "camera_optical_frame", "manipulator": "flange"}  # of the groups that a MoveIt configuration may have


def documented_settings():
    """The block of docs/tutorials.md that says what to set in moveit_servo."""
    blocks = [yaml.safe_load(source.text) for source in documents.Document("docs/tutorials.md").sources
              if source.language == "yaml"]
    settings = [block for block in blocks if "move_group_name" in block]
    assert len(settings) == 1, blocks
    return settings[0]


def turn_about(axis, angle):
    x, y, z = axis
    cross = numpy.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return numpy.eye(3) + numpy.sin(angle) * cross + (1.0 - numpy.cos(angle)) * cross @ cross


class Robot:
    """The frames of a URDF by its joints, as a robot's state in MoveIt has them."""

    def __init__(self, urdf):
        self._joints = {}  # by the link below
        for joint in xml.etree.ElementTree.fromstring(urdf).iter("joint"):
            origin, axis = joint.find("origin"), joint.find("axis")
            numbers = [[float(number) for number in text.split()] for text in (
                origin.get("xyz", "0 0 0"), origin.get("rpy", "0 0 0"), axis.get("xyz") if axis is not None else "1 0 0")]
            self._joints[joint.find("child").get("link")] = (joint.get("name"), joint.find("parent").get("link"), *numbers)
        self.links = set(self._joints) | {joint[1] for joint in self._joints.values()}

    def without(self, link):
        """The same robot, described without this link at the end."""
        result = copy.deepcopy(self)
        result.links.remove(link)
        return result

    def link(self, name, angles):
        """(rotation, place) of a link in the root's frame. KeyError when there is no such link."""
        if name not in self.links:
            raise KeyError("Link '%s' not found in robot model" % name)
        rotation, place = numpy.eye(3), numpy.zeros(3)
        while name in self._joints:
            joint, name, xyz, (roll, pitch, yaw), axis = self._joints[name]
            here = turn_about([0, 0, 1], yaw) @ turn_about([0, 1, 0], pitch) @ turn_about([1, 0, 0], roll)
            here = here @ turn_about(axis, angles.get(joint, 0.0))
            rotation, place = here @ rotation, here @ place + numpy.array(xyz)
        return rotation, place


class Consumer:
    """What moveit_servo does with a TwistStamped, up to the twist that the group's tip follows, for puma_sim instead of joints."""

    def __init__(self, robot, settings):
        self._robot = robot
        self._settings = settings
        self._lock = threading.Lock()
        self._angles = {}
        self._newest = None
        self.faults = set()
        self.used = 0
        self._publisher = rospy.Publisher("/cmd_vel", TwistStamped, queue_size=1)
        self._subscribers = [rospy.Subscriber("/joint_states", JointState, self._take_joints),
                             rospy.Subscriber("/servo_server/" + settings["cartesian_command_in_topic"], TwistStamped, self._take)]
        self._timer = rospy.Timer(rospy.Duration(settings["publish_period"]), self._step)

    def stop(self):
        self._timer.shutdown()
        for subscriber in self._subscribers:
            subscriber.unregister()
        self._publisher.unregister()

    def _take_joints(self, message):
        with self._lock:
            self._angles = dict(zip(message.name, message.position))

    def _take(self, message):
        with self._lock:
            self._newest = message

    def _step(self, _):
        with self._lock:
            command, angles = self._newest, dict(self._angles)
        fresh = command and (rospy.Time.now() - command.header.stamp).to_sec() < self._settings["incoming_command_timeout"]
        if not fresh or not angles:
            return  # it halts: puma_sim does so by itself
        try:
            self._publisher.publish(self._camera_twist(*self._tip_twist(command, angles), angles))
            self.used += 1
        except (KeyError, ValueError) as fault:
            self.faults.add(str(fault))

    def _tip_twist(self, command, angles):
        """(linear, angular) velocity of the group's tip in the planning frame."""
        linear = numpy.array([command.twist.linear.x, command.twist.linear.y, command.twist.linear.z])
        angular = numpy.array([command.twist.angular.x, command.twist.angular.y, command.twist.angular.z])
        if self._settings["command_in_type"] == "unitless":
            if max(abs(linear).max(), abs(angular).max()) > 1.0:
                raise ValueError("Component of incoming command is >1. Skipping this datapoint.")
            linear = linear * self._settings["scale"]["linear"]
            angular = angular * self._settings["scale"]["rotational"]
        planning = self._robot.link(self._settings["planning_frame"], angles)[0]
        turn = planning.T @ self._robot.link(command.header.frame_id, angles)[0]
        return turn @ linear, turn @ angular

    def _camera_twist(self, linear, angular, angles):
        """How the camera moves when the tip does so, as puma_sim takes it."""
        planning = self._robot.link(self._settings["planning_frame"], angles)[0]
        rotation, place = self._robot.link("camera_optical_frame", angles)
        tip = self._robot.link(TIPS[self._settings["move_group_name"]], angles)[1]
        linear = linear + numpy.cross(angular, planning.T @ (place - tip))
        turn = rotation.T @ planning
        message = TwistStamped()
        message.header.stamp = rospy.Time.now()
        message.header.frame_id = "camera_optical_frame"
        for vector, values in ((message.twist.linear, turn @ linear), (message.twist.angular, turn @ angular)):
            vector.x, vector.y, vector.z = values
        return message


class MoveitServo(arm_graph.ArmTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        with open(os.path.join(ROOT, "urdf", "puma560.urdf")) as file:
            cls.robot = Robot(file.read())
        cls.settings = documented_settings()
        cls.lock = threading.Lock()
        cls.points = []
        cls.start_arm([rospy.Subscriber("/servo_error", ServoError, cls.take_error)],
                      "cmd_vel:=/servo_server/" + cls.settings["cartesian_command_in_topic"])
        cls.put(GOAL)
        for command in ("rosrun view_servo view save shelf --roi 172 31 296 418", "rosservice call /servo_25d/enable true"):
            status, text = cls.graph.run(command)
            assert status == 0, text

    @classmethod
    def take_error(cls, message):
        with cls.lock:
            cls.points.append((message.point_x - message.wanted_x, message.point_y - message.wanted_y))

    @classmethod
    def distance(cls, pose):
        return numpy.linalg.norm(cls.place - pose[:3])

    @classmethod
    def put(cls, pose):
        status, text = cls.graph.run("rosservice call /puma_sim/set_pose '%s'" % looking_at_the_box(*pose))
        assert status == 0 and "success: True" in text, text
        graph.wait_until("the camera there", lambda: cls.distance(pose) < 1e-4)

    def drive(self, **changes):
        """To the view, with these settings changed. Returns how far the chosen point leaves a line [px]."""
        self.put(START)
        with self.lock:
            self.points.clear()
        consumer = Consumer(self.robot, dict(self.settings, **changes))
        try:
            self.client.send_goal(ServoToViewGoal(view="shelf", timeout=60.0))
            result = self.wait_for_result(80.0 * graph.SLOWDOWN)
        finally:
            consumer.stop()
        self.assertEqual(consumer.faults, set(), result)
        self.assertTrue(result.success, result)
        self.assertLess(self.distance(GOAL), REACHED)
        with self.lock:
            points = numpy.array(self.points)
        points = points[~numpy.isnan(points).any(axis=1)]
        x, y = points[0] / numpy.linalg.norm(points[0])
        beside = abs(points @ [-y, x]).max()
        print("%s: %.1f s, %.1f px beside a line, %.2f mm off" % (changes, result.duration, beside, 1e3 * self.distance(GOAL)),
              flush=True)
        return beside

    def test_converges_with_the_documented_settings(self):
        self.assertEqual(TIPS[self.settings["move_group_name"]], "camera_optical_frame")
        self.assertLess(self.drive(), 15.0)

    def test_converges_where_commands_have_no_units(self):
        self.drive(command_in_type="unitless")
        # The scales that moveit_servo comes with.
        self.drive(command_in_type="unitless", scale={"linear": 0.4, "rotational": 0.8})

    def test_converges_where_the_group_ends_at_the_flange(self):
        self.drive(move_group_name="manipulator")

    def test_moves_nothing_where_the_camera_is_no_link(self):
        self.put(START)
        consumer = Consumer(self.robot.without("camera_optical_frame"), self.settings)
        try:
            self.client.send_goal(ServoToViewGoal(view="shelf", timeout=3.0))
            result = self.wait_for_result()
        finally:
            consumer.stop()
        self.assertIn("not at the view within 3 s", result.message)
        self.assertEqual((consumer.used, len(consumer.faults)), (0, 1))
        self.assertIn("Link 'camera_optical_frame' not found in robot model", consumer.faults.pop())
        self.assertLess(self.distance(START), 1e-4)


if __name__ == "__main__":
    unittest.main(verbosity=2)
