#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""Names of packages: each dependency of package.xml is a key that rosdep knows for Noetic on Ubuntu 20.04, and the machine's
archive has each package that scripts/install_dependencies names. One that is unknown ends the installation of all."""
import os
import shutil
import subprocess
import unittest
import xml.etree.ElementTree as tree

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))


class PackageKeys(unittest.TestCase):
    def test_rosdep_knows_each(self):
        with open(os.path.join(ROOT, "test", "docs", "rosdep_keys_noetic.txt")) as file:
            known = {line.split()[0] for line in file if line.strip() and not line.startswith("#")}
        package = tree.parse(os.path.join(ROOT, "package.xml")).getroot()
        wanted = {element.text for element in package if element.tag.endswith("depend")}
        self.assertGreater(len(wanted), 20)
        self.assertEqual(wanted - known, set(), "are no keys of rosdep for Noetic, as far as the list knows")

    @unittest.skipUnless(shutil.which("apt-cache"), "there is no apt")
    def test_the_archive_has_each(self):
        def run(*command):
            return subprocess.run(command, stdout=subprocess.PIPE, universal_newlines=True, check=True).stdout

        if "http" not in run("apt-cache", "policy"):
            self.skipTest("apt has no lists of packages")
        script = os.path.join(ROOT, "scripts", "install_dependencies")
        named = run(script, "--list", "demo", "plot", "rviz", "test").split()
        self.assertGreater(len(named), 60)
        offered, package = set(), None
        for line in run("env", "LC_ALL=C", "apt-cache", "policy", *named).splitlines():
            if not line.startswith(" "):
                package = line.rstrip(":")
            elif line.startswith("  Candidate: ") and not line.endswith("(none)"):
                offered.add(package)
        self.assertEqual(set(named) - offered, set(), "are not in the archive of this release")


if __name__ == "__main__":
    unittest.main()
