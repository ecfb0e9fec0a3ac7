#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
calibrate_hand_eye against the simulated arm: this test brings it from pose to pose as a person would, and compares the file
with the arm's description. Then publish_hand_eye and arm_servo.launch with that file, and what all of them refuse.
"""
import os
import re
import signal
import subprocess
import sys
import threading
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import graph  # noqa: E402
from arm_poses import looking_at_the_box, matrix_of  # noqa: E402

import genpy.dynamic  # noqa: E402
import geometry_msgs.msg  # noqa: E402
import numpy  # noqa: E402
import rospy  # noqa: E402
import sensor_msgs.msg  # noqa: E402
import yaml  # noqa: E402

DONE, NOT_DONE, CANNOT = 0, 1, 2
PATIENCE = 240.0 * graph.SLOWDOWN  # for a calibration [s]
# Of the camera's optical frame on the flange, as urdf/puma560.urdf has it: 6 cm ahead, 4.5 cm aside, "down" is x.
PLACE = numpy.array([-0.045, 0.0, 0.06])
ROTATION = numpy.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

# The Python side of tf2_msgs is not needed for anything else, and need not be installed.
TFMessage = genpy.dynamic.generate_dynamic(
    "tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n%s\nMSG: geometry_msgs/TransformStamped\n%s" %
    ("=" * 80, geometry_msgs.msg.TransformStamped._full_text))["tf2_msgs/TFMessage"]

# Of the camera in the world [m], and its turn about its own axis [degrees]. It looks at the box's face, at x = 0.96.
POSES = [(0.50, 0.00, 0.74, 0), (0.44, 0.12, 0.80, 15), (0.42, -0.13, 0.82, -20), (0.54, 0.10, 0.66, 30),
         (0.47, -0.12, 0.66, -30), (0.40, 0.02, 0.86, 5), (0.55, -0.06, 0.80, 25), (0.46, 0.14, 0.72, -15),
         (0.40, -0.04, 0.70, 35), (0.52, 0.06, 0.82, -35), (0.44, -0.15, 0.74, 10), (0.56, 0.03, 0.70, -8),
         (0.41, 0.10, 0.68, 20), (0.49, -0.10, 0.84, -10), (0.53, -0.12, 0.70, 18), (0.43, 0.00, 0.78, -28)]


def degrees_between(a, b):
    return numpy.degrees(numpy.arccos(numpy.clip((numpy.trace(a.T @ b) - 1.0) / 2.0, -1.0, 1.0)))


class HandEye(graph.GraphTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.graph.start("roslaunch", "view_servo", "puma_sim.launch", "world:=rice", "encoder_noise:=0.0001")
        cls.launch = cls.graph.start("roslaunch", "view_servo", "arm_servo.launch", "sim:=false", "dry_run:=true",
                                     "odom_frame:=")
        graph.wait_until("all nodes", lambda: all(
            service in cls.graph.state()[2]
            for service in ("/puma_sim/set_pose", "/homography_tracker/start", "/view_store/save")))
        cls.static = {}
        rospy.Subscriber("/tf_static", TFMessage, cls.take_static)
        status, text = graph.wait_until("the view", lambda: cls.save())
        assert status == 0, text

    @classmethod
    def save(cls):
        outcome = cls.graph.run("rosrun view_servo view save box --overwrite --roi 172 31 296 418")
        return outcome if outcome[0] == 0 else None

    @classmethod
    def take_static(cls, message):
        for one in message.transforms:
            cls.static[one.child_frame_id] = one

    def calibrate(self, words, status, complaint=None):
        """Runs it to its end, which has to come by itself."""
        got, text = self.graph.run("rosrun view_servo calibrate_hand_eye " + words)
        self.assertEqual(got, status, text)
        if complaint:
            lines = text.strip().splitlines()
            self.assertEqual(len(lines), 1, text)
            self.assertRegex(lines[0], "^calibrate_hand_eye: .*" + complaint)
        return text

    def begin(self, words):
        return subprocess.Popen("exec rosrun view_servo calibrate_hand_eye " + words, shell=True,
                                env=self.graph.environment, cwd=self.directory, stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, preexec_fn=graph.end_with_parent, universal_newlines=True)

    def hold(self, pose):
        status, text = self.graph.run("rosservice call /puma_sim/set_pose '%s'" % looking_at_the_box(*pose))
        self.assertEqual(status, 0, text)
        self.assertIn("success: True", text)

    def lead(self, process, poses):
        """Brings the arm to the next pose whenever one has been taken. Returns all that was printed."""
        watchdog = threading.Timer(PATIENCE, process.kill)
        watchdog.start()
        text = ""
        try:
            for line in process.stdout:
                text += line
                if (line.startswith("view ") or re.match(r"pose \d+ of \d+ taken", line)) and poses:
                    self.hold(poses.pop(0))
        finally:
            watchdog.cancel()
        process.wait(20.0)
        return text

    def test_calibrates_and_publishes(self):
        poses = list(POSES)
        recording = self.graph.start("rosbag", "record", "--output-name=arm.bag", "/tf", "/tf_static",
                                     "/homography_tracker/homography", "/camera/camera_info")
        graph.wait_until("the recording", lambda: any(
            node.startswith("/record") for node in self.graph.state()[1].get("/homography_tracker/homography", [])))
        process = self.begin("--view box --flange flange --keep poses.yaml --out mounted.yaml")
        text = self.lead(process, poses)
        self.assertEqual(process.returncode, DONE, text)
        recording.send_signal(signal.SIGINT)
        recording.wait(20.0)
        with open(os.path.join(self.directory, "mounted.yaml")) as file:
            found = yaml.safe_load(file)
        self.assertEqual(found["parameters"], {
            "eye_on_hand": True, "robot_base_frame": "base_link", "robot_effector_frame": "flange",
            "tracking_base_frame": "camera_optical_frame"})
        numbers = found["transformation"]
        place = numpy.array([numbers[name] for name in "xyz"])
        rotation = matrix_of(*(numbers["q" + name] for name in "xyzw"))
        self.assertLess(1e3 * numpy.linalg.norm(place - PLACE), 1.0, text)
        self.assertLess(degrees_between(rotation, ROTATION), 0.15, text)
        sigma = numpy.sqrt(numpy.diag(numpy.array(found["covariance"]).reshape(6, 6)))
        self.assertTrue((sigma > 1e-6).all() and (sigma[:3] < 1e-3).all() and (sigma[3:] < 2e-3).all(), sigma)
        self.assertIn("hand_eye:=mounted.yaml", text)
        self.assertIn("x y z qx qy qz qw = %.6f" % place[0], text)
        self.assertIn("rosrun view_servo publish_hand_eye _file:=/", text)

        self.check_offline(numbers, place, rotation)

        # A file that exists is kept.
        self.calibrate("--view box --flange flange --out mounted.yaml", CANNOT, "exists: say --overwrite")
        self.check_publishing(found, place, rotation)

    def check_offline(self, numbers, place, rotation):
        """Without a master, from the poses that were kept, and from the bag."""
        offline = "ROS_MASTER_URI=http://localhost:1 rosrun view_servo calibrate_hand_eye "
        status, text = self.graph.run(offline + "--file poses.yaml --out again.yaml")
        self.assertEqual(status, DONE, text)
        with open(os.path.join(self.directory, "again.yaml")) as file:
            again = yaml.safe_load(file)
        for name, value in numbers.items():
            self.assertAlmostEqual(again["transformation"][name], value, 6, name)
        status, text = self.graph.run(offline + "--file arm.bag --view box --flange flange --out by_bag.yaml")
        self.assertEqual(status, DONE, text)
        with open(os.path.join(self.directory, "by_bag.yaml")) as file:
            by_bag = yaml.safe_load(file)
        self.assertEqual(by_bag["parameters"], again["parameters"])
        found = by_bag["transformation"]
        self.assertLess(1e3 * numpy.linalg.norm([found[name] for name in "xyz"] - place), 0.5, text)
        self.assertLess(degrees_between(matrix_of(*(found["q" + name] for name in "xyzw")), rotation), 0.1, text)
        # What it may lack.
        for words, complaint in (
                ("--file arm.bag", "--view NAME"),
                ("--file arm.bag --view nothing", "'nothing'"),
                ("--file arm.bag --view box --flange wrist", "its tf does not know 'wrist' in 'base_link'.*--flange"),
                ("--file arm.bag --view box --camera nobody", "no camera_info is in it on '/nobody/camera_info'"),
                ("--file arm.bag --view box --tracker nobody", "no homography of view 'box' is in it on '/nobody/homography'"),
                ("--file poses.yaml --keep nowhere/p.yaml", "--keep: there is no directory 'nowhere': make it first"),
                ("--file poses.yaml --keep poses.yaml", "'poses.yaml' exists: say --overwrite, or another file by --keep"),
                ("--file nowhere.bag --view box", "nowhere.bag.*no such file"),
                ("--file nowhere.yaml", "nowhere.yaml.*no such file"),
                ("--file mounted.yaml", "has not all of parameters, view and poses"),
                ("--file text.bag --view box", "text.bag")):
            with open(os.path.join(self.directory, "text.bag"), "w") as file:
                file.write("no bag")
            self.calibrate(words + " --out bad.yaml", CANNOT, complaint)

    def check_publishing(self, found, place, rotation):
        # tf has the camera on the flange already.
        status, text = self.graph.run("rosrun view_servo publish_hand_eye _file:=$PWD/mounted.yaml")
        self.assertEqual(status, CANNOT, text)
        self.assertIn("tf knows already where 'camera_optical_frame' is on 'flange'", text)

        # A camera whose driver has a frame above the optical one, at (0, 0, 1) in it.
        found["parameters"]["tracking_base_frame"] = "other_optical_frame"
        with open(os.path.join(self.directory, "other.yaml"), "w") as file:
            yaml.safe_dump(found, file)
        below = geometry_msgs.msg.TransformStamped(child_frame_id="other_optical_frame")
        below.header.frame_id = "other_link"
        below.transform.translation.z = -1.0
        below.transform.rotation.w = 1.0
        publisher = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        publisher.publish(TFMessage([below]))
        graph.wait_until("the camera's frames", lambda: "other_optical_frame" in self.static)
        launch = self.graph.start("env", "ROS_NAMESPACE=second", "roslaunch", "view_servo", "arm_servo.launch", "sim:=false",
                                  "matching:=false", "dry_run:=true", "hand_eye:=other.yaml")
        placed = graph.wait_until("the camera on the flange", lambda: self.static.get("other_link"))
        launch.send_signal(signal.SIGINT)
        self.assertEqual(placed.header.frame_id, "flange")
        translation = placed.transform.translation
        numpy.testing.assert_allclose([translation.x, translation.y, translation.z],
                                      place + rotation @ [0.0, 0.0, 1.0], atol=1e-6)

        # A camera whose driver starts later, and has a frame above the optical one, too.
        found["parameters"]["tracking_base_frame"] = "late_optical_frame"
        with open(os.path.join(self.directory, "late.yaml"), "w") as file:
            yaml.safe_dump(found, file)
        self.graph.start("rosrun", "view_servo", "publish_hand_eye", "_file:=" + os.path.join(self.directory, "late.yaml"),
                         "_patience:=0")
        graph.wait_until("the optical frame", lambda: self.static.get("late_optical_frame"))
        below.header.frame_id, below.child_frame_id = "late_link", "late_optical_frame"
        publisher.publish(TFMessage([below]))
        placed = graph.wait_until("the driver's frame on the flange", lambda: self.static.get("late_link"))
        self.assertEqual(placed.header.frame_id, "flange")
        translation = placed.transform.translation
        numpy.testing.assert_allclose([translation.x, translation.y, translation.z],
                                      place + rotation @ [0.0, 0.0, 1.0], atol=1e-6)
        self.assertEqual(self.static["late_optical_frame"].header.frame_id, "late_link")

        # The other way round: a flange that nothing else places, in the frame of a camera.
        found["parameters"].update(tracking_base_frame="third_camera", robot_effector_frame="third_flange")
        with open(os.path.join(self.directory, "third.yaml"), "w") as file:
            yaml.safe_dump(found, file)
        self.graph.start("rosrun", "view_servo", "publish_hand_eye", "_file:=" + os.path.join(self.directory, "third.yaml"),
                         "_inverse:=true")
        placed = graph.wait_until("the flange in the camera's frame", lambda: self.static.get("third_flange"))
        self.assertEqual(placed.header.frame_id, "third_camera")
        translation = placed.transform.translation
        numpy.testing.assert_allclose([translation.x, translation.y, translation.z], -rotation.T @ place, atol=1e-6)

    def test_refuses_too_little_motion(self):
        self.hold(POSES[0])
        process = self.begin("--view box --flange flange --out little.yaml")
        text = ""
        for line in process.stdout:
            text += line
            if line.startswith("pose 1 of 12 taken"):
                break
        process.send_signal(signal.SIGINT)
        text += process.stdout.read()
        process.wait(20.0)
        self.assertEqual(process.returncode, NOT_DONE, text)
        self.assertIn("not calibrated: too little motion: there are 1 different poses: 8 are needed", text)
        self.assertIn("turn it", text)
        self.assertFalse(os.path.exists(os.path.join(self.directory, "little.yaml")))

    def test_refuses_bad_input(self):
        blank = sensor_msgs.msg.CameraInfo(width=640, height=480)
        publisher = rospy.Publisher("/blank/camera_info", sensor_msgs.msg.CameraInfo, queue_size=1, latch=True)
        publisher.publish(blank)
        plain = "--view box --flange flange --out bad.yaml "
        self.calibrate("--flange flange", CANNOT, "--view NAME")
        self.calibrate(plain + "more", CANNOT, "'more' is not understood")
        self.calibrate(plain + "--poses 3", CANNOT, "poses")
        self.calibrate("--view nothing --flange flange --out bad.yaml", CANNOT, "nothing")
        self.calibrate("--view box --flange wrist --out bad.yaml", CANNOT, "'wrist' in 'base_link'.*--flange")
        self.calibrate(plain + "--base nowhere", CANNOT, "'nowhere'.*--base")
        self.calibrate(plain + "--camera nobody", CANNOT, "/nobody/camera_info.*--camera")
        self.calibrate(plain + "--camera blank", CANNOT, "/blank/camera_info.*not calibrated")
        self.calibrate(plain + "--tracker nobody", CANNOT, "'nobody' does not run")
        status, text = self.graph.run("ROS_MASTER_URI=http://localhost:1 rosrun view_servo calibrate_hand_eye " + plain)
        self.assertEqual(status, CANNOT, text)
        self.assertIn("no ROS master answers", text)
        status, text = self.graph.run("rosrun view_servo publish_hand_eye _file:=/nowhere.yaml")
        self.assertEqual(status, CANNOT, text)
        self.assertIn("/nowhere.yaml", text)


if __name__ == "__main__":
    unittest.main(verbosity=2)
