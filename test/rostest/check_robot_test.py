#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
check_robot against both simulated robots, where all is well, and against set-ups that are broken in one way each: the line
that is about it has to say so, and no other line may call something an error. What is broken is made of the simulated robots'
messages by a relay in this process.
"""
import collections
import json
import os
import re
import signal
import subprocess
import sys
import threading
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

import genpy.dynamic  # noqa: E402
import geometry_msgs.msg  # noqa: E402
import nav_msgs.msg  # noqa: E402
import numpy  # noqa: E402
import rospy  # noqa: E402
import sensor_msgs.msg  # noqa: E402

SECONDS = "3"      # that check_robot listens
PATIENCE = 120.0 * graph.SLOWDOWN  # for one run [s]
PUBLISH_ODOMETRY = "--publish-odometry"  # an argument of this file
# How busy the machine is does not depend on the robot: these lines may be warnings in any run.
OF_THE_MACHINE = {"processor", "views' disk"}
# Robots that run beside others on a busy machine may be slow.
OF_THE_LOAD = OF_THE_MACHINE | {"images", "image stamps", "odometry", "odometry stamps", "clocks", "camera_info", "joint states"}

Case = collections.namedtuple("Case", "name arguments line level words")


# The Python side of tf2_msgs is not needed for anything else, and need not be installed.
TFMessage = genpy.dynamic.generate_dynamic(
    "tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n%s\nMSG: geometry_msgs/TransformStamped\n%s" %
    ("=" * 80, geometry_msgs.msg.TransformStamped._full_text))["tf2_msgs/TFMessage"]


# ---------------------------------------------------------------------------------------- what is broken in a set-up

def keep(message):
    return message


def blur(image):
    """A Gaussian of 4 pixels."""
    taps = numpy.exp(-0.5 * (numpy.arange(-12, 13) / 4.0) ** 2)
    taps /= taps.sum()
    pixels = numpy.frombuffer(image.data, numpy.uint8).reshape(image.height, image.width).astype(float)
    for axis in (0, 1):
        size = pixels.shape[axis]
        padding = [(12, 12) if axis == k else (0, 0) for k in (0, 1)]
        padded = numpy.pad(pixels, padding, mode="edge")
        pixels = sum(tap * padded.take(range(k, k + size), axis) for k, tap in enumerate(taps))
    image.data = pixels.astype(numpy.uint8).tobytes()
    return image


def darken(image):
    image.data = bytes(len(image.data))
    return image


def of_frame(frame):
    def change(message):
        message.header.frame_id = frame
        return message
    return change


def without_stamp(message):
    message.header.stamp = rospy.Time()
    return message


def uncalibrated(info):
    info.K = [0.0] * 9
    info.P = [0.0] * 12
    return info


def drop(_):
    return None


def late(odometry):
    odometry.header.stamp -= rospy.Duration(3)
    return odometry


def of_child(odometry):
    odometry.child_frame_id = "wheel_centre"
    return odometry


def mirrored(odometry):
    """As with y to the right, and turns to the right positive."""
    odometry.pose.pose.position.y *= -1
    odometry.pose.pose.orientation.z *= -1
    return odometry


def other_joints(joints):
    joints.name = ["other_" + name for name in joints.name]
    return joints


Relayed = collections.namedtuple("Relayed", "image info odom joints")

# By the namespace of the relayed topics. None: not relayed.
BROKEN = {
    "plain": Relayed(None, None, keep, None),
    "body_frame": Relayed(of_frame("camera_link"), of_frame("camera_link"), None, None),
    "hanging": Relayed(of_frame("hanging_optical_frame"), of_frame("hanging_optical_frame"), None, None),
    "lost_frame": Relayed(of_frame("lost_optical_frame"), of_frame("lost_optical_frame"), None, None),
    "old_frame": Relayed(of_frame("old_optical_frame"), of_frame("old_optical_frame"), None, None),
    "nameless": Relayed(of_frame(""), of_frame(""), None, None),
    "blurred": Relayed(blur, keep, None, None),
    "dark": Relayed(darken, keep, None, None),
    "no_stamps": Relayed(without_stamp, without_stamp, None, None),
    "uncalibrated": Relayed(keep, uncalibrated, None, None),
    "no_info": Relayed(keep, drop, None, None),
    "late": Relayed(None, None, late, None),
    "other_child": Relayed(None, None, of_child, None),
    "mirrored": Relayed(None, None, mirrored, None),
    "other_arm": Relayed(None, None, None, other_joints),
}

CASES = [
    Case("body_frame", ["camera:=/body_frame/camera"], "camera mount", "error", "not optical"),
    Case("hanging", ["camera:=/hanging/camera"], "camera mount", "warning", "upside down"),
    Case("lost_frame", ["camera:=/lost_frame/camera"], "tf", "error", "tf does not know the frame 'lost_optical_frame'"),
    Case("old_frame", ["camera:=/old_frame/camera"], "tf", "warning", "old"),
    Case("nameless", ["camera:=/nameless/camera"], "camera frame", "error", "empty frame_id"),
    Case("blurred", ["camera:=/blurred/camera"], "sharpness", "warning", "px wide"),
    Case("dark", ["camera:=/dark/camera"], "picture", "error", "nearly black"),
    Case("no_stamps", ["camera:=/no_stamps/camera"], "image stamps", "error", "no stamp, it is all zero"),
    Case("uncalibrated", ["camera:=/uncalibrated/camera"], "calibration", "error", "the camera is not calibrated"),
    Case("no_info", ["camera:=/no_info/camera"], "camera_info", "error", "no camera_info comes on '/no_info/camera/camera_info'"),
    Case("late", ["odom:=/late/odom"], "clocks", "error", "their clocks are apart"),
    Case("other_child", ["odom:=/other_child/odom"], "odometry frames", "error", "is of 'wheel_centre'"),
    Case("no_images", ["camera:=/nowhere"], "images", "error", "nobody publishes it"),
    Case("no_odometry", ["odom:=/nowhere"], "odometry", "error", "no odometry has come on '/nowhere'"),
    Case("no_listener", ["cmd_vel:=/nobody"], "commands", "error", "nobody listens on '/nobody'"),
    Case("two_sources", ["odom:=/plain/odom"], "odometry frames", "error", "2 nodes publish odometry"),
]


class Relay:
    """Publishes changed copies of a base's and an arm's messages, of the namespaces in use."""

    TYPES = Relayed(sensor_msgs.msg.Image, sensor_msgs.msg.CameraInfo, nav_msgs.msg.Odometry, sensor_msgs.msg.JointState)
    SOURCES = Relayed("/camera/image_raw", "/camera/camera_info", "/odom", "/arm/joint_states")
    TOPICS = Relayed("camera/image_raw", "camera/camera_info", "odom", "joint_states")

    def __init__(self):
        self.publishers = []  # [(kind, change, publisher)]
        for name, changes in BROKEN.items():
            for kind, change in enumerate(changes):
                if change not in (None, drop):
                    self.publishers.append((kind, change, rospy.Publisher("/%s/%s" % (name, self.TOPICS[kind]), self.TYPES[kind],
                                                                          queue_size=5)))
        self.tf = rospy.Publisher("/tf", TFMessage, queue_size=5, latch=True)
        self.static_tf = rospy.Publisher("/tf_static", TFMessage, queue_size=5, latch=True)
        self.subscribers = [None] * len(self.TYPES)
        self.wanted = [False] * len(self.TYPES)
        self.ends = threading.Event()
        self.thread = threading.Thread(target=self.watch)
        self.thread.start()

    def watch(self):
        """Listens to a robot only while somebody listens here: simulated cameras draw when they are listened to."""
        while not self.ends.wait(0.1):
            for kind, source in enumerate(self.SOURCES):
                wanted = any(k == kind and publisher.get_num_connections() > 0 for k, _, publisher in self.publishers)
                if wanted and not self.subscribers[kind]:
                    self.subscribers[kind] = rospy.Subscriber(source, rospy.AnyMsg, self.on_message, kind, queue_size=2)
                elif not wanted and self.subscribers[kind]:
                    self.subscribers[kind].unregister()
                    self.subscribers[kind] = None

    def on_message(self, raw, kind):
        for k, change, publisher in self.publishers:
            if k == kind and publisher.get_num_connections() > 0:
                publisher.publish(change(self.TYPES[kind]().deserialize(raw._buff)))

    def publish_frames(self):
        """tf of frames that are there, but wrong. The camera's own is 1 m above the base's and looks ahead."""
        optical = (-0.5, 0.5, -0.5, 0.5)
        upside_down = (0.5, 0.5, 0.5, 0.5)
        self.static_tf.publish([self.transform("camera_link", (0.0, 0.0, 0.0, 1.0), rospy.Time()),
                                self.transform("hanging_optical_frame", upside_down, rospy.Time())])
        self.tf.publish([self.transform("old_optical_frame", optical, rospy.Time.now() - rospy.Duration(5))])

    @staticmethod
    def transform(child, rotation, stamp):
        transform = geometry_msgs.msg.TransformStamped()
        transform.header.stamp = stamp
        transform.header.frame_id = "base_link"
        transform.child_frame_id = child
        transform.transform.translation.z = 1.0
        transform.transform.rotation = geometry_msgs.msg.Quaternion(*rotation)
        return transform

    def stop(self):
        self.ends.set()
        self.thread.join()


class CheckRobot(graph.GraphTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.relay = None
        try:
            cls.start()
        except BaseException:
            cls.tearDownClass()
            raise

    @classmethod
    def start(cls):
        cls.graph.start("roslaunch", "view_servo", "nomad_sim.launch")
        # In a namespace, with prefixed frames: so check_robot is tried there, too.
        cls.graph.start("env", "ROS_NAMESPACE=arm", "roslaunch", "view_servo", "puma_sim.launch", "frame_prefix:=arm")
        cls.relay = Relay()
        cls.relay.publish_frames()
        for topic in ("/camera/camera_info", "/arm/camera/camera_info", "/odom", "/arm/joint_states"):
            graph.wait_until(topic, lambda: topic in cls.graph.state()[0])

    @classmethod
    def tearDownClass(cls):
        if cls.relay:
            cls.relay.stop()
        super().tearDownClass()

    # ---------------------------------------------------------------------------------------------------------- steps

    def begin(self, name, *arguments, seconds=SECONDS, arm=False):
        environment = dict(self.graph.environment)
        words = ["rosrun", "view_servo", "check_robot", "arm_servo" if arm else "homing", "--seconds", seconds,
                 "--picture", name + ".png", *arguments]
        if arm:
            environment["ROS_NAMESPACE"] = "arm"
            words.append("frame_prefix:=arm")
        process = subprocess.Popen(words, env=environment, cwd=self.directory, stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True,
                                   preexec_fn=graph.end_with_parent)
        self.addCleanup(self.end, process)
        return process

    @staticmethod
    def end(process):
        if process.poll() is None:
            process.kill()
        process.communicate()

    def outcome(self, process):
        """What a run with --json said: [lines by name, exit status]."""
        text, errors = process.communicate(timeout=PATIENCE)
        self.assertTrue(text, errors)
        report = json.loads(text)
        lines = {line["name"]: line for line in report["findings"]}
        self.assertEqual(len(lines), len(report["findings"]), "names are unique")
        worst = max(["ok", "warning", "error"].index(line["level"]) for line in lines.values())
        self.assertEqual(report["status"], worst)
        self.assertEqual(process.returncode, worst, text)
        for line in lines.values():
            self.assertEqual(line["level"] == "ok", not line["remedy"], line)
        return lines

    def assert_well(self, lines, names, tolerated=frozenset()):
        self.assertLessEqual(set(names), set(lines))
        # With few images a turn does not tell how far clocks are apart.
        tolerated = tolerated | (OF_THE_MACHINE if lines["processor"]["level"] == "ok" else OF_THE_LOAD | {"move clocks"})
        for name, line in lines.items():
            if name not in tolerated:
                self.assertEqual(line["level"], "ok", line)

    def skip_when_too_busy(self, lines):
        """Images that come too late are a reason not to move: no fault of check_robot's on a machine without time for them."""
        refused = "there are errors" in lines.get("move", {"message": ""})["message"]
        errors = {name for name, line in lines.items() if line["level"] == "error"} - {"move"}
        if refused and errors <= OF_THE_LOAD and lines["processor"]["level"] != "ok":
            self.skipTest("this machine is too busy for a robot: " + ", ".join(errors))

    def assert_broken(self, lines, case):
        self.assertIn(case.line, lines)
        self.assertEqual(lines[case.line]["level"], case.level, lines[case.line])
        self.assertIn(case.words, lines[case.line]["message"])
        tolerated = set() if lines["processor"]["level"] == "ok" else OF_THE_LOAD
        errors = {name for name, line in lines.items() if line["level"] == "error" and name not in tolerated - {case.line}}
        self.assertEqual(errors, {case.line} if case.level == "error" else set(), lines)

    # ---------------------------------------------------------------------------------------------------------- tests

    def test_1_all_is_well_with_a_base(self):
        lines = self.outcome(self.begin("base", "--json"))
        self.assert_well(lines, ["images", "picture", "sharpness", "camera_info", "calibration", "image stamps", "camera frame",
                                 "tf", "camera mount", "odometry", "odometry frames", "odometry stamps", "clocks",
                                 "odometry at rest", "commands", "time", "views' disk", "processor"])
        self.assertIn("640 x 480, mono8", lines["images"]["message"])
        self.assertIn("/nomad_sim", lines["commands"]["message"])
        with open(os.path.join(self.directory, "base.png"), "rb") as picture:
            self.assertEqual(picture.read(8), b"\x89PNG\r\n\x1a\n")

    def test_1_all_is_well_with_an_arm(self):
        lines = self.outcome(self.begin("arm", "--json", arm=True))
        self.assert_well(lines, ["images", "camera frame", "tf", "joint states", "commands"])
        self.assertIn("arm/camera_optical_frame", lines["tf"]["message"])

    def test_2_lines_for_people(self):
        process = self.begin("people", "cmd_vel:=/nowhere", "sim:=false", "view:=dock", "max_speed:=0.1")
        text, _ = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 2, text)
        self.assertRegex(text, r"(?m)^(ok       |WARNING  )images            \d+\.\d Hz on '/camera/image_raw'")
        self.assertRegex(text, r"(?m)^ERROR    commands          nobody listens on '/nowhere'\n {27}-> start the robot's driver")
        self.assertRegex(text, r"\d+ ok, \d+ warnings?, [1-9] errors?; the camera's picture is in people.png\n$")

    def test_3_broken_bases(self):
        AT_ONCE = 3
        second_source = self.graph.start(sys.executable, os.path.abspath(__file__), PUBLISH_ODOMETRY)
        graph.wait_until("two sources of odometry", lambda: len(self.graph.state()[0].get("/plain/odom", [])) == 2)
        for first in range(0, len(CASES), AT_ONCE):
            runs = [(case, self.begin(case.name, "--json", *case.arguments)) for case in CASES[first:first + AT_ONCE]]
            for case, process in runs:
                with self.subTest(case.name):
                    lines = self.outcome(process)
                    self.assert_broken(lines, case)
        second_source.send_signal(signal.SIGINT)

    def test_3_broken_arms(self):
        cases = [
            Case("other_arm", ["joint_states:=/other_arm/joint_states"], "joint states", "error", "has no joints other_"),
            Case("other_base", ["odom_frame:=nowhere"], "tf", "error", "tf does not know"),
            Case("arm_without_listener", ["cmd_vel:=/nobody"], "commands", "error", "nobody listens on '/nobody'"),
        ]
        runs = [(case, self.begin(case.name, "--json", *case.arguments, arm=True)) for case in cases]
        for case, process in runs:
            with self.subTest(case.name):
                self.assert_broken(self.outcome(process), case)

    def test_4_moves(self):
        # On a busy machine images come seldom: turns have to be long enough to see how they begin and end.
        short = ["--json", "--move", "--yes", "--distance", "0.05", "--angle", "15"]
        arm = self.begin("arm_moves", *short[:-1], "8", arm=True)
        lines = self.outcome(self.begin("base_moves", *short))
        self.skip_when_too_busy(lines)
        self.assert_well(lines, ["move forward", "move back", "move left", "move right", "move turn left", "move turn right",
                                 "move clocks"], OF_THE_LOAD)
        lines = self.outcome(arm)
        self.skip_when_too_busy(lines)
        self.assert_well(lines, ["move right", "move left", "move down", "move up", "move roll", "move roll back"], OF_THE_LOAD)

        lines = self.outcome(self.begin("mirrored", *short, "odom:=/mirrored/odom"))
        self.skip_when_too_busy(lines)
        self.assertEqual(lines["move forward"]["level"], "ok", lines["move forward"])
        for name in ("move left", "move right", "move turn left", "move turn right"):
            self.assertEqual(lines[name]["level"], "error", lines[name])
            self.assertIn("command and images contradict odometry", lines[name]["message"])

    def test_5_does_not_move_unasked_or_against_others(self):
        moves = []
        listener = rospy.Subscriber("/cmd_vel", geometry_msgs.msg.Twist, moves.append)
        self.addCleanup(listener.unregister)
        lines = self.outcome(self.begin("unasked", "--json", "--move", seconds="1"))  # nobody types an answer
        self.assertEqual(lines["move"]["level"], "warning")
        lines = self.outcome(self.begin("blind", "--json", "--move", "--yes", "camera:=/nowhere"))
        self.assertIn("there are errors: images", lines["move"]["message"])
        self.assertEqual(moves, [])
        rival = rospy.Publisher("/cmd_vel", geometry_msgs.msg.Twist, queue_size=1)
        self.addCleanup(rival.unregister)
        lines = self.outcome(self.begin("rival", "--json", "--move", "--yes", seconds="2"))
        self.assertEqual(lines["commands"]["level"], "warning")
        self.skip_when_too_busy(lines)
        self.assertIn("nothing is moved: /check_robot_test publishes on '/cmd_vel'", lines["move"]["message"])
        self.assertEqual(moves, [])

    def test_6_ends_by_a_signal_with_zeros_last(self):
        moves = []
        listener = rospy.Subscriber("/cmd_vel", geometry_msgs.msg.Twist, moves.append)
        self.addCleanup(listener.unregister)
        process = self.begin("interrupted", "--json", "--move", "--yes", seconds="2")
        graph.wait_until("a command", lambda: process.poll() is not None or any(move.linear.x > 0.0 for move in moves))
        if process.poll() is not None:
            lines = self.outcome(process)
            self.skip_when_too_busy(lines)
            self.fail("nothing was moved: %s" % lines)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=10.0)
        self.assertEqual(process.returncode, 130)
        graph.wait_until("a zero at the end", lambda: moves[-1] == geometry_msgs.msg.Twist())
        self.assertTrue(all(abs(move.linear.x) <= 0.0501 for move in moves))
        listening = self.begin("listening", seconds="60")
        graph.wait_until("a listener", lambda: any("check_robot_" in node and node != "/check_robot_test" for node in
                                                   self.graph.state()[1].get("/odom", [])))
        listening.send_signal(signal.SIGINT)
        listening.communicate(timeout=10.0)
        self.assertEqual(listening.returncode, 130)

    def test_7_bad_input(self):
        for launch_file in ("homing", "arm_servo"):  # what may be given to these may be given to this program
            with open(os.path.join(ROOT, "launch", launch_file + ".launch"), encoding="utf-8") as file:
                names = re.findall(r'<arg name="(\w+)" default=', file.read())
            values = {"dry_run": "true", "base": "differential"}
            words = [name + ":=" + values.get(name, "x") for name in names]
            process = self.begin("bad", *words, "further:=x", arm=launch_file == "arm_servo")
            self.assertIn(launch_file + ".launch has no argument 'further'", process.communicate(timeout=PATIENCE)[1])
        for arguments, words in ((["--what"], "--what"), (["odm:=/odom"], "homing.launch has no argument 'odm'"),
                                 (["joint_states:=/j"], "no argument 'joint_states'"), (["--seconds", "0"], "--seconds"),
                                 (["base:=square"], "holonomic or differential"), (["dry_run:=perhaps"], "dry_run"),
                                 (["--distance", "5", "--move"], "--distance")):
            process = self.begin("bad", *arguments)
            text, errors = process.communicate(timeout=PATIENCE)
            self.assertEqual((process.returncode, text), (2, ""))
            self.assertEqual(len(errors.splitlines()), 1, errors)
            self.assertIn(words, errors)
        status, text = self.graph.run("ROS_MASTER_URI=http://localhost:%d rosrun view_servo check_robot" % graph.free_port())
        self.assertEqual(status, 2)
        self.assertIn("no ROS master answers", text)


def publish_odometry():
    """A second source of odometry, a node of its own."""
    rospy.init_node("second_source")
    publisher = rospy.Publisher("/plain/odom", nav_msgs.msg.Odometry, queue_size=5)
    odometry = nav_msgs.msg.Odometry(child_frame_id="base_link")
    odometry.header.frame_id = "odom"
    odometry.pose.pose.orientation.w = 1.0
    rate = rospy.Rate(20)
    while not rospy.is_shutdown():
        odometry.header.stamp = rospy.Time.now()
        publisher.publish(odometry)
        rate.sleep()


if __name__ == "__main__" and PUBLISH_ODOMETRY in sys.argv:
    publish_odometry()
elif __name__ == "__main__":
    unittest.main(verbosity=2, warnings="ignore")  # ROS leaves sockets to the end
