#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""Nodes as nodelets: each class loads, one that refuses to start leaves the others alone, whole runs arrive, and a driver sends
zero before it is unloaded or its manager ends."""
import os
import re
import signal
import sys
import unittest
import xml.etree.ElementTree as tree

import rospy
from geometry_msgs.msg import Twist

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

MANAGER = "host"
PATIENCE = 180.0 * graph.SLOWDOWN  # [s]


def plugins():
    """The names by which nodelets are loaded, without the package's."""
    package = tree.parse(os.path.join(ROOT, "package.xml")).getroot()
    file = package.find("export/nodelet").get("plugin").replace("${prefix}", ROOT)
    return [element.get("name").split("/")[1] for element in tree.parse(file).getroot().iter("class")]


class Nodelets(graph.GraphTest):
    def setUp(self):
        self.commands = []

    def tearDown(self):
        # One after the other: a manager of nodelet 1.10.0, as Debian 11 has it, dies or hangs when it ends just as those do that
        # have loaded nodelets into it.
        while len(self.graph.processes) > 1:  # the first is the master
            process = self.graph.processes.pop()
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            process.wait(PATIENCE)
        for name in os.listdir(self.directory):
            if name.endswith(".log"):
                os.remove(os.path.join(self.directory, name))

    def wait(self, what, holds):
        try:
            return graph.wait_until(what, holds, PATIENCE)
        except AssertionError as error:
            self.fail("%s\n%s" % (error, self.graph.log()))

    def provider(self, service):
        """The node that offers a service; empty: none."""
        return "".join(self.graph.state()[2].get(service, []))

    def start_manager(self):
        manager = self.graph.start("rosrun", "nodelet", "nodelet", "manager", "__name:=" + MANAGER)
        self.wait("a manager", lambda: self.provider("/%s/load_nodelet" % MANAGER))
        return manager

    def load(self, nodelet, *arguments):
        return self.graph.start("rosrun", "nodelet", "nodelet", "load", "view_servo/" + nodelet, MANAGER, *arguments)

    # ------------------------------------------------------------------------------------------------------- loading

    def test_each_is_the_node_of_its_name_and_can_be_loaded_again(self):
        # What only the node of this name offers
        service = {"homing": "enable", "homography_tracker": "start", "line_matcher": "match", "point_matcher": "match",
                   "route_follower": "enable", "route_recorder": "start", "scene_matcher": "match", "servo_25d": "enable",
                   "view_recognizer": "recognize", "view_store": "save"}
        self.assertEqual(sorted(plugins()), sorted(service))
        manager = self.start_manager()
        for _ in range(2):
            loaders = {name: self.load(name, "__name:=" + name) for name in service}
            for name in service:
                self.wait(name, lambda: self.provider("/%s/%s" % (name, service[name])) == "/" + MANAGER)
            for loader in loaders.values():
                loader.send_signal(signal.SIGINT)
            for name in service:
                self.wait("the end of " + name, lambda: not self.provider("/%s/%s" % (name, service[name])))
                loaders[name].wait(PATIENCE)
            self.assertIsNone(manager.poll(), self.graph.log())

    def test_one_that_refuses_to_start_says_the_same_as_its_process_and_leaves_the_others_alone(self):
        manager = self.start_manager()
        self.load("view_store", "__name:=view_store")
        self.wait("view_store", lambda: self.provider("/view_store/save"))
        status, text = self.graph.run("rosrun view_servo point_matcher __name:=bad _rate:=-1.0")
        self.assertEqual(status, 1, text)
        self.assertIn("[FATAL]", text)
        line = re.search(r"~rate must be [^\x1b\n]*", text).group()
        self.assertNotIn(line, self.graph.log())
        self.assertNotEqual(self.load("point_matcher", "__name:=bad", "_rate:=-1.0").wait(PATIENCE), 0)
        self.assertIn(line, self.graph.log())
        self.assertIsNone(manager.poll(), self.graph.log())
        self.assertEqual(self.provider("/view_store/save"), "/" + MANAGER)
        self.assertFalse(self.provider("/bad/match"))

    # ------------------------------------------------------------------------------------------------------- driving

    def moves(self):
        """Whether the last command does."""
        last = self.commands[-1] if self.commands else Twist()
        return any((last.linear.x, last.linear.y, last.angular.z))

    def assert_zero_is_sent(self, end):
        """Has a base driven by a nodelet. @param end ends that. @return the manager."""
        manager = self.start_manager()
        subscriber = rospy.Subscriber("/cmd_vel", Twist, self.commands.append)
        self.addCleanup(subscriber.unregister)
        self.graph.start("roslaunch", "view_servo", "nomad_sim.launch")
        self.graph.start("roslaunch", "view_servo", "homing.launch", "sim:=false", "nodelets:=true", "manager:=" + MANAGER)
        self.graph.start("rosrun", "view_servo", "run_homing", "_patience:=%g" % PATIENCE, "_exit:=false")
        self.wait("commands that move the base", self.moves)
        self.assertEqual(self.graph.state()[0]["/cmd_vel"], ["/" + MANAGER])
        end()
        self.wait("the end of homing", lambda: not self.graph.state()[0].get("/cmd_vel"))
        self.wait("zero as the last command", lambda: not self.moves())
        return manager

    def test_zero_is_sent_when_a_driver_is_unloaded_and_the_manager_goes_on(self):
        manager = self.assert_zero_is_sent(lambda: os.kill(self.graph.pid_of("/homing"), signal.SIGINT))
        self.assertIsNone(manager.poll(), self.graph.log())
        self.graph.run("rosnode kill /" + MANAGER)
        self.assertEqual(manager.wait(PATIENCE), 0, self.graph.log())

    def test_zero_is_sent_when_the_manager_is_interrupted(self):
        manager = self.assert_zero_is_sent(lambda: os.kill(self.graph.pid_of("/" + MANAGER), signal.SIGINT))
        self.assertEqual(manager.wait(PATIENCE), 0, self.graph.log())

    def test_zero_is_sent_when_the_manager_is_terminated(self):
        manager = self.assert_zero_is_sent(lambda: os.kill(self.graph.pid_of("/" + MANAGER), signal.SIGTERM))
        self.assertEqual(manager.wait(PATIENCE), 0, self.graph.log())

    def test_zero_is_sent_when_the_managers_terminal_is_closed(self):
        before = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # what is started inherits that it is ignored, as by nohup
        self.addCleanup(signal.signal, signal.SIGHUP, before)
        manager = self.assert_zero_is_sent(lambda: os.kill(self.graph.pid_of("/" + MANAGER), signal.SIGHUP))
        self.assertEqual(manager.wait(PATIENCE), 0, self.graph.log())

    def test_zero_is_sent_when_the_manager_is_ended_by_rosnode_kill(self):
        manager = self.assert_zero_is_sent(lambda: self.graph.run("rosnode kill /" + MANAGER))
        self.assertEqual(manager.wait(PATIENCE), 0, self.graph.log())

    def assert_arrives(self, launch_file):
        result = os.path.join(self.directory, launch_file + ".result")
        _, text = self.graph.run("roslaunch view_servo %s nodelets:=true result:=%s patience:=%g" %
                                 (launch_file, result, PATIENCE), PATIENCE)
        self.assertTrue(os.path.exists(result), text[-3000:])
        graph.outcome_of_run(result)

    def test_homing_arrives(self):
        self.assert_arrives("homing.launch")

    def test_servoing_arrives(self):
        self.assert_arrives("arm_servo.launch")


if __name__ == "__main__":
    unittest.main(verbosity=2)
