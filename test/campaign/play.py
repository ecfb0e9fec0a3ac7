# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""One run: a goal, a fault at a random moment of it, what came of it, and whether that was good."""
import os
import random
import time

import faults
import relay
import robot_graph
from graph import SLOWDOWN

from actionlib import CommState

TIMEOUT = 20.0 * SLOWDOWN  # of a goal [s]
PATIENCE = 8.0 * SLOWDOWN  # how much longer than its goal's timeout a driver may take to say how it ended [s]
REST = 0.5        # after the end, in which nothing may move [s]
EARLY = 0.15      # share of the faults that begin before the robot may have moved

COLUMNS = ("driver", "fault", "form", "run", "seed", "moment", "expected", "limit", "load", "zero", "ended", "success", "reason",
           "standing", "off", "turn", "farthest", "interrupted", "verdict", "why")


class Run:
    def __init__(self, graph, fault, form, number, seed):
        self.graph, self.fault, self.form = graph, fault, form
        self.draw = random.Random("%s %s %s %d %d" % (graph.robot.name, fault.name, form, number, seed))
        self.row = dict.fromkeys(COLUMNS, "")
        self.row.update(driver=graph.robot.name, fault=fault.name, form=form, run=number, seed=seed, expected=fault.expected,
                        limit=fault.limit)
        self.problems = []
        self.goal = None       # its handle, when it has been sent
        self.result = None     # of the goal
        self.start_off = 0.0   # how far from its goal the robot begins [m]
        self.begin = 0.0       # when the fault does [s]

    def cancel(self):
        if self.goal is not None and not self.ended():
            self.goal.cancel()
            self.wait(PATIENCE, self.ended)

    def ended(self):
        return self.goal is None or self.goal.get_comm_state() in (CommState.DONE, CommState.LOST)

    def wait(self, seconds, holds=lambda: False):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if holds():
                return True
            time.sleep(0.01)
        return holds()

    def wait_for_the_moment(self):
        """@return whether the goal still went on then."""
        graph = self.graph
        start = graph.off()[0]
        if self.draw.random() < EARLY:
            wait = self.draw.uniform(0.0, 0.7)
            self.row["moment"] = "%.2f s" % wait
            self.wait(wait)
        else:
            share = self.draw.uniform(0.06, 0.97)
            self.row["moment"] = "%.0f %%" % (100.0 * (1.0 - share))
            self.wait(TIMEOUT, lambda: self.ended() or graph.off()[0] < share * start)
        return not self.ended()

    def play(self):
        """@return the row of the table; None: the goal had ended before the fault could begin."""
        graph = self.graph
        graph.place(graph.robot.start_pose(self.draw))
        for heard in (graph.commands, graph.statuses, graph.truths):
            heard.clear()
        self.start_off = graph.off()[0]
        self.goal = graph.client.send_goal(graph.robot.goal(TIMEOUT))
        if not self.wait_for_the_moment():
            return None
        truths_before = list(graph.truths)
        begin = self.begin = self.fault.begin(graph, self.draw)
        try:
            if self.form == "passes":
                self.wait(self.fault.duration)
            else:
                self.wait(TIMEOUT + PATIENCE, self.is_over)
            end = relay.now()
            self.judge_stop(begin, end)
            if self.form == "stays" and self.fault.needs != "master":
                self.judge_interrupt()
        finally:
            self.fault.end(graph)
        if self.form == "passes":
            self.wait(TIMEOUT + PATIENCE, self.is_over)
        self.judge_end()
        self.judge_place(truths_before)
        self.row["verdict"] = "bad" if self.problems else "good"
        self.row["why"] = "; ".join(self.problems)
        return self.row

    def is_over(self):
        return self.ended() or self.kills_driver()

    def kills_driver(self):
        return isinstance(self.fault, faults.Killed) and self.graph.robot.driver in self.fault.nodes

    def trace(self):
        """What happened, in lines: changes of the status, of motion, and how far off the robot was, by the time after the fault."""
        graph = self.graph
        lines = [(moment, "%d %s" % (status.state, status.reason)) for moment, status in list(graph.statuses)]
        lines += [(moment, "moves" if any(twist) else "stands") for moment, twist in list(graph.commands)]
        lines += [(moment, "%.3f m, %.3f rad off" % (off, turn)) for moment, off, turn in list(graph.truths)]
        told = {}
        for moment, text in sorted(lines):
            kind = text in ("moves", "stands"), text.endswith("off")
            if told.get(kind) != text:
                told[kind] = text
                yield "%8.3f  %s" % (moment - self.begin, text)

    # ---------------------------------------------------------------------------------------------------------- judgement

    def judge_stop(self, begin, end):
        time.sleep(0.1)  # what was sent before the end has to come
        last = self.graph.last_motion(begin, end)
        zero = 0.0 if last is None else last - begin
        stopping = self.fault.expected == faults.STOPS
        self.row["zero"] = "%.3f" % zero
        load = os.getloadavg()[0]  # within the last minute
        if load > 2.0 * os.cpu_count():
            self.row["limit"] = max(self.fault.limit, faults.BUSY_LIMIT)
        self.row["load"] = "%.1f" % load
        if stopping and zero > self.row["limit"]:
            self.problems.append("moves %.2f s after the fault" % zero)
        reasons = [status.reason for moment, status in list(self.graph.statuses) if begin <= moment <= end]
        self.row["standing"] = reasons[-1] if reasons else ""

    def judge_interrupt(self):
        """Nodes have to end although the fault lasts; those that it concerns itself do not run."""
        self.wait(TIMEOUT + PATIENCE, self.is_over)
        self.result = self.take_result()
        names = [name for name in self.graph.robot.nodes if name not in self.fault.nodes]
        seconds, name, status = self.graph.interrupt(names)
        self.row["interrupted"] = "%.2f" % seconds
        if seconds > robot_graph.ENDS_WITHIN:
            self.problems.append("%s ends %.1f s after SIGINT" % (name, seconds))
        if status != 0:
            self.problems.append("%s ends with status %d after SIGINT" % (name, status))

    def take_result(self):
        """None: there is none."""
        return self.goal.get_result() if self.goal is not None and self.ended() else None

    def judge_end(self):
        result = self.result or self.take_result()
        dead = self.kills_driver()
        self.row["ended"] = "dead" if dead else "yes" if result is not None else "no"
        self.row["success"] = int(bool(result and result.success))
        self.row["reason"] = result.message if result is not None else ""
        if result is None and not dead:
            self.problems.append("the goal does not end")
            self.cancel()
        if result is not None and not result.message:
            self.problems.append("it ends without a reason")
        if any(not status.reason for _, status in list(self.graph.statuses)):
            self.problems.append("a status has no reason")
        if self.fault.expected == faults.SURVIVES and not (result and result.success):
            self.problems.append("it does not arrive")
        if result is not None and result.message.count("\n"):
            self.problems.append("a reason of several lines")
        for name, process in self.graph.processes.items():
            if process.poll() not in (None, 0) and name not in self.fault.nodes and not self.row["interrupted"]:
                self.problems.append("%s has ended by itself with status %d" % (name, process.returncode))

    def judge_place(self, truths_before):
        time.sleep(REST)
        graph = self.graph
        self.row["off"], self.row["turn"] = ("%.4f" % value for value in graph.off())
        moved = self.fault.moves_robot
        begin = self.start_off if not moved else max(self.start_off, max((off for _, off, _ in graph.truths[len(truths_before):]
                                                                          [:3]), default=0.0))
        farthest = max((off for _, off, _ in list(graph.truths)), default=begin) - begin
        self.row["farthest"] = "%.3f" % farthest
        far = farthest > graph.robot.allowance
        if far:
            self.problems.append("%.2f m farther from its view than when it began" % farthest)
        off, turn = graph.off()
        most_off, most_turn = graph.robot.arrived
        if self.row["success"] and (off > most_off or turn > most_turn):
            self.problems.append("wrong arrival: %.1f mm and %.2f degrees off" % (1e3 * off, 57.2958 * turn))
