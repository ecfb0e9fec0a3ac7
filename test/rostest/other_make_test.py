#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
Homing of a base that is made otherwise than the simulated Nomad, by what docs/bring_up.md says: one that cannot slide and
whose wheels have a deadband; odometry of base_footprint in odom_combined, at 20 Hz; a camera 15 cm before the axle with
colours, 30 images a second and a lens that bends; and other names of all topics.
"""
import collections
import os
import sys
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

import numpy  # noqa: E402
import rospy  # noqa: E402
import yaml  # noqa: E402
from geometry_msgs.msg import PoseStamped, Twist  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from sensor_msgs.msg import CameraInfo, Image  # noqa: E402
from view_servo.srv import SetPose  # noqa: E402

PATIENCE = 120.0 * graph.SLOWDOWN  # for one command [s]
AHEAD, HEIGHT = 0.15, 0.55         # of the camera, from the axle and above the floor [m]
BASE_LINK_HEIGHT = 0.1             # above the floor [m]
DEADBAND = 0.01, 0.04              # of speed and turn rate [m/s, rad/s]
LENS = [-0.25, 0.06, 0.001, -0.0005, 0.0]
NAMES = "camera:=/head_camera/rgb odom:=/mobile_base/odometry cmd_vel:=/mobile_base/commands/velocity"
NEAR, STRAIGHT = 0.01, numpy.radians(1.0)  # of the view [m, rad]
STILL = 1e-6                               # between two images of a camera that stands [m]
STARTS = {"behind it and to the left": (-0.9, 0.35, 0.1), "in front of it": (0.4, 0.1, -0.1)}

Camera = collections.namedtuple("Camera", "x y yaw")  # on the floor; yaw is of the optical axis [m, m, rad]


def on_floor(pose):
    q = pose.orientation
    return Camera(pose.position.x, pose.position.y,
                  numpy.arctan2(2 * (q.y * q.z - q.x * q.w), 2 * (q.x * q.z + q.y * q.w)))


def mounted_on(x, y, yaw):
    """The camera of a base that is there."""
    return Camera(x + AHEAD * numpy.cos(yaw), y + AHEAD * numpy.sin(yaw), yaw)


def apart(a, b):
    """Distance and angle between two cameras [m, rad]."""
    return numpy.hypot(a.x - b.x, a.y - b.y), abs((a.yaw - b.yaw + numpy.pi) % (2 * numpy.pi) - numpy.pi)


class OtherMake(graph.GraphTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        with open(os.path.join(ROOT, "config", "worlds", "desk.yaml")) as file:
            world = yaml.safe_load(file)
        world["robot"].update(camera_height=HEIGHT, camera_ahead=AHEAD)
        world["camera"].update(rate=30, distortion_model="plumb_bob", distortion=LENS, supersampling=1)
        world_file = os.path.join(cls.directory, "flat.yaml")
        with open(world_file, "w") as file:
            yaml.safe_dump(world, file)
        cls.truths, cls.commands = [], []
        rospy.Subscriber("ground_truth", PoseStamped, lambda message: cls.truths.append(on_floor(message.pose)))
        rospy.Subscriber("mobile_base/commands/velocity", Twist, cls.commands.append)
        cls.graph.start(
            "rosrun", "view_servo", "nomad_sim", "__name:=mobile_base", "_world:=" + world_file, "_base:=differential",
            "_deadband_speed:=%g" % DEADBAND[0], "_deadband_turn_rate:=%g" % DEADBAND[1], "_control_rate:=20",
            "_odom_frame:=odom_combined", "_footprint_frame:=base_footprint", "_base_link_height:=%g" % BASE_LINK_HEIGHT,
            "_encoding:=rgb8", "camera/image_raw:=head_camera/rgb/image_raw", "odom:=mobile_base/odometry",
            "cmd_vel:=mobile_base/commands/velocity")
        cls.graph.start("roslaunch", "view_servo", "homing.launch", "sim:=false", "base:=differential",
                        "fixed_frame:=odom_combined", "views_dir:=" + os.path.join(cls.directory, "views"), *NAMES.split())
        graph.wait_until("images", lambda: len(cls.truths) > 1)

    def run_command(self, command):
        status, output = self.graph.run(command, timeout=PATIENCE)
        self.assertEqual(status, 0, output + self.graph.log())
        return output

    def put(self, x, y, yaw):
        place = SetPose._request_class()
        place.pose.position.x, place.pose.position.y = x, y
        place.pose.orientation.z, place.pose.orientation.w = numpy.sin(0.5 * yaw), numpy.cos(0.5 * yaw)
        answer = rospy.ServiceProxy("mobile_base/set_pose", SetPose)(place)
        self.assertTrue(answer.success, answer.message)
        there = mounted_on(x, y, yaw)
        graph.wait_until("an image from there", lambda: max(apart(there, truth)[0] for truth in self.truths[-2:]) < 1e-3)

    def at_rest(self):
        """The camera, once it stands."""
        def stands():
            latest = self.truths[-2:]
            return apart(*latest)[0] < STILL and latest[1]
        return graph.wait_until("a base that stands", stands)

    def test_1_is_another_make(self):
        image = rospy.wait_for_message("head_camera/rgb/image_raw", Image, PATIENCE)
        self.assertEqual(image.encoding, "rgb8")
        info = rospy.wait_for_message("head_camera/rgb/camera_info", CameraInfo, PATIENCE)
        self.assertEqual((info.distortion_model, list(info.D)), ("plumb_bob", LENS))
        odometry = [rospy.wait_for_message("mobile_base/odometry", Odometry, PATIENCE) for _ in range(2)]
        self.assertEqual((odometry[0].header.frame_id, odometry[0].child_frame_id), ("odom_combined", "base_footprint"))
        self.assertGreater((odometry[1].header.stamp - odometry[0].header.stamp).to_sec(), 0.03)

    def test_2_check_robot_finds_nothing_wrong(self):
        status, output = self.graph.run("rosrun view_servo check_robot homing --seconds 3 " + NAMES, timeout=PATIENCE)
        self.assertLess(status, 2, output)  # 1: warnings, as of a busy machine
        for words in ("%g m up and %g m ahead of 'base_link'" % (HEIGHT - BASE_LINK_HEIGHT, AHEAD),
                      "pose of 'base_footprint' in 'odom_combined'"):
            self.assertIn(words, output)

    def test_3_homing_arrives(self):
        self.put(0.0, 0.0, 0.0)
        goal = self.at_rest()
        self.assertIn("with its pose in odom_combined", self.run_command("rosrun view_servo view save dock --overwrite"))
        for name, start in STARTS.items():
            with self.subTest(name):
                self.put(*start)
                self.commands.clear()
                output = self.run_command("rosrun view_servo view go dock --enable")
                distance, angle = apart(goal, self.at_rest())
                print("%s: %.1f mm, %.2f degrees" % (name, 1e3 * distance, numpy.degrees(angle)), flush=True)
                if graph.SLOWDOWN == 1.0:
                    self.assertLess(distance, NEAR, output)
                    self.assertLess(angle, STRAIGHT, output)
                self.assertTrue(self.commands)
                self.assertFalse([twist for twist in self.commands if twist.linear.y != 0.0])


if __name__ == "__main__":
    unittest.main(verbosity=2)
