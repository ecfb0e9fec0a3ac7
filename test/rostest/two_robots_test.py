#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""Two robots of a kind under one master, in two namespaces, with prefixes of their own for their frames on one /tf."""
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

PATIENCE = 180.0 * graph.SLOWDOWN  # [s]


class TwoRobots(unittest.TestCase):
    def setUp(self):
        self.directory = tempfile.mkdtemp(prefix="view_servo_two_robots_")
        self.graph = graph.Graph(self.directory)
        self.runs = []

    def tearDown(self):
        for run in self.runs:
            if run.poll() is None:
                run.terminate()
                run.wait(30.0)
        self.graph.stop()
        shutil.rmtree(self.directory, ignore_errors=True)

    def start(self, launch_file, name, *arguments):
        """Runs a launch file in a namespace. @return where the outcome will be: 0, when it is a success, and a line."""
        result = os.path.join(self.directory, name)
        environment = dict(os.environ, ROS_MASTER_URI=self.graph.uri, ROS_HOSTNAME="localhost", ROS_NAMESPACE=name,
                           ROS_HOME=os.path.join(self.directory, "home_" + name))
        with open(result + ".log", "w") as log:
            self.runs.append(subprocess.Popen(
                ["roslaunch", "--wait", "view_servo", launch_file, "frame_prefix:=" + name, "result:=" + result,
                 "patience:=%g" % PATIENCE, *arguments],
                env=environment, stdout=log, stderr=subprocess.STDOUT, preexec_fn=graph.end_with_parent))
        return result

    def assert_successes(self, results):
        for run in self.runs:
            run.wait(PATIENCE)
        for result in results:
            with open(result + ".log") as log:
                text = log.read()
            self.assertTrue(os.path.exists(result), text[-3000:])
            try:
                graph.outcome_of_run(result)
            except AssertionError as error:
                self.fail("%s\n%s" % (error, text[-3000:]))

    def test_two_arms(self):
        self.assert_successes([self.start("arm_servo.launch", name) for name in ("arm1", "arm2")])

    def test_two_bases(self):
        self.assert_successes([self.start("homing.launch", name) for name in ("base1", "base2")])


if __name__ == "__main__":
    unittest.main(verbosity=2)
