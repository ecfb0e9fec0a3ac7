#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""The node record_run beside a driver and a camera that this test plays: what it records, when, and the page it has made."""
import errno
import importlib.machinery
import importlib.util
import json
import os
import resource
import signal
import sys
import threading
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

import numpy  # noqa: E402
import rosbag  # noqa: E402
import rospy  # noqa: E402
from geometry_msgs.msg import TwistStamped  # noqa: E402
from sensor_msgs.msg import Image  # noqa: E402
from view_servo.msg import Heading, PointMatch, PointMatches, ServoStatus, WantedView  # noqa: E402
from view_servo.srv import GetView, GetViewResponse  # noqa: E402

PERIOD = 0.05      # of the camera [s]
IMAGES = 30        # during the goal
PATIENCE = 60.0 * graph.SLOWDOWN  # [s]
PROGRAM = os.path.join(os.environ["CMAKE_PREFIX_PATH"].split(":")[0], "lib", "view_servo", "record_run")


class Robot:
    """Camera, matcher and headings, each PERIOD; and the driver's status and wanted view."""

    def __init__(self):
        def publisher(topic, kind, latch=False):
            return rospy.Publisher(topic, kind, queue_size=100, latch=latch)

        self.image = publisher("camera/image_raw", Image)
        self.matches = publisher("point_matcher/point_matches", PointMatches)
        self.heading = publisher("heading", Heading)
        self.command = publisher("cmd_vel_stamped", TwistStamped)
        self.status = publisher("status", ServoStatus, True)
        self.wanted = publisher("homing/wanted_view", WantedView, True)
        self.store = rospy.Service("view_store/get", GetView, self.get)
        self.pixels = numpy.arange(320 * 240, dtype=numpy.uint32).astype(numpy.uint8)
        self.published = 0
        self.asked = []
        self.ends = threading.Event()
        self.thread = threading.Thread(target=self.run)

    def picture(self, stamp):
        image = Image(width=320, height=240, step=320, encoding="mono8", data=self.pixels.tobytes())
        image.header.stamp = stamp
        return image

    def get(self, request):
        self.asked.append(request.name)
        return GetViewResponse(success=True, image=self.picture(rospy.Time(1, 0)))

    def run(self):
        point = PointMatch(reference_x=5, reference_y=6, current_x=7, current_y=8, inlier=True)
        before = None  # matches come after the next image has
        while not self.ends.wait(PERIOD):
            stamp = rospy.Time.now()
            for topic, message in ((self.image, self.picture(stamp)), (self.heading, Heading(similarity=0.5)),
                                   (self.command, TwistStamped())):
                message.header.stamp = stamp
                topic.publish(message)
            if before is not None:
                matches = PointMatches(view="dock", matches=[point])
                matches.header.stamp = before
                self.matches.publish(matches)
            before = stamp
            self.published += 1

    def say(self, state, reason):
        status = ServoStatus(state=state, reason=reason)
        status.header.stamp = rospy.Time.now()
        self.status.publish(status)


class RecordRun(graph.GraphTest):
    def record(self, **parameters):
        return self.graph.start(PROGRAM, *("_%s:=%s" % each for each in parameters.items()))

    def test_a_goal_of_a_real_robot(self):
        robot = Robot()
        self.addCleanup(robot.store.shutdown)
        self.addCleanup(robot.ends.set)
        rospy.set_param("homing", {"max_speed": 0.25})
        pages, whole = os.path.join(self.directory, "pages"), os.path.join(self.directory, "whole.bag")
        recorder = self.record(driver="homing", bag=whole, report=pages, per_goal="true", image="camera/image_raw", nodes="homing",
                               topics="heading", commands="cmd_vel_stamped", matches="point_matcher/point_matches")
        for topic in (robot.image, robot.matches, robot.heading, robot.status, robot.wanted):
            graph.wait_until("a listener to " + topic.name, topic.get_num_connections, PATIENCE)
        robot.thread.start()
        graph.wait_until("images before the goal", lambda: robot.published >= 10, PATIENCE)
        self.assertFalse(os.path.exists(pages), "nobody has asked for a goal")

        robot.wanted.publish(WantedView(view="dock"))
        robot.say(ServoStatus.ACQUIRING, "looking for the view")
        graph.wait_until("a bag", lambda: os.path.isdir(pages) and os.listdir(pages), PATIENCE)
        self.assertEqual(robot.command.get_num_connections(), 0, "a listener to commands before the driver drives")
        robot.say(ServoStatus.SERVOING, "drives")
        graph.wait_until("a listener to commands", robot.command.get_num_connections, PATIENCE)
        goal = robot.published + IMAGES
        graph.wait_until("images of the goal", lambda: robot.published >= goal, PATIENCE)
        robot.say(ServoStatus.CONVERGED, "the views agree")
        graph.wait_until("a page", lambda: [name for name in os.listdir(pages) if name.endswith(".html")], PATIENCE)
        self.assertEqual(sorted(name.split(".", 1)[1] for name in os.listdir(pages)), ["bag", "html"], os.listdir(pages))
        self.assertEqual(set(robot.asked), {"dock"})
        graph.wait_until("no listener to commands after the goal", lambda: not robot.command.get_num_connections(), PATIENCE)

        bag, page = (os.path.join(pages, name) for name in sorted(os.listdir(pages)))
        with open(page) as file:
            content = file.read()
        self.assertIn('id="verdict"><strong>arrived</strong> the views agree', content)
        self.assertIn("1 of 1 matches of points agree", content)
        self.check_bag(bag)

        recorder.send_signal(signal.SIGINT)
        self.assertEqual(recorder.wait(PATIENCE), 0, self.graph.log())
        self.check_bag(whole)
        self.assertFalse(os.path.exists(whole + ".active"))
        self.assertEqual(len(os.listdir(pages)), 2, "no further page")

    def check_bag(self, path):
        """Every heading; two matches a second, each with its image, and few other images; the view and the facts."""
        with rosbag.Bag(path) as bag:
            stamps = {}
            for topic, message, _ in bag.read_messages():
                if hasattr(message, "header"):
                    stamps.setdefault(topic, []).append(message.header.stamp.to_nsec())
            facts = [json.loads(message.data) for _, message, _ in bag.read_messages(topics=["/run_facts"])]
        images, matches, headings = (stamps[name] for name in ("/camera/image_raw", "/point_matcher/point_matches", "/heading"))
        seconds = (headings[-1] - headings[0]) / 1e9
        self.assertGreaterEqual(len(headings), IMAGES)
        self.assertGreaterEqual(len(stamps["/cmd_vel_stamped"]), IMAGES // 2)
        self.assertLessEqual(len(matches), 2 * seconds + 2)
        self.assertGreaterEqual(len(matches), 2)
        self.assertEqual(set(matches) - set(images), set(), "matches without their image")
        self.assertEqual(len(set(images)), len(images))
        self.assertLessEqual(len(images), 3 * seconds + 4)
        self.assertEqual(set(stamps["/run_view"]), {10**9})
        self.assertEqual(facts[-1]["view"]["name"], "dock")
        self.assertEqual(facts[-1]["parameters"], {"/homing": {"max_speed": 0.25}})

    def test_a_full_disk_ends_one_recording(self):
        sys.dont_write_bytecode = True
        loader = importlib.machinery.SourceFileLoader("record_run", os.path.join(ROOT, "scripts", "record_run"))
        record_run = importlib.util.module_from_spec(importlib.util.spec_from_loader("record_run", loader))
        loader.exec_module(record_run)
        full, good = (os.path.join(self.directory, name) for name in ("full.bag", "good.bag"))
        recordings = [record_run.Recording(path) for path in (full, good)]
        image = Image(width=640, height=480, step=640, encoding="mono8", data=os.urandom(640 * 480))
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000000, limits[1]))  # one may be full before the other is
        try:
            for second in range(1, 11):
                recordings[0].write("image", image, rospy.Time(second))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        for second in range(1, 11):
            recordings[1].write("image", image, rospy.Time(second))
        self.assertEqual(recordings[0].fault.errno, errno.EFBIG)
        with self.assertRaises(OSError) as raised:
            recordings[0].close()
        self.assertEqual((raised.exception.filename, raised.exception.strerror), (full, os.strerror(errno.EFBIG)))
        recordings[1].close()
        with rosbag.Bag(good) as bag:
            self.assertEqual(bag.get_message_count(), 10)

    def test_a_place_that_cannot_be_written(self):
        path = "/proc/nowhere/run.bag"
        status, text = self.graph.run("%s __name:=other _driver:=homing _image:=image _nodes:=homing _topics:=heading _bag:=%s" %
                                      (PROGRAM, path), PATIENCE)
        self.assertEqual(status, 2, text)
        self.assertRegex(text, "record_run: /proc/nowhere.*: .*; name a file or directory that can be written\n$")


if __name__ == "__main__":
    unittest.main()
