#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""Each dependency of package.xml is a key that rosdep knows for Noetic on Ubuntu 20.04: one that it does not know ends
`rosdep install` before anything is installed."""
import os
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


if __name__ == "__main__":
    unittest.main()
