# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""How each form of command that the documents have is tried: it is run, or as much of it as harms nothing."""
import functools
import glob
import os
import re
import shlex
import signal
import subprocess
import unittest

import genpy
import roslaunch.arg_dump
import roslaunch.config
import roslaunch.xmlloader
import roslib.message
import roslib.packages
import rospkg
import yaml

import documents
import graph

ROOT = documents.ROOT
PACKAGE = "view_servo"
PATIENCE = 120.0  # for one command [s]

# Commands that are not run, and why not.
NOT_RUN = {
    "scripts/demo": "it is this test's big brother, and takes minutes",
    "scripts/demo arm": "likewise",
    "scripts/demo match": "likewise",
    "scripts/demo route": "likewise",
    "scripts/test": "it runs this test",
    "scripts/install_dependencies": "it may change the machine",
    "scripts/build": "it has been run, else there would be nothing to test",
    "catkin_make": "it needs a workspace, and builds everything anew",
    "catkin build": "likewise",
}


class TriedCommands(unittest.TestCase):
    """
    What a test of commands derives from. The test has the running nodes in `graphs`, a base first and then an arm, and in
    `ran` what came of commands that were run.
    """

    ARM_VIEWS = {"above", "shelf"}  # which the documents give to an arm; other views are a base's

    # ------------------------------------------------------------------------------------------------ of the package

    @staticmethod
    @functools.lru_cache(maxsize=None)
    def launch_arguments(file):
        return roslaunch.arg_dump.get_args([os.path.join(ROOT, "launch", file)])

    @staticmethod
    @functools.lru_cache(maxsize=None)
    def programs():
        """Programs for users, which rosrun finds. Benchmarks are built beside them, but take minutes."""
        found = subprocess.run(["catkin_find", "--without-underlays", "--libexec", PACKAGE], stdout=subprocess.PIPE,
                               check=True).stdout.decode().split("\n")
        return {name for folder in found if folder for name in os.listdir(folder) if not name.startswith("bench_")}

    def run_here(self, command, expected=0):
        """Runs a command beside the files that were made, once."""
        if command not in self.ran:
            self.ran[command] = self.graphs[0].run(command, PATIENCE)
        status, text = self.ran[command]
        self.assertEqual(status, expected, "%s\n%s" % (command, text))
        return text

    # ---------------------------------------------------------------------------------------------- kinds of commands

    def try_command(self, text):
        text = text.replace("/tmp/", self.graphs[0].directory + "/")
        if text.startswith("("):  # a shell of its own
            self.assertTrue(text.endswith(")"))
            text = text[1:-1]
        for part in text.split(" && "):
            words = shlex.split(part)
            while words and re.match(r"[A-Z_]+=", words[0]):
                words.pop(0)
            if words[0].endswith(".launch"):
                words[:0] = ["roslaunch", PACKAGE]
            elif words[0] in self.programs() | {"plot_run", "plot_experiment", "report"} and len(words) > 1:
                words[:0] = ["rosrun", PACKAGE]
            self.kind_of(words)(words)

    def kind_of(self, words):
        kinds = {"roslaunch": self.try_roslaunch, "rosrun": self.try_rosrun, "rosservice": self.try_rosservice,
                 "rostopic": self.try_rostopic, "source": self.try_source, "cd": self.try_cd, "ctest": self.try_ctest}
        if words[0] in kinds:
            return kinds[words[0]]
        if words[0].startswith("scripts/"):
            return self.try_script
        if words[0].startswith("devel/lib/"):
            return self.try_binary
        if words[0].startswith("bench_"):
            return self.try_binary
        if " ".join(words) in NOT_RUN:
            return lambda _: None
        raise AssertionError("nothing is known of this form of command")

    def try_source(self, words):
        self.assertEqual(words[1:], ["devel/setup.bash"])
        spaces = os.environ["CMAKE_PREFIX_PATH"].split(":")
        self.assertTrue(os.path.exists(os.path.join(spaces[0], "setup.bash")), spaces)

    def try_cd(self, words):
        self.assertEqual(words[1:], ["build"])

    def try_ctest(self, words):
        self.assertEqual(words[1], "-L")
        lists = re.findall(r"LABELS((?: \w+)+)", self.read("test", "CMakeLists.txt"))
        self.assertIn(words[2], {label for text in lists for label in text.split()})

    @staticmethod
    def read(*path):
        with open(os.path.join(ROOT, *path)) as file:
            return file.read()

    def try_script(self, words):
        script = os.path.join(ROOT, words[0])
        self.assertTrue(os.access(script, os.X_OK), script)
        if words[0] == "scripts/demo":
            known = self.run_here("%s there_is_no_such_one" % script, expected=2)
            self.assertTrue(set(words[1:]) <= set(re.findall(r"\w+", known.split("there are:")[1])), known)
        elif words[0] == "scripts/install_dependencies":
            known = self.run_here("%s there_is_no_such_one" % script, expected=2)
            self.assertTrue(set(words[1:]) <= set(re.findall(r"\w+", known.split("known:")[1])), known)
        elif words[0] == "scripts/build":
            targets = [word for word in words[1:] if not word.startswith("-D")]
            text = self.read("src", "CMakeLists.txt") + self.read("bench", "CMakeLists.txt")
            for target in targets:
                self.assertTrue(target == "tests" or "add_custom_target(%s)" % target in text, target)
        elif words[:2] == ["scripts/test", "--sanitize"]:
            # To run it would take longer than all other tests: the sanitizer is one that its help names, and the tests exist.
            self.assertIn(" ".join(words[:3]) + " ", self.run_here("%s --help" % script))
            tests = " ".join("_ctest_view_servo_rostest_test_" + os.path.relpath(path, os.path.join(ROOT, "test")).replace("/", "_")
                             for path in glob.glob(os.path.join(ROOT, "test", "rostest", "*.test")))
            for expression in words[3:]:
                self.assertRegex(tests, expression)
        elif words[0] == "scripts/fuzz":
            # It builds everything anew with clang: that it knows the target has to do.
            known = self.run_here(script + " there_is_no_such_one", 2).split("there are:")[1].split()
            rest = words[1:]
            if "--executions" in rest:
                at = rest.index("--executions")
                self.assertTrue(rest[at + 1].isdigit(), words)
                del rest[at:at + 2]
            self.assertTrue(set(rest[:1]) <= set(known), known)
        elif words == ["scripts/test_releases"]:
            # It installs whole releases: that it starts, and knows what it is asked for, has to do.
            self.assertIn("unknown release 'nowhere'", self.run_here(script + " nowhere", 2))
        elif " ".join(words) not in NOT_RUN:
            self.assertEqual(words, ["scripts/check_rooms"])
            self.run_here(script)

    def try_binary(self, words):
        """Benchmarks, which are not built for tests, and tests themselves: the sources have to know what is asked for."""
        name = os.path.basename(words[0])
        if name.startswith("bench_"):
            self.assertIn("vs_bench(%s " % name, self.read("bench", "CMakeLists.txt"))
            text = self.read("bench", name + ".cpp") + self.read("bench", "options.h")
        else:
            self.assertTrue(name.endswith("_test"), name)
            room = name[:-len("_test")]
            self.assertIn("vs_gtest(%s " % room, self.read("test", "CMakeLists.txt"))
            sources = glob.glob(os.path.join(ROOT, "test", room, "*_test.cpp"))
            self.assertTrue(sources, room)
            text = "".join(self.read(source) for source in sources)
        for before, word in zip(words, words[1:]):
            if before.startswith("--") and (word.isdigit() or word == "FILE"):
                continue
            match = re.fullmatch(r"--gtest_filter=\*(\w+)\*", word)
            self.assertTrue(match and match.group(1) in text or '"%s"' % word in text, word)

    def try_roslaunch(self, words):
        if words[1] == "--ros-args":
            self.run_here(" ".join(words))
            words = words[:1] + words[2:]
        self.assertEqual(words[1], PACKAGE)
        arguments = words[3:]
        self.assertTrue(all(":=" in argument for argument in arguments), arguments)
        known = self.launch_arguments(words[2])
        for argument in arguments:
            name, value = argument.split(":=")
            self.assertIn(name, known)
            if name.endswith("config") and value.startswith(self.graphs[0].directory):  # which the reader has written
                with open(value, "w") as file:
                    file.write("{}\n")
        config = roslaunch.config.ROSLaunchConfig()
        loader = roslaunch.xmlloader.XmlLoader()
        loader.load(os.path.join(ROOT, "launch", words[2]), config, argv=arguments, verbose=False)
        self.assertTrue(config.nodes)
        for node in config.nodes:
            if node.package == "rviz" and not self.is_installed("rviz"):
                continue
            found = roslib.packages.find_node(node.package, node.type)
            self.assertTrue(found, node.type)
            if node.package == PACKAGE:  # roslaunch takes the first; others may be left in directories of other builds
                self.assertTrue(found[0].startswith(os.environ["CMAKE_PREFIX_PATH"].split(":")[0]), found)

    @staticmethod
    def is_installed(package):
        return package in rospkg.RosPack().list()

    def try_rosrun(self, words):
        package, program, arguments = words[1], words[2], words[3:]
        if package == "image_view":
            self.assert_topic(arguments[0].split(":=")[1], "sensor_msgs/Image")
            with open(os.path.join(ROOT, "scripts", "install_dependencies")) as file:
                self.assertIn("ros-image-view", file.read())
            self.assertTrue(self.is_installed(package), "rosrun needs its package.xml")
            self.assertTrue(roslib.packages.find_node(package, program))
            return
        if package == "nodelet":  # which test/rostest/nodelets_test.py runs
            self.assertIn("libnodeletlib-tools", self.read("scripts", "install_dependencies"))
            if arguments[0] == "load":
                self.assertIn('<class name="%s"' % arguments[1], self.read("nodelets", "view_servo_nodelets.xml"))
            else:
                self.assertEqual(arguments[0], "manager")
            return
        if program == "static_transform_publisher":  # it does not end, and is of a package that need not be installed
            self.assertEqual((package, len(arguments)), ("tf2_ros", 8))
            self.assertEqual(len([float(number) for number in arguments[:6]]), 6)
            return
        self.assertEqual(package, PACKAGE)
        if program == "publish_hand_eye":  # likewise
            self.assertEqual([argument.split(":=")[0] for argument in arguments], ["_file"])
            return
        if program == "check_robot":
            self.try_check_robot(arguments)
            return
        if program == "view":
            self.try_view(arguments)
            return
        if program == "homography_tracker":  # a node does not end: what it is given has to be there
            for name, _ in (argument.split(":=") for argument in arguments):
                if name.startswith("_"):
                    self.assertIn("\n%s:" % name[1:], self.read("config", program + ".yaml"))
                else:
                    self.assertIn('<remap from="%s"' % name, self.read("launch", "arm_servo.launch"))
            return
        subcommand = [word for word in arguments[:1] if word in ("points", "lines", "scene", "find")]
        if set(arguments) & {"...", "NAME", "DIR", "OUT.bag", "name=value"} or arguments == subcommand or (
                arguments[-1].startswith("-") and len(arguments) > 1):
            options = [word for word in arguments if word.startswith("-")]  # a form: its options have to be there
            text = self.run_here(" ".join(["rosrun", package, program] + subcommand + ["--help"]))
            if not subcommand and program == "match_images":
                text += self.run_here("rosrun view_servo match_images points --help")
            for option in options:
                self.assertIn(option, text)
            return
        if program == "record_bag":
            arguments = arguments + ["--rate", "1"]
        if program in ("plot_run", "report"):
            self.record_run(arguments[0])
        if program == "experiments" and arguments[0] != "--list":
            known = re.findall(r"^(\w+):", self.run_here("rosrun view_servo experiments --list"), re.MULTILINE)
            self.assertIn(arguments[0], known)
            return
        redirected = arguments.index(">") if ">" in arguments else len(arguments)
        self.run_here(" ".join(["rosrun", package, program] + [shlex.quote(argument) for argument in
                                                              arguments[:redirected]] + arguments[redirected:]))

    def try_check_robot(self, arguments):
        """Against the simulated robot of that kind. Nobody types an answer to --move, and a busy machine is a warning."""
        running = self.graphs[1 if "arm_servo" in arguments else 0]
        status, text = running.run(" ".join(["rosrun view_servo check_robot --seconds 2", *arguments]), PATIENCE)
        self.assertIn(status, (0, 1), text)

    def try_view(self, arguments):
        """Against the running nodes; a form, such as one with NAME, has commands and options that --help knows."""
        command = "rosrun view_servo view "
        commands = arguments[0].split("|")
        if commands == ["record"] and arguments != ["record", "ROUTE"]:
            self.try_record(command + " ".join(map(shlex.quote, arguments)))
            return
        # No matcher follows the follower here: test/rostest/routes_test.cpp drives along routes.
        if len(commands) > 1 or {"NAME", "ROUTE", "--help"} & set(arguments) or arguments in (["save"], ["show"], ["go"]) or \
                commands == ["follow"]:
            known = self.run_here(command + "--help")
            for name in commands:
                self.assertIn(("    %s " if name.isalpha() else "%s") % name, known)
            if len(arguments) > 1:
                known = self.run_here(command + commands[0] + " --help")
                for option in arguments[1:]:
                    if option.startswith("-") or option.isupper():
                        self.assertIn(option, known)
            return
        arms = self.ARM_VIEWS & set(arguments)
        if commands[0] == "watch":  # until somebody interrupts it
            command = "timeout --preserve-status --signal=INT 5 " + command
        status, text = self.graphs[1 if arms else 0].run(command + " ".join(map(shlex.quote, arguments)), PATIENCE)
        self.assertEqual(status, 0, text)
        said = {"go": "arrived", "watch": "/homing: ", "stop": "disabled; no goal is left", "list": "dock"}
        self.assertIn(said.get(commands[0], ""), text)

    def try_record(self, command):
        """Until somebody interrupts it, who has driven the base backwards meanwhile, and puts it back where it was."""
        base = self.graphs[0]
        driving = base.start("rostopic", "pub", "-r", "10", "/cmd_vel", "geometry_msgs/Twist", "{linear: {x: -0.2}}")
        try:
            status, text = base.run("timeout --preserve-status --signal=INT 8 " + command, PATIENCE)
        finally:
            driving.terminate()
            driving.wait(PATIENCE)
            base.run("rosservice call /nomad_sim/set_pose '{pose: {orientation: {w: 1.0}}}'", PATIENCE)
        self.assertEqual(status, 0, text)
        self.assertIn("stored route '", text)

    def record_run(self, bag):
        """Records what homing tells during a goal, until that has ended."""
        if os.path.exists(bag):
            return
        base = self.graphs[0]
        base.run("rosservice call /view_store/save '{name: recorded}'", PATIENCE)
        base.run("rosservice call /homing/enable 'data: true'", PATIENCE)
        recording = base.start("rosbag", "record", "--output-name=" + bag, "/heading", "/status", "/odom", "/ground_truth",
                               "/cmd_vel_stamped")
        result = base.start("rostopic", "echo", "-n", "1", "/home/result")
        for node, topic in (("/record", "/heading"), ("/rostopic", "/home/result")):
            graph.wait_until("a listener to " + topic, lambda: any(name.startswith(node) for name in
                                                                   base.state()[1].get(topic, [])))
        base.run("rostopic pub -1 /home/goal view_servo/HomeToViewActionGoal '{goal: {view: recorded}}'", PATIENCE)
        result.wait(PATIENCE)
        recording.send_signal(signal.SIGINT)
        recording.wait(PATIENCE)
        base.run("rosservice call /homing/enable 'data: false'", PATIENCE)

    def graph_with(self, kind, name):
        """The running nodes that have a topic (kind 0 or 1) or a service (2)."""
        for running in self.graphs:
            if name in running.state()[kind]:
                return running
        return None

    def assert_topic(self, name, type_name):
        types = {running.topic_types().get(name) for running in self.graphs}
        self.assertIn(type_name, types, "%s is not a topic of that type" % name)

    def try_rosservice(self, words):
        self.assertEqual(words[1], "call")
        running = self.graph_with(2, words[2])
        self.assertIsNotNone(running, "there is no service %s" % words[2])
        if words[2] == "/route_recorder/stop":  # who records a route drives before
            running.run("timeout --signal=INT 3 rostopic pub -r 20 /cmd_vel geometry_msgs/Twist '{linear: {x: -0.1}}'", PATIENCE)
        command = "rosservice call %s" % " ".join(word if word == "|" else shlex.quote(word) for word in words[2:])
        status, text = running.run(command, PATIENCE)
        self.assertEqual(status, 0, text)
        self.assertIn("success: True", text)

    def try_rostopic(self, words):
        if words[1] == "echo":
            name, field = words[2], []
            while not any(name in running.topic_types() for running in self.graphs):
                self.assertIn("/", name[1:], "there is no topic %s" % words[2])
                name, last = name.rsplit("/", 1)
                field.insert(0, last)
            type_name = next(running.topic_types()[name] for running in self.graphs if name in running.topic_types())
            message = roslib.message.get_message_class(type_name)()
            for part in field:
                message = getattr(message, part)
            return
        self.assertEqual(words[1], "pub")
        values = words[2:]
        while values[0].startswith("-"):
            option = values.pop(0)
            self.assertIn(option, ("-1", "-r"))
            if option == "-r":
                float(values.pop(0))
        topic, type_name, content = values
        subscribers = {node for running in self.graphs for node in running.state()[1].get(topic, [])
                       if running.topic_types().get(topic) == type_name}
        self.assertTrue(subscribers, "nobody subscribes %s as %s" % (topic, type_name))
        genpy.message.fill_message_args(roslib.message.get_message_class(type_name)(), [yaml.safe_load(content)])

    # ------------------------------------------------------------------------------------------- which text is a command

    COMMAND_STARTS = ("roslaunch ", "rosrun ", "rosservice ", "rostopic ", "scripts/", "source ", "catkin_make", "catkin ")

    def is_command(self, text):
        text = re.sub(r"^[A-Z_]+=\S+ ", "", text)
        first = text.split(" ")[0]
        return text.startswith(self.COMMAND_STARTS) or " " in text and (
            first in self.programs() | {"plot_run", "plot_experiment", "report"} or first.startswith("bench_") or
            first.endswith(".launch"))
