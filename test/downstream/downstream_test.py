#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""Projects that use this package's libraries, one with catkin and one without, from the devel and from the install space.

downstream_test.py BUILD DEVEL: the build directory, in which everything is built, and the devel space."""
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
BUILD, DEVEL = (os.path.abspath(path) for path in sys.argv[1:3])
# What ROS and the shell say where packages are
FORGOTTEN = ("CMAKE_PREFIX_PATH", "LD_LIBRARY_PATH", "PKG_CONFIG_PATH", "ROS_PACKAGE_PATH", "PYTHONPATH")


def run(*words, **more):
    outcome = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300, **more)
    return outcome.returncode, outcome.stdout


class Downstream(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.directory = tempfile.mkdtemp(prefix="view_servo_downstream_")
        cls.install = os.path.join(cls.directory, "install")
        status, said = run("cmake", "-DCMAKE_INSTALL_PREFIX=" + cls.install, "-P", os.path.join(BUILD, "cmake_install.cmake"))
        assert status == 0, said
        cls.picture = os.path.join(cls.directory, "picture.pgm")
        with open(cls.picture, "wb") as picture:
            picture.write(b"P5 160 120 255\n" + bytes(100 for _ in range(160 * 120)))

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.directory, ignore_errors=True)

    def build(self, project, space):
        """@return where the programs are."""
        build = os.path.join(self.directory, "build_{}_{}".format(project, os.path.basename(space)))
        environment = {name: value for name, value in os.environ.items() if name not in FORGOTTEN}
        prefixes = ";".join([space] + [path for path in os.environ.get("CMAKE_PREFIX_PATH", "").split(":")
                                       if path and path != DEVEL])
        status, said = run("cmake", "-S", os.path.join(HERE, project), "-B", build, "-DCMAKE_BUILD_TYPE=Debug",
                           "-DCMAKE_PREFIX_PATH=" + prefixes, "-DPYTHON_EXECUTABLE=" + sys.executable,
                           "-DPython3_EXECUTABLE=" + sys.executable, env=environment)
        self.assertEqual(status, 0, said)
        status, said = run("cmake", "--build", build, env=environment)
        self.assertEqual(status, 0, said)
        return build

    def find(self, build, program):
        for folder, _, files in os.walk(build):
            if program in files:
                return os.path.join(folder, program)
        self.fail("there is no {} in {}".format(program, build))

    def test_plain_cmake(self):
        for space in (DEVEL, self.install):
            with self.subTest(space=space):
                build = self.build("plain", space)
                status, said = run(self.find(build, "find_goal"), self.picture, self.picture)
                self.assertEqual(status, 1, said)
                self.assertIn("too few corners", said)
                self.assertEqual(run(self.find(build, "servo")), (0, ""))

    def test_catkin_package(self):
        for space in (DEVEL, self.install):
            with self.subTest(space=space):
                build = self.build("package", space)
                status, said = run(self.find(build, "find_goal"), self.picture, self.picture)
                self.assertEqual(status, 1, said)
                self.assertEqual(run(self.find(build, "read_status")), (0, ""))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
