#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""The pages that scripts/report makes of small bags, what it says of what a bag lacks, and what it refuses."""
import base64
import html.parser
import importlib.machinery
import importlib.util
import io
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
REPORT = os.path.join(ROOT, "scripts", "report")

sys.dont_write_bytecode = True
loader = importlib.machinery.SourceFileLoader("report", REPORT)
report = importlib.util.module_from_spec(importlib.util.spec_from_loader("report", loader))
loader.exec_module(report)

import genpy  # noqa: E402
import genpy.dynamic  # noqa: E402
import numpy as np  # noqa: E402
import PIL.Image  # noqa: E402
import rosbag  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import PoseStamped, TwistStamped  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rosgraph_msgs.msg import Log  # noqa: E402
from sensor_msgs.msg import CompressedImage, Image  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from view_servo.msg import (FollowRouteActionFeedback, FollowRouteActionResult, Heading, HomeToViewActionResult,  # noqa: E402
                            Homography, PointMatch, PointMatches, ServoError, ServoStatus)

BEGIN = 1700000000.0
DURATION = 4.0
EVIL = "<script>alert('x')</script> & \"so\" on"
# That package's Python messages need not be installed.
CONFIG = genpy.dynamic.generate_dynamic("dynamic_reconfigure/Config", """BoolParameter[] bools
IntParameter[] ints
StrParameter[] strs
DoubleParameter[] doubles
GroupState[] groups
""" + "".join(f"{80 * '='}\nMSG: dynamic_reconfigure/{name}\n{fields}\n" for name, fields in (
    ("BoolParameter", "string name\nbool value"), ("IntParameter", "string name\nint32 value"),
    ("StrParameter", "string name\nstring value"), ("DoubleParameter", "string name\nfloat64 value"),
    ("GroupState", "string name\nbool state\nint32 id\nint32 parent"))))
Config, DoubleParameter = CONFIG["dynamic_reconfigure/Config"], CONFIG["dynamic_reconfigure/DoubleParameter"]
VOID = {"meta", "link", "br", "img", "path", "circle", "polygon", "image", "use", "rect", "line"}


class Page(html.parser.HTMLParser):
    """Text of the elements with an id, tags with their attributes, and whether elements are closed in order."""

    def __init__(self, content):
        super().__init__()
        self.tags, self.texts, self.open, self.wrong = [], {}, [], []
        self.feed(content)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append((tag, dict(attributes).get("id")))

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        if tag in VOID:
            return
        if not self.open or self.open[-1][0] != tag:
            self.wrong.append(tag)
        else:
            self.open.pop()

    def handle_data(self, data):
        for _, name in self.open:
            if name:
                self.texts[name] = self.texts.get(name, "") + data

    def rows(self, content, section):
        part = content[content.index(f'<section id="{section}">'):]
        part = part[:part.index("</section>")]
        return [[report.html.unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row)]
                for row in re.findall(r"<tr>(.*?)</tr>", part, re.DOTALL) if "<td" in row]


def stamped(message, t):
    message.header.stamp = genpy.Time.from_sec(BEGIN + t)
    return message


def picture(width=64, height=48):
    return np.arange(width * height, dtype=np.uint32).reshape(height, width).astype(np.uint8)


def image(t, encoding="mono8"):
    pixels = picture()
    return stamped(Image(width=64, height=48, step=64, encoding=encoding, data=pixels.tobytes()), t)


def status(t, state, reason, distance=math.nan):
    return stamped(ServoStatus(state=state, reason=reason, translation_error=distance, rotation_error=0.5 * distance,
                               point_error=math.nan, inliers=41), t)


def homing_messages(reason="the views agree", success=True):
    """(topic, message, time) of a run of 4 s along 1 m, which ends 2 mm from where the view was stored at its beginning."""
    found = [("/status", status(0.0, ServoStatus.ACQUIRING, "looking for the view"), 0.0)]
    for i in range(41):
        t = 0.1 * i
        left = 1.0 - 0.024 * i
        found.append(("/heading", stamped(Heading(heading=0.1, yaw_error=0.01, histogram=[0, 1, 5, 1, 0], roi_min=-0.5,
                                                  roi_max=0.5, similarity=0.02 * i, state=1), t), t))
        found.append(("/status", status(t + 0.05, ServoStatus.SERVOING, "drives", left), t + 0.05))
        command = TwistStamped()
        command.twist.linear.x, command.twist.angular.z = 0.2, -0.1
        found.append(("/cmd_vel_stamped", stamped(command, t), t))
        pose = PoseStamped()
        pose.pose.position.x = 0.0 if i == 0 else 0.002 + left
        pose.pose.orientation.w = 1.0
        found.append(("/ground_truth", stamped(pose, t), t))
    pose = PoseStamped()
    pose.pose.position.x, pose.pose.orientation.w = 0.002, 1.0
    found.append(("/ground_truth", stamped(pose, DURATION + 0.3), DURATION + 0.3))
    state = ServoStatus.CONVERGED if success else ServoStatus.ABORTED
    found.append(("/status", status(DURATION + 0.1, state, reason, 0.0123), DURATION + 0.1))
    result = stamped(HomeToViewActionResult(), DURATION + 0.1)
    result.result.success, result.result.message = success, reason
    result.result.duration, result.result.travelled = 3.9, 0.75
    return found + [("/home/result", result, DURATION + 0.1)]


def more_messages():
    """Pictures, matches, diagnostics, log, limits and facts of that run."""
    matches = stamped(PointMatches(view="dock", matches=[
        PointMatch(10 + i, 12, 14 + i, 13, 1.0, i % 4 != 0) for i in range(16)]), 3.9)
    found = [("/camera/image_raw", image(t), t) for t in (1.0, 3.9, 4.2)]
    found += [("/point_matcher/point_matches", matches, 4.0), ("/run_view", image(0.0), 0.5)]
    for i in range(12):
        level = DiagnosticStatus.WARN if 2 <= i <= 5 else DiagnosticStatus.ERROR if i == 9 else DiagnosticStatus.OK
        array = stamped(DiagnosticArray(status=[DiagnosticStatus(level=level, name="homing: camera", message=f"level {level} {EVIL}"),
                                                DiagnosticStatus(level=0, name="other", message="well")]), 0.3 * i)
        found.append(("/diagnostics", array, 0.3 * i))
    found += [("/rosout", stamped(Log(level=Log.WARN, name="/homing", msg=f"beware {EVIL}"), t), t) for t in (1.0, 2.0, 2.5)]
    found.append(("/rosout", stamped(Log(level=Log.INFO, name="/homing", msg="never mind"), 1.0), 1.0))
    for t, speed in ((0.0, 0.25), (2.0, 0.125)):
        found.append(("/homing/parameter_updates", Config(doubles=[DoubleParameter("max_speed", speed),
                                                                   DoubleParameter("max_turn_rate", 0.4)]), t))
    facts = {"driver": "homing", "parameters": {"/homing": {"gain": 1.5, "nested": {"name": EVIL}}},
             "versions": {"view_servo": "0.1.0"}, "view": {"name": "dock", "stamp": BEGIN, "roi": [0, 0, 0, 0]}}
    return found + [("/run_facts", String(data=json.dumps(facts)), 0.5)]


class Report(unittest.TestCase):
    def setUp(self):
        self.directory = tempfile.mkdtemp(prefix="view_servo_report_")
        self.addCleanup(shutil.rmtree, self.directory)
        self.bag = os.path.join(self.directory, "run.bag")
        self.output = os.path.join(self.directory, "run.html")

    def write(self, messages):
        with rosbag.Bag(self.bag, "w") as bag:
            for topic, message, t in sorted(messages, key=lambda each: each[2]):
                bag.write(topic, message, genpy.Time.from_sec(BEGIN + t))

    def call(self, *arguments):
        """Exit status and what is printed, of the program in this process, where nothing need be imported again."""
        out, err = io.StringIO(), io.StringIO()
        argv, sys.argv = sys.argv, ["report", *arguments]
        streams, (sys.stdout, sys.stderr) = (sys.stdout, sys.stderr), (out, err)
        try:
            report.main()
            code = 0
        except SystemExit as end:
            code = end.code
        finally:
            sys.argv = argv
            sys.stdout, sys.stderr = streams
        return code, out.getvalue(), err.getvalue()

    def page(self, messages, *arguments):
        """(first line on standard output, the page's text, the page read)."""
        self.write(messages)
        code, out, err = self.call(self.bag, "-o", self.output, "--views", self.directory, *arguments)
        self.assertEqual((code, err), (0, ""))
        with open(self.output, encoding="utf-8") as file:
            content = file.read()
        page = Page(content)
        self.assertEqual((page.open, page.wrong), ([], []))
        self.assertNotIn("script", {tag for tag, _ in page.tags})
        for tag, attributes in page.tags:
            for name in ("src", "href", "xlink:href"):
                self.assertRegex(attributes.get(name) or "#", "^(#|data:)", (tag, attributes))
        return out, content, page

    def test_whole_run(self):
        out, content, page = self.page(homing_messages() + more_messages())
        self.assertEqual(out, f"arrived (the views agree): the page is {self.output}\n")
        self.assertEqual(page.texts["verdict"].strip(), "arrived the views agree")
        self.assertEqual(dict(page.rows(content, "numbers")), {
            "view": "dock", "duration of the goal": "3.9 s", "left to go in the end, estimated": "12.3 mm",
            "turn left in the end, estimated": "0.35°", "true distance from where the view was stored": "2.0 mm",
            "travelled, by odometry": "750.0 mm", "matches or points that agree, last": "41",
            "highest speed commanded": "0.2 m/s, limit 0.125 m/s", "highest turn rate commanded": "5.73 °/s, limit 22.9 °/s"})
        self.assertNotIn("missing", {attributes.get("class") for _, attributes in page.tags})
        statuses = page.rows(content, "statuses")
        self.assertEqual([(row[0], row[1], row[2], row[3], row[6]) for row in statuses], [
            ("0.00", "0.00", "acquiring", "looking for the view", "1"), ("0.05", "4.05", "servoing", "drives", "41"),
            ("4.10", "4.10", "converged", "the views agree", "1")])
        self.assertEqual(page.rows(content, "diagnostics"), [
            ["0.60", "1.50", "4", "WARN", "homing: camera", f"level 1 {EVIL}"],
            ["2.70", "2.70", "1", "ERROR", "homing: camera", f"level 2 {EVIL}"]])
        self.assertEqual(page.rows(content, "log"), [["1.00", "2.50", "3", "WARN", "/homing", f"beware {EVIL}"]])
        self.assertIn("max_speed 0.25", page.texts["parameters"])
        self.assertIn("Changed at 2.00 s: max_speed 0.125.", page.texts["parameters"])
        self.assertIn(EVIL, page.texts["parameters"])
        self.assertIn("0.1.0", page.texts["versions"])
        self.assertIn("12 of 16 matches of points agree", page.texts["pictures"])
        self.assertIn("last image that has matches, 0.30 s before the last of all, at 3.90 s", page.texts["pictures"])
        circles = [attributes["class"] for tag, attributes in page.tags if tag == "circle"]
        self.assertEqual((circles.count("agrees"), circles.count("differs")), (24, 8))
        pictures = [attributes["href"] for tag, attributes in page.tags if tag == "image" and "jpeg" in attributes["href"]]
        self.assertEqual(len(pictures), 2)
        read = np.asarray(PIL.Image.open(io.BytesIO(base64.b64decode(pictures[0].split(",")[1]))), dtype=float)
        self.assertLess(np.abs(read[:, 8:-8] - picture()[:, 8:-8]).mean(), 4.0)
        plots = [attributes for tag, attributes in page.tags if tag == "svg" and attributes.get("class") == "plot"]
        self.assertEqual([plot["aria-label"].split(" ")[0] for plot in plots], ["path", "similarity,", "votes"])
        identities = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
        self.assertEqual(len(identities), len(set(identities)))
        self.assertEqual(content.count("prefers-color-scheme: dark"), 2)

    def test_failed_run_and_escapes(self):
        out, content, page = self.page([each for each in homing_messages(EVIL, False) if each[0] in ("/status", "/home/result")])
        self.assertTrue(out.startswith("not arrived (<script>"), out)
        self.assertEqual(page.texts["verdict"].strip(), f"not arrived {EVIL}")
        self.assertIn(("div", {"class": "verdict bad", "id": "verdict"}), page.tags)
        self.assertEqual(page.rows(content, "statuses")[-1][2:4], ["aborted", EVIL])
        self.assertNotIn("<script", content)

    def test_numbers_are_those_of_the_last_goal(self):
        result = stamped(HomeToViewActionResult(), 8.0)
        result.result.message, result.result.duration = "gave up", 2.5
        self.write(homing_messages() + [("/status", status(7.0, ServoStatus.ACQUIRING, "looks"), 7.0), ("/home/result", result, 8.0)])
        page = report.recorded_run.read_bag(self.bag, lambda bag: report.read_all(report.OnePass(bag), self.bag, self.directory))
        numbers = dict(report.numbers_of(page))
        self.assertEqual(numbers["left to go in the end, estimated"], "not known")
        self.assertEqual(numbers["duration of the goal"], "2.5 s")
        self.assertEqual(report.verdict_of(page), (("bad", "not arrived"), "gave up"))
        self.assertIn("The bag has 2 goals; the verdict is that of the last.", report.goals_of(page))

    def test_a_goal_that_has_not_ended_is_not_judged_by_the_one_before(self):
        later = [("/status", status(t, ServoStatus.ACQUIRING, "looks"), t) for t in (7.0, 9.0)]
        self.write(homing_messages() + later)
        page = report.recorded_run.read_bag(self.bag, lambda bag: report.read_all(report.OnePass(bag), self.bag, self.directory))
        self.assertNotEqual(report.verdict_of(page)[0], ("good", "arrived"))
        numbers = dict(report.numbers_of(page))
        self.assertNotIn("duration of the goal", numbers)
        self.assertEqual(numbers["left to go in the end, estimated"], "not known")

    def test_what_a_bag_lacks_is_said_in_its_place(self):
        _, content, page = self.page([each for each in homing_messages() if each[0] == "/heading"])
        self.assertEqual(page.texts["verdict"].strip(), "no verdict the bag has no status of a driver")
        for section, words in (("numbers", "the bag has no ground truth"), ("pictures", "the bag has no camera images"),
                               ("pictures", "nothing in the bag names the view"), ("path", "no ground_truth and no odometry"),
                               ("curves", "limits of the commands are not in the bag"), ("statuses", "has no status of a driver"),
                               ("diagnostics", "has no /diagnostics"), ("log", "has no /rosout"),
                               ("parameters", "no parameters of the parameter server"), ("versions", "has no versions")):
            self.assertIn(words, page.texts[section], section)
        self.assertNotIn("travelled", content[:content.index('<section id="pictures">')])

        _, _, page = self.page([("/status", status(0.0, ServoStatus.ACQUIRING, "looking"), 0.0)])
        self.assertEqual(page.texts["verdict"].strip(), "not ended the bag ends while the driver is acquiring: looking")
        self.assertIn("there is no path", page.texts["path"])
        self.assertIn("there are no curves", page.texts["curves"])

        broken = image(3.9)
        broken.data = broken.data[:100]
        _, _, page = self.page([("/status", status(0.0, ServoStatus.ACQUIRING, "looking"), 0.0),
                                ("/camera/image_raw", broken, 3.9), ("/run_view", image(0.0, "odd"), 0.1)])
        self.assertIn("fewer bytes than its size needs", page.texts["pictures"])
        self.assertIn("encoding 'odd'", page.texts["pictures"])

    def test_odometry_and_images_of_other_names_are_found_and_overlays_are_no_camera(self):
        names = {"/camera/image_raw": "/left/mono"}
        messages = [(names.get(topic, topic), message, t) for topic, message, t in homing_messages() + more_messages()
                    if topic != "/ground_truth"]
        for i in range(41):
            odometry = stamped(Odometry(), 0.1 * i)
            odometry.pose.pose.position.x, odometry.pose.pose.orientation.w = 0.024 * i, 1.0
            messages += [("/odometry/filtered", odometry, 0.1 * i), ("/point_matcher/overlay", image(0.1 * i), 0.1 * i)]
        _, _, page = self.page(messages)
        self.assertIn("by odometry", page.texts["path"])
        self.assertNotIn("there is no path", page.texts["path"])
        self.assertIn("12 of 16 matches of points agree", page.texts["pictures"])
        self.assertIn("last image that has matches, 0.30 s before the last of all, at 3.90 s", page.texts["pictures"])

    def test_route(self):
        messages = [each for each in homing_messages() + more_messages() if each[0] != "/home/result"]
        for i in range(40):
            feedback = stamped(FollowRouteActionFeedback(), 0.1 * i)
            feedback.feedback.view = f"hall_{1 + i // 10:03d}"
            feedback.feedback.share, feedback.feedback.yaw = 0.8, 0.01
            feedback.feedback.sideways = math.nan if i < 5 else -0.001 * i
            messages.append(("/follow/feedback", feedback, 0.1 * i))
        result = stamped(FollowRouteActionResult(), DURATION + 0.1)
        result.result.message, result.result.duration, result.result.travelled = "view 'hall_004', 4 of 5: lost", 3.9, 1.25
        _, content, page = self.page(messages + [("/follow/result", result, DURATION + 0.1)])
        self.assertEqual(page.texts["verdict"].strip(), "not arrived view 'hall_004', 4 of 5: lost")
        numbers = dict(page.rows(content, "numbers"))
        self.assertEqual(numbers["views of the route that it drove to"], "4, from hall_001 to hall_004")
        self.assertEqual(numbers["farthest beside the recorded way, by its views"], "39.0 mm")
        self.assertEqual(numbers["travelled, by odometry"], "1.25 m")
        plots = [attributes for tag, attributes in page.tags if tag == "svg" and attributes.get("class") == "plot"]
        self.assertEqual([plot["aria-label"].split(" ")[0] for plot in plots], ["path", "similarity,", "place"])
        self.assertIn("hall_002", page.texts["path"])

    def test_arm_with_the_view_from_the_directory(self):
        PIL.Image.fromarray(picture()).save(os.path.join(self.directory, "shelf.00.png"))
        with open(os.path.join(self.directory, "shelf.yaml"), "w") as file:
            file.write("format: 1\nimage: shelf.00.png\nregion: [10, 10, 20, 20]  # x, y, width, height\n")
        shifted = [1.0, 0.0, 5.0, 0.0, 1.0, 3.0, 0.0, 0.0, 1.0]
        buffer = io.BytesIO()
        PIL.Image.fromarray(picture()).save(buffer, "PNG")
        messages = [("/status", status(0.0, ServoStatus.SERVOING, "drives to the view"), 0.0),
                    ("/camera/image_raw/compressed", stamped(CompressedImage(format="png", data=buffer.getvalue()), 2.0), 2.0)]
        for i in range(21):
            error = stamped(ServoError(view="shelf", point_x=30 - i, point_y=20, wanted_x=10, wanted_y=20, log_depth=0.1,
                                       gain_x=1, gain_y=1, translation_error=0.2 - 0.009 * i, rotation_error=0.1), 0.1 * i)
            error.twist.linear.x = 0.1
            messages += [("/servo_error", error, 0.1 * i), ("/homography_tracker/homography", stamped(
                Homography(view="shelf", valid=True, h=shifted, matches=30, inliers=25), 0.1 * i), 0.1 * i)]
        _, content, page = self.page(messages)
        self.assertIn(f"from {self.directory}, as the bag does not have it", page.texts["pictures"])
        numbers = dict(page.rows(content, "numbers"))
        self.assertEqual((numbers["view"], numbers["left to go in the end, estimated"]), ("shelf", "20.0 mm"))
        self.assertEqual(numbers["highest speed commanded"], "0.1 m/s, limit not in the bag")
        outlines = [[tuple(map(float, corner.split(","))) for corner in attributes["points"].split()]
                    for tag, attributes in page.tags if tag == "polygon"]
        self.assertEqual(len(outlines), 2)
        offset = 64 + 0.02 * 48  # of the right picture
        for before, after in zip(*outlines):
            self.assertAlmostEqual(after[0] - before[0], offset + 5.0, delta=0.11)
            self.assertAlmostEqual(after[1] - before[1], 3.0, delta=0.11)

    def refused(self, words, bag=None):
        code, out, err = self.call(bag or self.bag, "-o", self.output)
        self.assertEqual((code, out, err.count("\n")), (2, "", 1), err)
        self.assertIn(words, err)
        self.assertFalse(os.path.exists(self.output))

    def test_refuses_what_is_no_run(self):
        self.refused("No such file")
        with open(self.bag, "w") as file:
            file.write("no bag at all\n")
        self.refused("not a bag that can be read")
        self.write([("/rosout", Log(msg="alone"), 0.0)])
        self.refused("it has no messages of view_servo; record a run")
        self.write(homing_messages())
        with open(self.bag, "rb") as file:
            whole = file.read()
        with open(self.bag, "wb") as file:
            file.write(whole[:len(whole) // 2])
        self.refused("index")
        with rosbag.Bag(self.bag, "w") as bag:
            bag.write("/heading", stamped(Heading(), 0.0), genpy.Time.from_sec(BEGIN))
            bag.flush()
            shutil.copy(self.bag, self.bag + ".open")
        self.refused("index", self.bag + ".open")

    def test_as_a_program(self):
        self.write(homing_messages())
        absent = os.path.join(self.directory, "absent", "run.html")
        result = subprocess.run([sys.executable, REPORT, self.bag, "-o", absent], stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, universal_newlines=True)
        self.assertEqual((result.returncode, result.stdout), (2, ""), result.stderr)
        self.assertEqual(result.stderr, f"{absent}: No such file or directory; name another file by -o\n")


if __name__ == "__main__":
    unittest.main()
