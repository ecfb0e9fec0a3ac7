#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""README's section on licences names as under the GPL what loads ViSP, directly or through others, and nothing else:
licence_test.py DEVEL, the devel space, whose libraries and programs are looked at."""
import glob
import os
import re
import subprocess
import sys
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
DEVEL = ""


def loads_visp(file):
    result = subprocess.run(["ldd", file], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
    return "libvisp_" in result.stdout


def built():
    """The names of libraries and programs in the devel space, tests left out, and whether they load ViSP."""
    found = {}
    for file in glob.glob(os.path.join(DEVEL, "lib", "*.so")) + glob.glob(os.path.join(DEVEL, "lib", "view_servo", "*")):
        name = re.sub(r"^lib|\.so$", "", os.path.basename(file))
        if os.path.isfile(file) and not name.endswith("_test"):
            found[name] = loads_visp(file)
    return found


class Licence(unittest.TestCase):
    def test_names_what_loads_visp(self):
        with open(os.path.join(ROOT, "README.md")) as readme:
            section = re.search(r"## Licence\n(.*?)\n## ", readme.read(), re.DOTALL).group(1)
        under_gpl, free = section.split("Everything else")
        named = set(re.findall(r"`(\w+)`", under_gpl))
        free = set(re.findall(r"`(\w+)`", free))
        found = built()
        self.assertIn("view_servo_core", found, "the devel space %s holds no library" % DEVEL)
        self.assertTrue(found.get("view_servo_servo", True), "ldd does not show that view_servo_servo loads ViSP")
        for name, loads in sorted(found.items()):
            if loads:
                self.assertIn(name, named, "%s loads ViSP, and README does not say so" % name)
            else:
                self.assertNotIn(name, named - {"view_servo_trials"}, "%s does without ViSP, and README denies it" % name)
        self.assertFalse(named & free)


if __name__ == "__main__":
    DEVEL = sys.argv.pop(1)
    unittest.main()
