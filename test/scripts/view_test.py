#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""Arguments, names and texts of scripts/view, and its completion in bash, without running nodes."""
import contextlib
import importlib.machinery
import importlib.util
import io
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
COMPLETION = os.path.join(ROOT, "scripts", "completion.bash")
COMMANDS = ["list", "save", "show", "delete", "go", "record", "follow", "stop", "watch"]

sys.dont_write_bytecode = True
loader = importlib.machinery.SourceFileLoader("view", os.path.join(ROOT, "scripts", "view"))
view = importlib.util.module_from_spec(importlib.util.spec_from_loader("view", loader))
loader.exec_module(view)

from sensor_msgs.msg import CameraInfo  # noqa: E402
from view_servo.msg import Heading, ServoStatus  # noqa: E402
from view_servo.srv import GetViewResponse  # noqa: E402


def parse(*words):
    """What the arguments mean, or the status and what is printed when they mean nothing."""
    out, err = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            return view.parse(list(words))
    except SystemExit as end:
        return end.code, out.getvalue() + err.getvalue()


class Arguments(unittest.TestCase):
    def test_good(self):
        options = parse("save", "dock", "--overwrite", "--roi", "1", "2", "30", "40", "--file", "x.png")
        self.assertEqual((options.name, options.overwrite, options.roi, options.file), ("dock", True, [1, 2, 30, 40], "x.png"))
        options = parse("go", "--timeout", "2.5", "dock", "--enable", "--driver", "homing", "--patience", "3")
        self.assertEqual((options.names, options.timeout, options.enable, options.driver, options.patience),
                         (["dock"], 2.5, True, "homing", 3.0))
        options = parse("go", "above", "shelf", "--approach", "0.01", "0.05", "--enable")
        self.assertEqual((options.names, options.approach, options.enable), (["above", "shelf"], [0.01, 0.05], True))
        options = parse("follow", "hall", "--from", "hall_002", "--to", "hall_007", "--reverse", "--timeout", "90")
        self.assertEqual((options.route, options.begin, options.end, options.reverse, options.timeout, options.enable),
                         ("hall", "hall_002", "hall_007", True, 90.0, False))
        self.assertEqual(parse("record", "hall").route, "hall")

    def test_bad(self):
        for words, complaint in (
                ([], "a command is missing"),
                (["fly"], "invalid choice: 'fly'"),
                (["go"], "required: NAME"),
                (["follow"], "required: ROUTE"),
                (["follow", "hall", "lab"], "unrecognized arguments: lab"),
                (["record", "hall", "--enable"], "unrecognized arguments: --enable"),
                (["go", "dock", "--timeout", "0"], "0 is not a time"),
                (["go", "dock", "--timeout", "nan"], "nan is not a time"),
                (["go", "dock", "--timeout", "soon"], "invalid positive value: 'soon'"),
                (["go", "dock", "--driver", "walking"], "invalid choice: 'walking'"),
                (["go", "dock", "--ena"], "unrecognized arguments: --ena"),
                (["go", "above", "shelf", "--approach", "0.01"], "expected 2 arguments"),
                (["go", "above", "shelf", "--approach", "0.01", "0"], "0 is not a tolerance"),
                (["go", "shelf", "--approach", "0.01", "0.05"], "there is one only"),
                (["save", "dock", "--roi", "1", "2", "3"], "expected 4 arguments"),
                (["save", "dock", "--roi", "1", "2", "3", "-4"], "--roi"),
                (["save", "dock", "--roi", "1", "2", "0", "4"], "at least 1 pixel"),
                (["save", "dock", "--roi", "1", "2", "9999999999", "4"], "not a number of pixels"),
                (["list", "--json", "--names"], "not allowed with"),
                (["stop", "now"], "unrecognized arguments: now")):
            with self.subTest(words=words):
                status, text = parse(*words)
                self.assertEqual(status, 2)
                self.assertIn(complaint, text)
                self.assertEqual(text.count("\n"), 1)
                self.assertIn("--help", text)

    def test_help_has_an_example_that_is_right(self):
        for command in COMMANDS:
            with self.subTest(command=command):
                status, text = parse(command, "--help")
                self.assertEqual(status, 0)
                example = re.search(r"^    rosrun view_servo view (.*)$", text, re.MULTILINE).group(1)
                self.assertEqual(parse(*shlex.split(example)).command, command)
        status, text = parse("--help")
        self.assertEqual(status, 0)
        for command in COMMANDS:
            self.assertIn("\n    %s " % command, text)


class Names(unittest.TestCase):
    def resolve(self, name, *words):
        before = sys.argv
        sys.argv = ["view"] + list(words)  # __ns is read there
        try:
            return view.Peers(sys.argv, None).resolve(name)
        finally:
            sys.argv = before

    def setUp(self):
        self.namespace = os.environ.pop("ROS_NAMESPACE", None)

    def tearDown(self):
        os.environ.pop("ROS_NAMESPACE", None)
        if self.namespace is not None:
            os.environ["ROS_NAMESPACE"] = self.namespace

    def test_namespace(self):
        self.assertEqual(self.resolve("view_store/list"), "/view_store/list")
        self.assertEqual(self.resolve("view_store/list", "__ns:=/robot1"), "/robot1/view_store/list")
        os.environ["ROS_NAMESPACE"] = "/robot2"
        self.assertEqual(self.resolve("home"), "/robot2/home")

    def test_remapping(self):
        self.assertEqual(self.resolve("home", "home:=dock/home"), "/dock/home")
        self.assertEqual(self.resolve("view_store/list", "view_store:=/shared/views"), "/shared/views/list")
        self.assertEqual(self.resolve("view_store/list", "view_store:=a", "view_store/list:=b/c", "__ns:=/n"), "/n/b/c")
        self.assertEqual(self.resolve("home", "homing:=other"), "/home")


class Texts(unittest.TestCase):
    def test_age(self):
        for age, text in ((None, "-"), (0.4, "0 s"), (119.0, "119 s"), (121.0, "2 min"), (7300.0, "2 h"), (200000.0, "2 d")):
            self.assertEqual(view.age_text(age), text)
        self.assertEqual(view.age_of(1.7e9, 1.7e9 + 3.0), 3.0)
        self.assertEqual(view.age_of(1.7e9, 1.7e9 - 3.0), 0.0)  # another machine's clock
        self.assertIsNone(view.age_of(0.0, 1.7e9))
        self.assertIsNone(view.age_of(12.0, 1.7e9))

    def test_progress(self):
        nan = math.nan
        status = ServoStatus(state=ServoStatus.SERVOING, reason="on\nits way", translation_error=0.5, rotation_error=math.pi / 180,
                             point_error=3.25)
        self.assertEqual(view.progress_text(status), "servoing; 0.500 m, 1.00 deg, 3.2 px to go: on its way")
        status = ServoStatus(state=ServoStatus.ACQUIRING, translation_error=nan, rotation_error=nan, point_error=nan)
        self.assertEqual(view.progress_text(status), "acquiring")
        heading = Heading(state=Heading.APPROACHING, heading=-math.pi / 2)
        self.assertEqual(view.progress_text(status, heading, "turns"), "acquiring; it lies 90 deg right; turns")
        self.assertEqual(view.progress_text(status, Heading(state=Heading.APPROACHING, heading=nan)), "acquiring")
        self.assertEqual(view.progress_text(status, Heading(state=Heading.DOCKING, heading=1.0)), "acquiring")
        self.assertEqual(view.state_text(200), "state 200")

    def test_states_are_those_of_the_message(self):
        for index, name in enumerate(view.STATES):
            self.assertEqual(getattr(ServoStatus, name.upper()), index)

    def test_lines(self):
        lines = view.Lines(1.0)
        self.assertEqual([lines.is_due(key, now) for key, now in (("a", 0.0), ("a", 0.9), ("b", 0.9), ("b", 1.8), ("b", 2.0))],
                         [True, False, True, False, True])

    def test_view(self):
        answer = GetViewResponse()
        answer.image.width, answer.image.height = 640, 480
        self.assertEqual(view.View("dock", answer).row(1.7e9), ("dock", "-", "640 x 480", "no"))
        self.assertIn("region:     everywhere", view.View("dock", answer).details(1.7e9))
        answer.camera_info = CameraInfo(K=[500.0, 0, 320, 0, 501.0, 240, 0, 0, 1], distortion_model="plumb_bob")
        answer.image.header.stamp.secs = int(1.7e9)
        answer.roi.x_offset, answer.roi.width, answer.roi.height = 10, 20, 30
        answer.has_pose = True
        answer.pose.header.frame_id = "odom"
        known = view.View("dock", answer)
        self.assertEqual(known.row(1.7e9 + 60.0), ("dock", "60 s", "640 x 480", "yes"))
        self.assertEqual(known.as_json(1.7e9)["roi"], [10, 0, 20, 30])
        details = "\n".join(known.details(1.7e9))
        for words in ("plumb_bob, focal lengths 500.0 and 501.0", "x 10, y 0, width 20, height 30", " in odom"):
            self.assertIn(words, details)

    def test_table(self):
        self.assertEqual(view.table([("A", "B"), ("long", "x")]), ["A     B", "long  x"])


class Waiting(unittest.TestCase):
    def test_deadline(self):
        begin = time.monotonic()
        with self.assertRaises(TimeoutError):
            view.within(0.2, lambda: time.sleep(3.0))
        self.assertLess(time.monotonic() - begin, 1.5)
        self.assertEqual(view.within(10.0, lambda: 7), 7)
        with self.assertRaises(KeyError):
            view.within(10.0, lambda: {}["missing"])

    def test_interrupt(self):
        view.interrupts.append(2)
        with self.assertRaises(view.Interrupted):
            view.within(30.0, lambda: time.sleep(3.0))
        self.assertFalse(view.take_interrupt())


class Completion(unittest.TestCase):
    """With a program `view` that knows two views, and a third in another namespace, and somebody else's completion before."""

    @classmethod
    def setUpClass(cls):
        cls.prefix = tempfile.mkdtemp(prefix="view_servo_completion_")
        os.makedirs(os.path.join(cls.prefix, "lib", "view_servo"))
        program = os.path.join(cls.prefix, "lib", "view_servo", "view")
        with open(program, "w") as file:
            file.write("#!/bin/bash\n[[ $1 == list && $2 == --names ]] || exit 2\n"
                       "[[ $* == *__ns:=/robot1* ]] && echo attic || printf '%s\\n' dock shelf\necho noise >&2\n")
        os.chmod(program, 0o755)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.prefix)

    def bash(self, script):
        outcome = subprocess.run(["bash", "--norc", "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=60,
                                 env=dict(os.environ, CMAKE_PREFIX_PATH="/nowhere:" + self.prefix))
        self.assertEqual((outcome.returncode, outcome.stderr.decode()), (0, ""), script)
        return outcome.stdout.decode().split("\n")[:-1]

    def complete(self, *words, before="_other() { COMPREPLY=(other); }; complete -o nospace -F _other rosrun"):
        return self.bash("%s\nsource %s\nCOMP_WORDS=(%s)\nCOMP_CWORD=$((${#COMP_WORDS[@]} - 1))\n_view_servo_rosrun rosrun '' ''\n"
                         "[[ ${#COMPREPLY[@]} == 0 ]] || printf '%%s\\n' \"${COMPREPLY[@]}\"" %
                         (before, shlex.quote(COMPLETION), " ".join(shlex.quote(word) for word in ("rosrun",) + words)))

    def test_commands(self):
        self.assertEqual(self.complete("view_servo", "view", ""), COMMANDS + ["--help"])
        self.assertEqual(self.complete("view_servo", "view", "s"), ["save", "show", "stop"])
        self.assertEqual(self.complete("--prefix", "nice", "--debug", "view_servo", "view", "wa"), ["watch"])

    def test_options_are_those_of_the_program(self):
        for command in COMMANDS:
            known = set(re.findall(r"--[a-z]+", parse(command, "--help")[1].split("    rosrun view_servo")[0]))
            self.assertEqual(set(self.complete("view_servo", "view", command, "-")), known)
        self.assertEqual(self.complete("view_servo", "view", "go", "dock", "--driver", ""),
                         [kind.name for kind in view.DRIVER_KINDS])

    def test_views(self):
        for words in (["go"], ["go", "dock"], ["go", "--approach", "0.01", "0.03", "dock"], ["show"], ["delete"],
                      ["go", "--enable"], ["go", "--timeout", "3"], ["follow", "hall", "--from"], ["follow", "hall", "--to"], ["save", "--overwrite"],
                      ["save", "--overwrite", "--roi", "1", "2", "3", "4"]):
            with self.subTest(words=words):
                self.assertEqual(self.complete("view_servo", "view", *words, ""), ["dock", "shelf"])
        self.assertEqual(self.complete("view_servo", "view", "go", "sh"), ["shelf"])
        self.assertEqual(self.complete("view_servo", "view", "go", "__ns", ":=", "/robot1", ""), ["attic"])
        self.assertEqual(self.complete("view_servo", "view", "follow", "__ns", ":=", "/robot1", "hall", "--to", ""), ["attic"])
        for words in (["save", ""], ["show", "dock", ""], ["list", ""], ["stop", ""], ["go", "--timeout", ""],
                      ["record", ""], ["follow", ""], ["go", "--approach", ""], ["go", "--approach", "0.01", ""],
                      ["save", "--overwrite", "--roi", "1", ""], ["fly", ""]):
            with self.subTest(words=words):
                self.assertEqual(self.complete("view_servo", "view", *words), [])

    def test_files(self):
        start = os.path.join(self.prefix, "li")
        for words in (["save", "x", "--file"], ["show", "x", "--out"]):
            self.assertEqual(self.complete("view_servo", "view", *words, start), [os.path.join(self.prefix, "lib")])

    def test_others_are_left_as_they_were(self):
        for words in (["view_servo", ""], ["view_servo", "view"], ["roscpp", "view", ""], ["view_servo", "homing", "s"], [""]):
            with self.subTest(words=words):
                self.assertEqual(self.complete(*words), ["other"])
        before = "_other() { :; }; complete -o nospace -F _other rosrun"
        again = "%s\nsource %s\nsource %s\ncomplete -p rosrun; echo $_view_servo_before" % (before, COMPLETION, COMPLETION)
        self.assertEqual(self.bash(again), ["complete -o nospace -F _view_servo_rosrun rosrun", "_other"])


if __name__ == "__main__":
    unittest.main()
