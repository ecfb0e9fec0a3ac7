#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""A few faults of the campaign, and whether it and the soak would notice what they look for."""
import os
import sys
import types
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "docs"), os.path.join(os.path.dirname(HERE), "rostest")]
import faults  # noqa: E402
import play  # noqa: E402
import robot_graph  # noqa: E402
import robots  # noqa: E402
import soak  # noqa: E402

SEED = 1


def fault_named(driver, name):
    return next(fault for fault in faults.FAULTS[driver] if fault.name == name)


class Played(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.graph = robot_graph.RobotGraph(robots.ROBOTS["homing"])

    @classmethod
    def tearDownClass(cls):
        cls.graph.stop()

    def play(self, name, form):
        self.graph.restore()
        for attempt in range(3):
            run = play.Run(self.graph, fault_named("homing", name), form, attempt, SEED)
            row = run.play()
            if row:
                self.assertEqual(row["verdict"], "good", "\n".join([str(row), *run.trace(), self.graph.graph.log()]))
                return row
        return self.fail("the goal ended before the fault")

    def test_odometry_stops_and_comes_back(self):
        row = self.play("odometry: stops", "passes")
        self.assertIn("no odometry", row["standing"])
        self.assertEqual(row["success"], 1, row)

    def test_images_stop_for_good(self):
        row = self.play("image: stops", "stays")
        self.assertIn("no image", row["reason"])

    def test_driver_is_killed(self):
        self.assertEqual(self.play("killed: homing", "passes")["ended"], "dead")


class Judged(unittest.TestCase):
    """Runs that were bad are told from good ones."""

    def run_of(self, name="image: stops", **graph):
        nothing = types.SimpleNamespace(robot=robots.ROBOTS["homing"], statuses=[], truths=[], processes={}, off=lambda: (0.0, 0.0),
                                        client=None, last_motion=lambda begin, end: None)
        for key, value in graph.items():
            setattr(nothing, key, value)
        run = play.Run(nothing, fault_named("homing", name), "passes", 0, SEED)
        run.start_off, run.result = 0.5, types.SimpleNamespace(success=True, message="arrived")
        return run

    def problems(self, run, *judgements):
        for judgement in judgements:
            judgement(run)
        return "; ".join(run.problems)

    def test_a_robot_that_does_not_stop(self):
        def judge(run):
            run.judge_stop(10.0, 12.0)
        self.assertEqual(self.problems(self.run_of(last_motion=lambda begin, end: begin + 0.9 * faults.LIMIT), judge), "")
        self.assertIn("moves", self.problems(self.run_of(last_motion=lambda begin, end: begin + 1.1 * faults.BUSY_LIMIT), judge))

    def test_ends(self):
        run = self.run_of()
        self.assertEqual(self.problems(run, play.Run.judge_end), "")
        run.result.message = ""
        self.assertIn("without a reason", self.problems(run, play.Run.judge_end))
        run = self.run_of()
        run.result = None
        self.assertIn("does not end", self.problems(run, play.Run.judge_end))
        run = self.run_of(processes={"point_matcher": types.SimpleNamespace(poll=lambda: -11, returncode=-11)})
        self.assertIn("point_matcher has ended by itself", self.problems(run, play.Run.judge_end))

    def test_places(self):
        def judge(run):
            run.row["success"] = 1
            run.judge_place([])
        self.assertEqual(self.problems(self.run_of(), judge), "")
        self.assertIn("wrong arrival", self.problems(self.run_of(off=lambda: (0.04, 0.0)), judge))
        self.assertIn("farther", self.problems(self.run_of(truths=[(1.0, 0.9, 0.0)]), judge))

    def test_growth(self):
        def rows(growth):
            return [{"robot": "homing", "node": "homing", "hours": "%g" % (0.01 * i), "memory": "%g" % (100 + i % 3 + growth * i),
                     "descriptors": "20", "threads": "9", "latency": ""} for i in range(100)]
        self.assertEqual([line[2] for line in soak.judge(rows(0.1)) if line[-1]], ["memory"])
        self.assertEqual([line[2] for line in soak.judge(rows(0.0)) if line[-1]], [])


if __name__ == "__main__":
    unittest.main(verbosity=2, warnings="ignore")
