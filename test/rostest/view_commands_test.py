#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
The program `view` against view_store and a simulated base that homes, and against peers that hang, have died, or do not do what
they are asked: each time it has to end in time, with the right status and a line that says what the matter is.
"""
import contextlib
import http.server
import importlib.machinery
import importlib.util
import io
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import unittest
import unittest.mock

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

import actionlib  # noqa: E402
import PIL.Image  # noqa: E402
import rospy  # noqa: E402
from geometry_msgs.msg import PoseStamped  # noqa: E402
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse  # noqa: E402
from view_servo.msg import (FollowRouteAction, FollowRouteResult, HomeToViewAction, HomeToViewResult, ServoStatus,  # noqa: E402
                            ServoToViewAction, ServoToViewResult)
from view_servo.srv import StartRoute, StartRouteResponse  # noqa: E402

sys.dont_write_bytecode = True
loader = importlib.machinery.SourceFileLoader("view", os.path.join(ROOT, "scripts", "view"))
program = importlib.util.module_from_spec(importlib.util.spec_from_loader("view", loader))
loader.exec_module(program)

PATIENCE = 60.0 * graph.SLOWDOWN  # for one command [s]
VIEW = os.path.join(os.environ["CMAKE_PREFIX_PATH"].split(":")[0], "lib", "view_servo", "view")
DONE, NOT_DONE, CANNOT = 0, 1, 2


class Peer:
    """A port on which somebody listens and never says a word; or, `closed`, nobody listens."""

    def __init__(self, closed=False):
        self.socket = socket.socket()
        self.socket.bind(("localhost", 0))
        self.port = self.socket.getsockname()[1]
        if not closed:
            self.socket.listen(10)


class QuietPages(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


class Driver:
    """A driver in this process. What it does with goals is `behaviour`."""

    def __init__(self, action, action_type, result_type, service):
        self.behaviour = "arrive"
        self.enabled = None
        self.goals = []
        self.came = threading.Event()
        self._result_type = result_type
        self.server = actionlib.ActionServer(action, action_type, self._take, self._cancel, auto_start=False)
        self.server.start()
        self._gate = service
        self.open_service()
        self.status = rospy.Publisher("status", ServoStatus, queue_size=10, latch=True)

    def open_service(self):
        self.service = rospy.Service(self._gate, SetBool, self._enable)

    def _enable(self, request):
        self.enabled = request.data
        return SetBoolResponse(True, "enabled" if request.data else "disabled")

    def _take(self, handle):
        handle.set_accepted()
        self.goals.append(handle.get_goal())
        if self.behaviour == "arrive":
            handle.set_succeeded(self._result_type(success=True, message="the views agree"))
        elif self.behaviour == "refuse":
            handle.set_aborted(self._result_type(success=False, message="disabled: call ~enable first"))
        self.came.set()

    def _cancel(self, handle):
        if self.behaviour != "deaf":
            handle.set_canceled(self._result_type(success=False, message="the goal was cancelled"))


class ViewCommands(graph.GraphTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        # The simulated base has a namespace of its own; the first one is for view_store and drivers that are made up.
        for arguments in (["nomad_sim.launch"], ["homing.launch", "sim:=false"]):
            cls.graph.start("env", "ROS_NAMESPACE=/base", "roslaunch", "view_servo", *arguments)
        cls.views = os.path.join(cls.directory, "views")
        cls.graph.start("rosrun", "view_servo", "view_store", "_views_dir:=" + cls.views)
        PIL.Image.linear_gradient("L").save(os.path.join(cls.directory, "ramp.png"))
        cls.pose = None
        cls.subscriber = rospy.Subscriber("/base/ground_truth", PoseStamped, cls.take_pose)
        node = rospy.get_name()
        # One goes by the names that launch files give, the other's service by its node's.
        cls.homing = Driver("home", HomeToViewAction, HomeToViewResult, "homing/enable")
        cls.arm = Driver("arm1/servo", ServoToViewAction, ServoToViewResult, node + "/enable")
        cls.follower = Driver("follow", FollowRouteAction, FollowRouteResult, "route_follower/enable")
        cls.hanging, cls.dead = Peer(), Peer(closed=True)
        for peer, space in ((cls.hanging, "/hanging"), (cls.dead, "/dead")):
            for service in ("view_store/list", "homing/enable"):
                uri = "localhost:%d" % peer.port
                cls.graph.master.registerService(space + "/peer", space + "/" + service, "rosrpc://" + uri, "http://" + uri)
        try:
            for service in ("/view_store/list", "/base/view_store/save", "/base/homing/enable", "/base/nomad_sim/set_pose"):
                graph.wait_until(service, lambda: service in cls.graph.state()[2])  # pylint: disable=cell-var-from-loop
        except AssertionError as error:
            raise AssertionError("%s\n%s" % (error, cls.graph.log()))

    @classmethod
    def tearDownClass(cls):
        cls.subscriber.unregister()
        super().tearDownClass()

    @classmethod
    def take_pose(cls, message):
        cls.pose = message.pose.position

    def setUp(self):
        for driver in (self.homing, self.arm, self.follower):
            driver.behaviour, driver.enabled = "arrive", None
            driver.goals.clear()
            driver.came.clear()

    def begin(self, *words, **environment):
        """Starts `view`."""
        return subprocess.Popen([VIEW] + list(words), cwd=self.directory, env=dict(self.graph.environment, **environment),
                                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                universal_newlines=True, preexec_fn=graph.end_with_parent)

    def end(self, process, status, complaint=None):
        """Waits for its end. @return what it printed on standard output; on standard error has to be one line, or nothing."""
        out, err = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, status, out + err)
        self.check_complaint(err, complaint)
        return out

    def check_complaint(self, err, complaint):
        if complaint is None:
            self.assertEqual(err, "")
        else:
            self.assertRegex(err, complaint)
            self.assertEqual(err.count("\n"), 1, err)
            self.assertTrue(err.startswith("view: "), err)

    def view_here(self, words, status=DONE, complaint=None, **environment):
        """Like view(), in this process, which takes no time; not for what has to become a node."""
        out, err = io.StringIO(), io.StringIO()
        before = os.getcwd()
        os.chdir(self.directory)
        try:
            with unittest.mock.patch.dict(os.environ, environment), contextlib.redirect_stdout(out), \
                    contextlib.redirect_stderr(err):
                self.assertEqual(program.run(["view"] + words.split()), status, err.getvalue() + out.getvalue())
        finally:
            os.chdir(before)
        self.check_complaint(err.getvalue(), complaint)
        return out.getvalue()

    def view(self, words, status=DONE, complaint=None, **environment):
        return self.end(self.begin(*words.split(), **environment), status, complaint)

    def test_views(self):
        self.assertIn("no views", self.view_here("list"))
        self.assertEqual(self.view_here("list --names"), "")
        self.assertIn("saved view 'ramp', 256 x 256", self.view_here("save ramp --file ramp.png"))
        self.view_here("save ramp --file ramp.png", NOT_DONE, "there is one of that name; --overwrite replaces it")
        self.view_here("save ramp --file ramp.png --overwrite --roi 1 2 30 40")
        self.view_here("save ramp2 --file missing.png", NOT_DONE, "%s/missing.png" % re.escape(self.directory))
        self.view_here("save bad/name --file ramp.png", NOT_DONE, "a name is")
        self.view_here("save broken --file ramp.png")
        with open(os.path.join(self.views, "broken.yaml"), "a") as file:
            file.write("garbage\n")
        lines = self.view_here("list").split("\n")
        self.assertEqual([line.split()[0] for line in lines if line], ["NAME", "ramp", "broken"])
        self.assertRegex(lines[1], r"^ramp +- +256 x 256 +no$")
        self.assertRegex(lines[2], r"^broken is damaged: .*checksum")
        self.assertEqual(self.view_here("list --names"), "broken\nramp\n")
        known = json.loads(self.view_here("list --json"))
        self.assertEqual(known["views"], [{"name": "ramp", "stamp": None, "age": None, "width": 256, "height": 256,
                                           "calibrated": False, "roi": [1, 2, 30, 40], "pose_frame": None}])
        self.assertEqual([view["name"] for view in known["damaged"]], ["broken"])
        self.assertIn("x 1, y 2, width 30, height 40", self.view_here("show ramp --out copy.png"))
        with PIL.Image.open(os.path.join(self.directory, "copy.png")) as copy:
            self.assertEqual(copy.tobytes(), PIL.Image.linear_gradient("L").tobytes())
        self.view_here("show ramp --out there/is/none.png", CANNOT, "none.png cannot be written: No such file or directory")
        self.view_here("show ramp --out copy.what", CANNOT, "ends with .png")
        self.view_here("show broken", NOT_DONE, "checksum")
        self.view_here("show nothing", NOT_DONE, "none of that name")
        self.assertIn("deleted view 'broken'", self.view_here("delete broken"))
        self.view_here("delete broken", NOT_DONE, "none of that name")

    def test_other_names(self):
        self.view_here("list view_store:=/view_store", ROS_NAMESPACE="/robot1")
        self.view_here("list", CANNOT, "there is no /robot1/view_store/list; there is one in / and in .*: set",
                       ROS_NAMESPACE="/robot1")
        self.view("list __ns:=/robot2", CANNOT, "there is no /robot2/view_store/list;")

    def test_nobody_answers(self):
        begin = time.monotonic()
        none, silent = "http://localhost:%d" % Peer(closed=True).port, Peer()
        watch = self.begin("watch", "--patience", "0.5", "__ns:=/empty")
        for command in ("list", "save x", "show x", "delete x", "go x", "stop", "watch"):
            self.view_here(command, CANNOT, "there is no ROS master at %s" % none, ROS_MASTER_URI=none)
        for command in ("list", "go x", "stop"):
            self.view_here(command + " --patience 0.3", CANNOT, "does not answer",
                           ROS_MASTER_URI="http://localhost:%d" % silent.port)
        self.view_here("list", CANNOT, "set it to http://HOST:11311", ROS_MASTER_URI="localhost")
        pages = http.server.ThreadingHTTPServer(("localhost", 0), QuietPages)
        threading.Thread(target=pages.serve_forever, daemon=True).start()
        self.addCleanup(pages.shutdown)
        self.view_here("list", CANNOT, "is no ROS master", ROS_MASTER_URI="http://localhost:%d" % pages.server_port)
        for command, space, complaint in (
                ("list --patience 0.3", "/hanging", "/hanging/view_store/list does not answer within 0.3 s"),
                ("list", "/dead", "/dead/view_store/list cannot be called"),
                ("go x", "/empty", "nobody serves the actions /empty/home, /empty/servo and /empty/follow; there is one in /.* and in /base: set"),
                ("stop", "/empty", "no driver runs: .* or add __ns:=.*, or --all"),
                ("list", "/empty", "there is no /empty/view_store/list; there is one in /")):
            self.view_here(command, CANNOT, complaint, ROS_NAMESPACE=space)
        self.end(watch, CANNOT, "no driver runs")
        self.assertLess(time.monotonic() - begin, 30.0 * graph.SLOWDOWN)

    def test_pick_view_without_a_window(self):
        for display in ("", ":4711"):
            status, text = self.graph.run("DISPLAY=%s WAYLAND_DISPLAY= rosrun view_servo pick_view dock" % display)
            self.assertEqual(status, CANNOT, text)
            self.assertRegex(text, "^pick_view: no window can be opened on display '%s': .*view save NAME --roi[^\n]*\n$" % display)

    def test_interrupted_while_waiting(self):
        process = self.begin("list", "--patience", "600", "__ns:=/hanging")
        connection, _ = self.hanging.socket.accept()
        with contextlib.closing(connection):
            process.send_signal(signal.SIGINT)
            self.end(process, NOT_DONE, "interrupted")

    def test_go(self):
        out = self.view("go dock --timeout 7 --enable")
        self.assertIn("asking %s to drive to 'dock'" % rospy.get_name(), out)
        self.assertIn("arrived: the views agree", out)
        self.assertEqual([(goal.view, goal.timeout) for goal in self.homing.goals], [("dock", 7.0)])
        self.assertEqual((self.homing.enabled, self.arm.enabled, self.arm.goals), (True, None, []))
        self.view("go shelf servo:=arm1/servo --driver servo_25d")
        self.assertEqual(([goal.view for goal in self.arm.goals], self.arm.enabled), (["shelf"], None))
        self.homing.behaviour = "refuse"
        self.view("go dock --driver homing", NOT_DONE, "the gate of .* is closed.*; type: view go dock --driver homing --enable")
        self.assertEqual(self.homing.enabled, True)
        self.view("go dock servo:=arm1/servo", CANNOT, "add --driver homing or --driver servo_25d")
        self.view("go dock --driver servo_25d", CANNOT, "servo_25d does not run here, but")

    def test_cancelled(self):
        self.homing.behaviour = "drive"
        for number in (signal.SIGINT, signal.SIGHUP):
            self.homing.came.clear()
            process = self.begin("go", "dock")
            self.assertTrue(self.homing.came.wait(PATIENCE))
            process.send_signal(number)
            self.assertIn("waiting until the robot stands", self.end(process, NOT_DONE, "not arrived: the goal was cancelled"))

    def test_nobody_reads(self):
        """Of a goal whose progress nobody can see any more the end is wanted."""
        self.homing.behaviour = "drive"
        process = self.begin("go", "dock")
        self.assertTrue(self.homing.came.wait(PATIENCE))
        process.stdout.close()
        ended = lambda: not self.homing.server.status_list or all(  # noqa: E731
            tracker.status.status not in (0, 1) for tracker in self.homing.server.status_list)
        self.assertFalse(ended())
        stamp = rospy.Time.now()
        graph.wait_until("the end", lambda: self.homing.status.publish(ServoStatus(state=int(time.monotonic()) % 5)) or ended())
        self.assertEqual(process.wait(PATIENCE), NOT_DONE)
        process.stderr.close()
        self.assertLess((rospy.Time.now() - stamp).to_sec(), PATIENCE)

    def test_deaf(self):
        """Drivers that talk, but do not end goals."""
        self.homing.behaviour = "deaf"
        runs = [(self.begin("go", "dock", "--timeout", "0.1"), "has not ended the goal within its timeout of 0.1 s")]
        self.assertTrue(self.homing.came.wait(PATIENCE))
        self.homing.came.clear()
        runs.append((self.begin("go", "dock"), "has not ended the cancelled goal within"))
        self.assertTrue(self.homing.came.wait(PATIENCE))
        runs[-1][0].send_signal(signal.SIGINT)
        for process, complaint in runs:
            self.end(process, NOT_DONE, complaint + ".*; use|" + complaint)
        # Disabled it is, which is what counts.
        out = self.view("stop --patience 1")
        self.assertIn("disabled; whether a goal is left is not known", out)
        self.assertEqual(self.homing.enabled, False)
        for tracker in self.homing.server.status_list:
            tracker.status.status = 4

    def test_waits_for_the_nodes_timeout(self):
        """It is a parameter below the name that the services are below, as a nodelet's actions are its manager's."""
        rospy.set_param("/homing/timeout", 0.5)
        self.homing.behaviour = "deaf"
        try:
            self.view("go dock", NOT_DONE, "has not ended the goal within its timeout of 0.5 s")
        finally:
            rospy.delete_param("/homing/timeout")

    def test_go_to_several_views(self):
        out = self.view("go above shelf --approach 0.01 0.05 servo:=arm1/servo --driver servo_25d")
        self.assertIn("to drive to 'above', then 'shelf'; Ctrl-C stops it", out)
        goal = self.arm.goals[-1]
        self.assertEqual((goal.view, [(view.view, view.translation_tolerance, view.rotation_tolerance) for view in goal.views]),
                         ("", [("above", 0.01, 0.05), ("shelf", 0.0, 0.0)]))
        self.view("go shelf servo:=arm1/servo --driver servo_25d")
        self.assertEqual((self.arm.goals[-1].view, self.arm.goals[-1].views), ("shelf", []))
        approach = self.begin("go", "hall", "dock", "--driver", "homing", "--approach", "0.01", "0.05")
        self.end(approach, CANNOT, "takes no tolerances with a goal")
        self.assertEqual(self.homing.goals, [])
        self.view("go hall dock --driver homing")
        self.assertEqual((self.homing.goals[-1].view, self.homing.goals[-1].views), ("", ["hall", "dock"]))

    def test_follow(self):
        out = self.view("follow hall --from hall_002 --to hall_007 --reverse --timeout 9 --enable")
        self.assertIn("to follow route 'hall' from 'hall_002' to 'hall_007' backwards; Ctrl-C stops it", out)
        goal = self.follower.goals[-1]
        self.assertEqual((goal.route, goal.start, goal.goal, goal.reverse, goal.timeout), ("hall", "hall_002", "hall_007", True, 9.0))
        self.assertEqual((self.follower.enabled, self.homing.goals, self.homing.enabled), (True, [], None))
        self.follower.behaviour = "refuse"
        self.view("follow hall", NOT_DONE, "the gate of .* is closed.*; type: view follow hall --enable")
        self.view("follow hall --to hall_003", NOT_DONE, "; type: view follow hall --to hall_003 --enable")
        self.assertEqual((self.follower.goals[-1].start, self.follower.goals[-1].reverse), ("", False))
        self.follower.behaviour = "arrive"
        self.view("go hall_003 --driver route_follower")  # along its route
        self.assertEqual((self.follower.goals[-1].route, self.follower.goals[-1].goal, self.homing.goals), ("", "hall_003", []))
        self.view_here("go hall_001 hall_003 --driver route_follower", CANNOT, "goes to one view, along the route")
        self.follower.behaviour, process = "drive", self.begin("follow", "hall")
        self.follower.came.clear()
        self.assertTrue(self.follower.came.wait(PATIENCE))
        process.send_signal(signal.SIGINT)
        self.end(process, NOT_DONE, "not arrived: the goal was cancelled")
        self.view_here("follow hall", CANNOT, "nobody serves the action /empty/follow; there is one in /", ROS_NAMESPACE="/empty")

    def test_record(self):
        calls = []

        def start(request):
            calls.append(request.name)
            return StartRouteResponse(request.name != "odd", "route '%s' is recorded" % request.name)

        def stop(_):
            calls.append("stop")
            return TriggerResponse(calls[-2] != "short", "stored it" if calls[-2] != "short" else "not stored: one view only")

        self.view_here("record hall", CANNOT, "there is no /route_recorder/start: start route_recorder, by roslaunch")
        services = [rospy.Service("route_recorder/start", StartRoute, start), rospy.Service("route_recorder/stop", Trigger, stop)]
        try:
            self.view_here("record odd", NOT_DONE, "route 'odd' is recorded")
            self.assertEqual(calls, ["odd"])
            for name, status, complaint in (("hall", DONE, None), ("short", NOT_DONE, "not stored: one view only")):
                process = self.begin("record", name)
                self.lines_until(process, "press Ctrl-C")
                self.assertEqual(calls[-1], name)
                process.send_signal(signal.SIGINT)
                self.assertEqual(self.end(process, status, complaint), "stored it\n" if status == DONE else "")
                self.assertEqual(calls[-2:], [name, "stop"])
            process = self.begin("record", "hall")
            self.lines_until(process, "press Ctrl-C")
        finally:
            for service in services:
                service.shutdown()
        self.end(process, NOT_DONE, "the recorder has gone")

    def test_stop(self):
        self.homing.behaviour = self.arm.behaviour = "drive"
        runs = [self.begin("go", "dock"), self.begin("go", "shelf", "servo:=arm1/servo", "--driver", "servo_25d")]
        for driver in (self.homing, self.arm):
            self.assertTrue(driver.came.wait(PATIENCE))
        out = self.view("stop servo:=arm1/servo")
        self.assertEqual(out.count("disabled; no goal is left"), 3, out)
        self.assertIn("left alone: /base/homing and /dead/peer and /hanging/peer; --all stops those, too", out)
        self.assertEqual((self.homing.enabled, self.arm.enabled, self.follower.enabled), (False, False, False))
        for process in runs:
            self.end(process, NOT_DONE, "not arrived: the goal was cancelled")
        for space, cause in (("/hanging", "does not answer within"), ("/dead", "cannot be called")):
            process = self.begin("stop", "--patience", "0.5", "__ns:=" + space)
            out, err = process.communicate(timeout=PATIENCE)
            self.assertEqual((process.returncode, out), (CANNOT, ""), err)
            self.assertRegex(err, r"^%s/peer: %s/homing/enable %s.*\nview: not stopped: .*emergency stop\n$" %
                             (space, space, cause))
        # One is reached, the other not.
        process = self.begin("stop", "--patience", "0.5", "servo:=/arm1/servo", "__ns:=/hanging")
        out, err = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, NOT_DONE, out + err)
        self.assertIn("no goal is left", out)
        self.assertIn("not stopped", err)
        # All that can be reached are stopped, wherever they are.
        self.homing.enabled = self.arm.enabled = self.follower.enabled = True
        process = self.begin("stop", "--all", "--patience", "%g" % (3.0 * graph.SLOWDOWN), "__ns:=/empty")
        out, err = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, NOT_DONE, out + err)
        self.assertEqual((self.homing.enabled, self.arm.enabled, self.follower.enabled), (False, False, False))
        self.assertEqual(out.count("disabled; no goal is left"), 3, out)
        self.assertRegex(err, "not stopped: .*/dead/peer and /hanging/peer; use the robot's emergency stop")
        # A driver whose gate nobody finds may drive again.
        self.arm.service.shutdown()
        process = self.begin("stop", "servo:=arm1/servo")
        out, err = process.communicate(timeout=PATIENCE)
        self.arm.open_service()
        self.assertEqual(process.returncode, NOT_DONE, out + err)
        self.assertIn("its gate was not found, so that it drives again when a goal comes; no goal is left", err)
        self.assertIn("not stopped", err)

    def lines_until(self, process, words):
        """The lines that a process prints, up to one with these words. It is killed when that does not come in time."""
        deadline = threading.Timer(PATIENCE, process.kill)
        deadline.start()
        lines = []
        while not lines or words not in lines[-1]:
            lines.append(process.stdout.readline())
            self.assertNotEqual(lines[-1], "", "no line says '%s': %s" % (words, lines))
        deadline.cancel()
        return lines

    def test_watch(self):
        self.homing.status.publish(ServoStatus(state=ServoStatus.IDLE, reason="begins"))  # latched
        process = self.begin("watch")
        self.lines_until(process, "begins")  # it listens
        for state, reason in ((ServoStatus.ACQUIRING, "looks"), (ServoStatus.ACQUIRING, "looks"), (ServoStatus.LOST, "covered")):
            self.homing.status.publish(ServoStatus(state=state, reason=reason))
        lines = self.lines_until(process, "lost")
        self.assertEqual(len(lines), 2, lines)
        self.assertRegex(lines[0], r"^\d\d:\d\d:\d\d  %s: acquiring: looks$" % rospy.get_name())
        self.assertRegex(lines[1], "lost: covered$")
        process.send_signal(signal.SIGINT)
        self.assertEqual(self.end(process, DONE), "")

    def move(self, x):
        pose = "{pose: {position: {x: %g}, orientation: {w: 1.0}}}" % x
        status, text = self.graph.run("rosservice call /base/nomad_sim/set_pose '%s'" % pose)
        self.assertEqual(status, 0, text)
        graph.wait_until("a pose", lambda: self.pose is not None and abs(self.pose.x - self.goal.x - x) < 0.05)

    def drive(self):
        """A `view go` that drives."""
        process = self.begin("go", "dock", "--enable", "--patience", "2", "__ns:=/base")
        self.lines_until(process, "servoing")
        return process

    def test_drive(self):
        self.assertIn("saved view 'dock', 640 x 480, with its pose in odom", self.view("save dock __ns:=/base"))
        self.assertRegex(self.view_here("list", ROS_NAMESPACE="/base"), r"dock +\d+ s +640 x 480 +yes")
        graph.wait_until("a pose", lambda: self.pose is not None)
        type(self).goal = self.pose
        self.move(-0.3)
        watch = self.begin("watch", "__ns:=/base")
        self.lines_until(watch, "disabled")
        self.view("go dock __ns:=/base", NOT_DONE, "the gate of /base/homing is closed")
        if graph.SLOWDOWN == 1.0:  # what is built with sanitizers is too slow for images in real time
            out = self.view("go dock --enable --timeout 60 __ns:=/base")
            self.assertRegex(out, r"servoing; 0\.\d\d\d m, .* to go")
            self.assertIn("arrived", out)
            self.assertLess(abs(self.pose.x - self.goal.x), 0.01)
            self.move(-0.6)
            process = self.drive()
            self.assertIn("disabled; no goal is left", self.view("stop __ns:=/base"))
            self.end(process, NOT_DONE, "not arrived: ")
            process = self.drive()
            pid = self.graph.pid_of("/base/homing")
            os.kill(pid, signal.SIGSTOP)
            self.end(process, NOT_DONE, "/base/homing has been silent for 2 s.*emergency stop")
            os.kill(pid, signal.SIGCONT)
            process = self.drive()
            os.kill(pid, signal.SIGKILL)
            self.end(process, NOT_DONE, "/base/homing has gone")
        watch.send_signal(signal.SIGINT)
        self.assertIn("/base/homing: disabled: ", self.end(watch, DONE))


if __name__ == "__main__":
    unittest.main(verbosity=2, warnings="ignore")  # ROS leaves sockets to the end
