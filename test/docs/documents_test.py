#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
Tries what the documents say. Every command in an indented block, or in backticks, is run, or as much of it as harms nothing;
every name in backticks has to be known to running nodes, or to the sources; C++ and CMake are built; links lead to files and
headings; drawings name what the sources have.
A command of a form that is not known, or a name that nothing explains, is a failure: teach tried_commands.py, or this test,
what to do.
"""
import functools
import glob
import os
import re
import shutil
import sys
import tempfile
import time
import unittest

import yaml

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import documents  # noqa: E402
import graph  # noqa: E402
import tried_commands  # noqa: E402

import roslib.message  # noqa: E402

ROOT = documents.ROOT
PACKAGE = tried_commands.PACKAGE
PATIENCE = tried_commands.PATIENCE

# Names that no node and no source explains, and what they are.
KNOWN_NAMES = {
    "x_cur ~ H x_ref": "a formula",
    "tf2_msgs/TFMessage": "a type, the Python side of which need not be installed",
    "dynamic_reconfigure.client": "a module of Python",
    "python3-dynamic-reconfigure": "a package of Debian",
    "src": "of a catkin workspace",
    "$ROS_HOME/view_servo/views": "a directory of the user's",
    "NAME.yaml": "a file of the user's",
    "NAME.REVISION.points": "what was learnt of a view",
    "views.index": "the index beside the views",
    "<depend>view_servo</depend>": "a line of the user's package.xml",
    "camera_calibration": "a package of ROS that need not be installed",
    "clang-format": "a tool",
    "clang-tidy": "a tool",
    "CamelCase": "a style",
    "camelCase": "a style",
    "under_scored": "a style",
    "UPPER_CASE": "a style",
}


class Documented(tried_commands.TriedCommands):
    """Holds what all tests share: running nodes and their files."""

    maxDiff = None

    @classmethod
    def setUpClass(cls):
        cls.directory = tempfile.mkdtemp(prefix="view_servo_documents_")
        cls.documents = [documents.Document(path) for path in documents.documents()]
        cls.graphs = []
        cls.ran = {}
        try:
            cls.start_graphs()
            cls.make_files()
        except BaseException:
            cls.tearDownClass()
            raise

    @classmethod
    def start_graphs(cls):
        wanted = [
            (["nomad_sim.launch", "homing.launch"], ["/nomad_sim/set_pose", "/homing/enable", "/view_store/save",
                                                     "/point_matcher/match", "/line_matcher/match",
                                                     "/scene_matcher/match", "/view_recognizer/recognize",
                                                     "/route_recorder/start", "/route_follower/enable"]),
            (["puma_sim.launch", "arm_servo.launch"], ["/puma_sim/set_pose", "/servo_25d/enable", "/view_store/save",
                                                       "/homography_tracker/start"]),
        ]
        for files, _ in wanted:
            directory = os.path.join(cls.directory, files[0].split("_")[0])
            os.mkdir(directory)
            running = graph.Graph(directory)
            cls.graphs.append(running)
            running.start("roslaunch", PACKAGE, files[0], "world:=" + cls.cheap_world(files[0]))
            running.start("roslaunch", PACKAGE, files[1], "sim:=false")
        # The drivers' launch files leave it out.
        cls.graphs[0].start("rosrun", PACKAGE, "scene_matcher", "image_raw:=camera/image_raw", "camera_info:=camera/camera_info",
                            "wanted_view:=homing/wanted_view")
        for node in ("route_recorder", "route_follower"):
            cls.graphs[0].start("rosrun", PACKAGE, node, "image_raw:=camera/image_raw", "camera_info:=camera/camera_info")
        hand_eye = os.path.join(cls.directory, "mounted.yaml")
        with open(hand_eye, "w") as file:
            yaml.safe_dump({"parameters": {"eye_on_hand": True, "robot_base_frame": "other_base", "robot_effector_frame": "other_flange",
                                           "tracking_base_frame": "other_camera"},
                            "transformation": {"x": 0.0, "y": 0.0, "z": 0.1, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}}, file)
        cls.graphs[0].start("rosrun", PACKAGE, "publish_hand_eye", "_file:=" + hand_eye, "_patience:=0")
        cls.graphs[0].start("rosrun", PACKAGE, "view_recognizer", "image_raw:=camera/image_raw", "camera_info:=camera/camera_info")
        for running, (_, services) in zip(cls.graphs, wanted):
            try:
                for service in services:
                    graph.wait_until(service, lambda: service in running.state()[2])
                graph.wait_until("a camera", lambda: "/camera/image_raw" in running.state()[0])
            except AssertionError as error:
                raise AssertionError("%s\n%s" % (error, running.log()))

    @classmethod
    def cheap_world(cls, launch_file):
        """The simulator's default world with a camera that leaves the processor to what is tried here."""
        name = {"nomad_sim.launch": "desk", "puma_sim.launch": "rice"}[launch_file]
        with open(os.path.join(ROOT, "config", "worlds", name + ".yaml")) as file:
            world = yaml.safe_load(file)
        world["camera"].update(rate=8, supersampling=1)
        path = os.path.join(cls.directory, name + ".yaml")
        with open(path, "w") as file:
            yaml.safe_dump(world, file)
        return path

    @classmethod
    def make_files(cls):
        """Pictures and a bag, under the names that documents give to the user's own."""
        base = cls.graphs[0]
        for name, x in (("goal", 0.0), ("now", -0.15)):
            pose = "{pose: {position: {x: %g}, orientation: {w: 1.0}}}" % x
            for command in ("rosservice call /nomad_sim/set_pose '%s'" % pose,
                            "rostopic echo -n 2 /camera/image_raw/header",  # the second is surely from there
                            "rosservice call /view_store/save '{name: picture_%s}'" % name):
                status, text = base.run(command, PATIENCE)
                assert status == 0 and ("rosservice" not in command or "success: True" in text), text
            picture = glob.glob(os.path.join(base.directory, "view_servo", "views", "picture_%s*.png" % name))[0]
            shutil.copy(picture, os.path.join(base.directory, name + ".png"))
        shutil.copy(os.path.join(base.directory, "goal.png"), os.path.join(base.directory, "graf1.png"))
        shutil.copy(os.path.join(base.directory, "now.png"), os.path.join(base.directory, "graf3.png"))

    @classmethod
    def tearDownClass(cls):
        for running in cls.graphs:
            running.stop()
        shutil.rmtree(cls.directory, ignore_errors=True)

    # -------------------------------------------------------------------------------------------------------- commands

    def test_commands(self):
        count = 0
        for document in self.documents:
            commands = document.commands + [documents.Command(*name) for name in document.names
                                            if self.is_command(name.text)]
            for command in commands:
                with self.subTest(where=command.place, command=command.text):
                    count += 1
                    begin = time.monotonic()
                    outcome = "FAILED"
                    try:
                        self.try_command(command.text)
                        outcome = "passed"
                    finally:
                        print("%s %5.1f s  %s  %s" % (outcome, time.monotonic() - begin, command.place, command.text),
                              flush=True)
        self.assertGreater(count, 30)

    # ----------------------------------------------------------------------------------------------------------- names

    def parameters(self):
        """Names that nodes take, by the sources that read them and by the files in config/."""
        names = set()
        for path in glob.glob(os.path.join(ROOT, "src", "**", "*.*"), recursive=True) + \
                glob.glob(os.path.join(ROOT, "include", "**", "*.h"), recursive=True):
            with open(path) as file:
                names.update(re.findall(r"\b(?:integer|real|natural|boolean|text|path|choice<\w+>)\(\s*\"(\w+)\"", file.read()))
        for path in glob.glob(os.path.join(ROOT, "config", "*.yaml")):
            with open(path) as file:
                for key, value in yaml.safe_load(file).items():
                    names.add(key)
                    names.update(value if isinstance(value, dict) else [])
        for text in self.source_files().values():
            for prefix in re.findall(r"prefixed\(\"(\w+)\"", text):
                names.update([prefix + name for name in names])
        for row in self.document("docs/parameters.md").rows + self.document("docs/parameters_of_drivers.md").rows:
            names.update(re.findall(r"\w+", row.cells[1]))  # values that words stand for
        return names

    def document(self, path):
        return next(document for document in self.documents if document.path == path)

    @staticmethod
    def source_files():
        """Texts of what is compiled, by path."""
        paths = [path for folder in ("include", "src") for path in
                 glob.glob(os.path.join(ROOT, folder, "**", "*.*"), recursive=True)]
        return {path: Documented.read(path) for path in paths}

    @staticmethod
    @functools.lru_cache(maxsize=None)
    def path_ends():
        """How the paths of this package's files and directories end, with and without the files' extensions."""
        ends = set()
        for folder, directories, files in os.walk(ROOT):
            directories[:] = [name for name in directories if name not in (".git", "build", "devel", "install")]
            for name in directories + files:
                parts = os.path.relpath(os.path.join(folder, name), ROOT).split(os.sep)
                for path in ("/".join(parts[first:]) for first in range(len(parts))):
                    ends.update((path, os.path.splitext(path)[0]))
        return ends

    def fields(self):
        """Names of fields of this package's messages, services and actions, and of a twist."""
        names = {"linear", "angular", "x", "y", "z", "x_offset", "y_offset", "width", "height"}
        for path in glob.glob(os.path.join(ROOT, "*", "*.msg")) + glob.glob(os.path.join(ROOT, "*", "*.srv")) + \
                glob.glob(os.path.join(ROOT, "*", "*.action")):
            with open(path) as file:
                names.update(re.findall(r"^\S+\s+(\w+)", file.read(), re.MULTILINE))
        return names

    def type_exists(self, name):
        full = name if "/" in name else PACKAGE + "/" + name
        if os.path.exists(os.path.join(ROOT, "action", full.split("/")[1] + ".action")):
            return True
        for find in (roslib.message.get_message_class, roslib.message.get_service_class):
            try:
                if find(full) is not None:
                    return True
            except (ImportError, ValueError):
                pass
        return False

    def test_names(self):
        parameters, fields, programs = self.parameters(), self.fields(), self.programs()
        arguments = {name for path in glob.glob(os.path.join(ROOT, "launch", "*.launch"))
                     for name in self.launch_arguments(os.path.basename(path))}
        known = set()
        for running in self.graphs:
            publishers, subscribers, services = running.state()
            known.update(publishers, subscribers, services, running.nodes())
        known.update(name[:-len("/goal")] for name in list(known) if name.endswith("/goal"))
        last_parts = {name.split("/")[-1] for name in known}
        sources = "".join(self.source_files().values())
        worlds = tuple(glob.glob(os.path.join(ROOT, "config", "worlds", "*.yaml")))
        for path in worlds + ("CMakeLists.txt", "src/CMakeLists.txt", "test/CMakeLists.txt", "package.xml", "scripts/plot_run", "scripts/record_run",
                              "scripts/recorded_run.py", "scripts/report", "scripts/view",
                              "test/rostest/node_test.h"):
            sources += self.read(path)
        words = set(re.findall(r"\w+", sources.replace("${PROJECT_NAME}", PACKAGE)))

        def is_known(text):
            if text in KNOWN_NAMES or self.is_command(text) or "/" + text.lstrip("/") in known:
                return True
            if text.startswith("~"):
                group, _, name = text[1:].rpartition("/")
                grouped = name in parameters and 'parameters(params.%s), "%s")' % (group, group) in sources
                return text[1:] in parameters | last_parts or grouped or 'parameters(params.%s), "%s")' % (text[1:], text[1:]) in sources
            if ":=" in text:
                return all(part.split(":=")[0] in arguments for part in text.split(" "))
            match = re.match(r"(\w+):( |$)", text)
            if match:
                return match.group(1) in parameters | fields
            match = re.fullmatch(r"#include <view_servo/(\w+)\.h>", text)
            if match:
                return self.type_exists(match.group(1))
            if text.endswith("_test") and "vs_gtest(%s " % text[:-len("_test")] in sources:
                return True
            if os.path.dirname(text) == "build":  # made by the build
                return os.path.basename(text) in sources
            if text.rstrip("/") in self.path_ends():
                return True
            if re.fullmatch(r"\w+/?\w+", text) and self.type_exists(text):
                return True
            if re.fullmatch(r"-?-[\w-]+( [\w=]+)?", text):
                return text.split(" ")[0].lstrip("-") in sources
            parts = text.split(".")
            return text in programs | parameters or all(part in fields for part in parts) or text.replace("()", "") in words

        for document in self.documents:
            for name in document.names:
                with self.subTest(where=name.place, name=name.text):
                    self.assertTrue(is_known(name.text), "nothing explains this name")

    def test_tables_of_nodes(self):
        """Services, actions and topics have the types, and the direction, that the tables say."""
        count = 0
        nodes = set()
        for row in [row for name in ("nodes", "routes", "simulation") for row in self.document("docs/%s.md" % name).rows]:
            if row.head[0] not in ("service", "action, service", "topic"):
                continue
            section = re.fullmatch(r"`(\w+)`", row.section)
            self.assertTrue(section and len(row.cells) == 3, row)
            node = "/" + section.group(1)
            nodes.add(section.group(1))
            running = self.graph_of(node)
            names = [name for name in re.findall(r"`([^`]+)`", row.cells[0])]
            types = [name for name in re.findall(r"`([^`]+)`", row.cells[1])]
            with self.subTest(where=row.place, row=row.cells[0]):
                self.assertIsNotNone(running, "there is no node %s" % node)
                for index, name in enumerate(names):
                    count += 1
                    type_name = types[min(index, len(types) - 1)] if types else None
                    self.assert_offered(running, node, name, type_name, row)
        self.assertGreater(count, 60)
        programs = {os.path.basename(path)[:-len(".cpp")] for path in glob.glob(os.path.join(ROOT, "src", "nodes", "*.cpp"))}
        # main() of them all, their nodelets, and programs that have a robot run once.
        self.assertEqual(nodes, {name for name in programs if not re.match(r"main$|\w*nodelets?$|run_", name)})

    def graph_of(self, node):
        return next((running for running in self.graphs if node in running.nodes()), None)

    def assert_offered(self, running, node, name, type_name, row):
        full_type = type_name if type_name is None or "/" in type_name else PACKAGE + "/" + type_name
        publishers, subscribers, services = running.state()
        if row.head[0] == "service" or row.head[0].startswith("action") and name.startswith("~"):
            self.assertIn(node, services.get(node + "/" + name[1:], []))
            self.assertTrue(self.type_exists(type_name), type_name)
            return
        if row.head[0].startswith("action"):
            self.assertIn(node, subscribers.get("/" + name + "/goal", []))
            self.assertEqual(running.topic_types()["/" + name + "/goal"], full_type + "ActionGoal")
            return
        here = publishers if "(published" in row.cells[0] else subscribers
        if name.startswith("~"):
            found = [node + "/" + name[1:]]
        else:  # launch files give other names to what a node subscribes
            found = [topic for topic in here if topic.endswith("/" + name) and node in here[topic]]
        self.assertTrue(found and node in here.get(found[0], []), "%s has no such topic %s" % (node, name))
        if full_type:
            self.assertEqual(running.topic_types()[found[0]], full_type)

    def test_parameters_of_nodes(self):
        """Where docs/nodes.md gives a default, it is that of the files in config/."""
        count = 0
        for row in self.document("docs/nodes.md").rows:
            if row.head[0] != "parameter" or not row.cells[1] or row.cells[1].startswith("`$"):
                continue
            for name in re.findall(r"`~([^`]+)`", row.cells[0]):
                with self.subTest(where=row.place, row=name):
                    self.assert_default(row.section.strip("`"), name, row.cells[1].strip("`"))
                    count += 1
        self.assertGreater(count, 15)

    def assert_default(self, file, name, default):
        value = yaml.load(self.read("config", file + ".yaml"), Loader=yaml.BaseLoader)[name]
        try:
            self.assertEqual(float(value), float(default))
        except ValueError:
            self.assertEqual(value, default)

    def test_messages(self):
        """What docs/bring_up.md says that nodes say, they say."""
        sources = "".join(self.source_files().values())
        count = 0
        for row in self.document("docs/bring_up.md").rows:
            if row.head[0] == "it says":
                for message in re.findall(r'"([^"]+)"', row.cells[0]):
                    with self.subTest(where=row.place, message=message):
                        count += 1
                        self.assertRegex(sources, r'"[^"\n]*' + re.escape(message))
        self.assertGreater(count, 5)

    def test_rooms(self):
        """docs/architecture.md has all rooms, in the order that scripts/check_rooms enforces."""
        rooms = [row.cells[0].strip("`") for row in self.document("docs/architecture.md").rows if row.head[0] == "room"]
        check = self.read("scripts", "check_rooms")
        core = re.search(r'split\("([a-z_ ]+)", core\)', check).group(1).split(" ")
        self.assertEqual(rooms, core + re.findall(r'allow\("(\w+)"', check))
        self.assertEqual(set(rooms), set(os.listdir(os.path.join(ROOT, "src"))) - {"CMakeLists.txt"})

    # --------------------------------------------------------------------------------- length, links, drawings, sources

    def test_length(self):
        """Who looks for something finds it at once."""
        for document in self.documents:
            most = 199 if document.path == "README.md" else 250
            with self.subTest(where=document.path):
                self.assertLessEqual(document.line_count, most)

    def test_links(self):
        anchors = {os.path.join(ROOT, document.path): document.anchors for document in self.documents}
        for document in self.documents:
            here = os.path.join(ROOT, document.path)
            for link in document.links:
                with self.subTest(where=link.place, link=link.text):
                    path, _, anchor = link.text.partition("#")
                    target = os.path.normpath(os.path.join(os.path.dirname(here), path)) if path else here
                    self.assertTrue(os.path.exists(target))
                    if anchor:
                        self.assertIn(anchor, anchors[target])

    def test_drawings(self):
        """Classes, methods and functions in drawings are in the sources, methods in a file that names their class."""
        files = [set(re.findall(r"\w+", text)) for text in self.source_files().values()]
        count = 0
        for document in self.documents:
            for source in document.sources:
                if source.language != "text":
                    continue
                for name in re.findall(r"\w+(?:::\w+)+|\w*[a-z]\w*[A-Z]\w*", source.text):
                    with self.subTest(where=source.place, name=name):
                        count += 1
                        self.assertTrue(any(set(name.split("::")) <= words for words in files), "nothing has this name")
        self.assertGreater(count, 50)

    def test_sources(self):
        """The C++ is built by the CMake lines below it, and finds one picture in the other."""
        sources = [source for document in self.documents for source in document.sources]
        self.assertEqual({source.language for source in sources}, {"cpp", "cmake", "yaml", "text"})
        folder = os.path.join(self.directory, "find_goal")
        os.mkdir(folder)
        cpp = [source.text for source in sources if source.language == "cpp"]
        cmake = [source.text for source in sources if source.language == "cmake"]
        self.assertEqual((len(cpp), len(cmake)), (1, 1))
        includes = [line for line in cpp[0].split("\n") if line.startswith("#include")]
        body = [line for line in cpp[0].split("\n") if not line.startswith("#include")]
        with open(os.path.join(folder, "find_goal.cpp"), "w") as file:
            file.write("\n".join(includes + ["int main()", "{"] + body + ["}", ""]))
        with open(os.path.join(folder, "CMakeLists.txt"), "w") as file:
            file.write(cmake[0] + "\n")
        for command in ("cmake -S {0} -B {0}/build -DPYTHON_EXECUTABLE=/usr/bin/python3", "cmake --build {0}/build"):
            self.run_here(command.format(folder))
        self.assertEqual(len(self.run_here("%s/build/find_goal" % folder).split()), 9)  # a homography


if __name__ == "__main__":
    unittest.main(warnings="ignore")  # ROS leaves sockets to the end
