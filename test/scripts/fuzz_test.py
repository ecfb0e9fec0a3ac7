#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""scripts/fuzz: what it asks of libFuzzer, and what it says of the outcome. Programs that only note how they were called stand for
clang, for the build and for the targets."""
import os
import shutil
import stat
import subprocess
import tempfile
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
TARGETS = ["images", "segments"]


class Fuzz(unittest.TestCase):
    def setUp(self):
        self.root = tempfile.mkdtemp(prefix="view_servo_fuzz_")
        self.addCleanup(shutil.rmtree, self.root)
        self.write("bin/clang++", "exit 0")
        self.write("scripts/build", 'printf "%s\\n" "$@" > "$VIEW_SERVO_BUILD_DIR.asked"')
        for target in TARGETS:
            self.write("fuzz/%s.cpp" % target, "")
            os.makedirs(os.path.join(self.root, "fuzz", "seeds", target))
            self.target(target, "echo stat::number_of_executed_units: 1234")
        shutil.copy(os.path.join(ROOT, "scripts", "fuzz"), os.path.join(self.root, "scripts", "fuzz"))

    def write(self, name, text):
        path = os.path.join(self.root, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w") as file:
            file.write("#!/bin/bash\n%s\n" % text)
        os.chmod(path, os.stat(path).st_mode | stat.S_IXUSR)

    def target(self, name, text):
        self.write("build/fuzz/fuzz/fuzz_" + name, 'printf "%%s\\n" "$@" > %s/%s.asked\n%s' % (self.root, name, text))

    def run_script(self, *words):
        environment = dict(os.environ, PATH=os.path.join(self.root, "bin") + ":" + os.environ["PATH"])
        environment.pop("VIEW_SERVO_BUILD_DIR", None)
        result = subprocess.run([os.path.join(self.root, "scripts", "fuzz")] + list(words), stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, universal_newlines=True, env=environment, timeout=60)
        return result.returncode, result.stdout

    def asked(self, name):
        path = os.path.join(self.root, name + ".asked")
        if not os.path.exists(path):
            return None
        with open(path) as file:
            return file.read().split("\n")

    def limits(self, name):
        return [word for word in self.asked(name) if word.startswith(("-runs=", "-max_total_time="))]

    def test_runs_each_target_for_a_minute(self):
        self.assertEqual(self.run_script(), (0, "".join("%s: 1234 executions, nothing found\n" % name for name in TARGETS)))
        for name in TARGETS:
            self.assertEqual(self.limits(name), ["-max_total_time=60"])
            self.assertIn(os.path.join(self.root, "fuzz", "seeds", name), self.asked(name))
        self.assertIn("fuzz_images", self.asked("build/fuzz"))

    def test_limits(self):
        for words, limits in ((["segments", "5"], ["-max_total_time=5"]),
                              (["segments", "--executions", "1000"], ["-runs=1000"]),
                              (["--executions", "1000", "segments"], ["-runs=1000"]),
                              (["segments", "5", "--executions", "1000"], ["-runs=1000", "-max_total_time=5"])):
            self.assertEqual(self.run_script(*words)[0], 0, words)
            self.assertEqual(self.limits("segments"), limits, words)
            self.assertIsNone(self.asked("images"), words)

    def test_names_the_input_that_broke_a_target(self):
        self.target("images", "echo 'Test unit written to %s/crash-1' >&2; exit 77" % self.root)
        status, out = self.run_script("--executions", "10")
        self.assertEqual(status, 1)
        self.assertIn("images: broken by %s/crash-1; the whole log is " % self.root, out)
        self.assertIn("segments: 1234 executions, nothing found", out)

    def test_refuses_what_it_does_not_know(self):
        for words, complaint in ((["nothing"], "unknown target 'nothing'; there are: all images segments"),
                                 (["images", "soon"], "'soon' is no number of seconds"),
                                 (["images", "0"], "'0' is no number of seconds"),
                                 (["images", "--executions"], "'' is no number of executions"),
                                 (["images", "--executions", "1e6"], "'1e6' is no number of executions"),
                                 (["--runs", "5"], "unknown option '--runs'; there is --executions N"),
                                 (["images", "5", "6"], "'6' is one word too many")):
            status, out = self.run_script(*words)
            self.assertEqual(status, 2, words)
            self.assertIn("fuzz: " + complaint, out)
            self.assertEqual(out.count("\n"), 1, out)
            self.assertIsNone(self.asked("build/fuzz"), "it was built all the same")


if __name__ == "__main__":
    unittest.main()
