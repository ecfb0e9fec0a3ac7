#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""scripts/check_rooms passes for the sources as they are, and names an include of each wrong kind that is planted in them."""
import os
import shutil
import subprocess
import tempfile
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))


class CheckRooms(unittest.TestCase):
    def setUp(self):
        self.directory = tempfile.mkdtemp(prefix="view_servo_rooms_")
        self.addCleanup(shutil.rmtree, self.directory)
        for folder in ("include", "src"):
            shutil.copytree(os.path.join(ROOT, folder), os.path.join(self.directory, folder))

    def check(self):
        result = subprocess.run([os.path.join(ROOT, "scripts", "check_rooms"), self.directory], stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, universal_newlines=True)
        return result.returncode, result.stdout

    def plant(self, file, header):
        path = os.path.join(self.directory, file)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "a") as source:
            source.write('#include "%s"\n' % header)

    def test_passes_for_the_sources(self):
        self.assertEqual(self.check(), (0, ""))

    def test_names_each_kind_of_wrong_include(self):
        cases = [
            ("include/view_servo/geometry/planted.h", "view_servo/views/view_store.h", "a later room of the core"),
            ("src/matching/planted.cpp", "view_servo/robust/ransac.h", "the next room of the core"),
            ("src/control/planted.cpp", "sim/world.h", "the simulation from the core"),
            ("src/sim/planted.cpp", "view_servo/control/homing.h", "the core's later rooms from the simulation"),
            ("src/sim/planted.cpp", "trials/trial.h", "trials from the simulation, which would make it GPL"),
            ("src/ros/planted.cpp", "sim/world.h", "the simulation from ROS' edge"),
            ("src/tools/planted.cpp", "experiments/parallel.h", "experiments from tools"),
            ("src/views/planted.cpp", "view_servo/ros/node_base.h", "ROS' edge from the core"),
            ("src/views/planted.cpp", "sensor_msgs/Image.h", "a message from the core"),
            ("src/views/planted.cpp", "view_servo/Heading.h", "a message of our own from the core"),
            ("src/trials/planted.cpp", "ros/ros.h", "ROS from trials"),
            ("src/check/planted.cpp", "ros/ros.h", "ROS from check"),
            ("src/check_ros/planted.cpp", "sim/world.h", "the simulation from check_robot"),
            ("src/tracking/planted.cpp", "visp3/core/vpColVector.h", "ViSP elsewhere than in control"),
            ("src/nodes/planted.cpp", "visp3/core/vpColVector.h", "ViSP elsewhere than in control"),
            ("src/nodes/planted.cpp", "../sim/world.h", "a relative path"),
            ("src/attic/planted.cpp", "vector", "a room without a place"),
        ]
        for file, header, what in cases:
            with self.subTest(what):
                self.plant(file, header)
                status, text = self.check()
                self.assertNotEqual(status, 0, what)
                self.assertIn(file, text)
                os.remove(os.path.join(self.directory, file))
        shutil.rmtree(os.path.join(self.directory, "src", "attic"))
        self.assertEqual(self.check(), (0, ""), "nothing planted is left")


if __name__ == "__main__":
    unittest.main()
