#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
Homing, arm and route goals without end in both simulators, a third of the time each: soak.py [--hours H] [--seed N]
[--out DIR] [--short]. Memory, descriptors and threads of each node and the latency of each driver are sampled; DIR/soak.csv
has a row a sample. A line is fitted to each. Exit status: 0 nothing grows and every goal arrives, 1 something grows or a
goal does not arrive, 2 bad input.
"""
import argparse
import csv
import os
import random
import signal
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "docs"), os.path.join(os.path.dirname(HERE), "rostest")]

ROBOTS = ("homing", "servo_25d", "route_follower")
COLUMNS = ("robot", "node", "hours", "memory", "descriptors", "threads", "latency", "goals", "arrived")
SHORT = 0.04         # [h]
TIMEOUT = 60.0       # of a goal [s]
WARM_UP = 0.25       # share of the time in which caches and stores still fill
BLOCKS = 8           # whose means the line is fitted to: samples that follow each other are not independent
SIGNIFICANT = 3.0    # a slope of so many standard errors
# What a growth over the whole time has to exceed as well: less is not told from the steps in which such a thing grows.
LEAST = {"memory": 2.0, "descriptors": 1.0, "threads": 1.0, "latency": 5.0}
UNITS = {"memory": "MB", "descriptors": "", "threads": "", "latency": "ms"}


# ------------------------------------------------------------------------------------------------------------- samples


def state_of(pid):
    """Resident memory [MB], open descriptors, threads."""
    with open("/proc/%d/status" % pid) as file:
        lines = dict(line.split(":", 1) for line in file if ":" in line)
    return int(lines["VmRSS"].split()[0]) / 1024.0, len(os.listdir("/proc/%d/fd" % pid)), int(lines["Threads"])


class Latency:
    """The mean time from an image to the command that follows it [ms], of what a driver said since it was asked last."""

    def __init__(self, driver):
        import rospy
        from diagnostic_msgs.msg import DiagnosticArray
        self._driver, self._values = driver, []
        self._subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, self._take, queue_size=100)

    def _take(self, message):
        for status in message.status:
            if self._driver in status.name:
                for pair in status.values:
                    if pair.key == "Image to command, mean [ms]" and pair.value.lower().lstrip("-") not in ("nan", ""):
                        self._values.append(float(pair.value))

    def take(self):
        values, self._values = self._values, []
        return sum(values) / len(values) if values else None


def work(options):
    """One robot's goals, in a process of its own: rospy knows one master only."""
    import robot_graph
    import robots
    from actionlib import CommState
    robot = robots.ROBOTS[options.worker]
    robot.rate = min(robot.rate, 8)
    draw = random.Random("%s %d" % (robot.name, options.seed))
    graph = robot_graph.RobotGraph(robot)
    latency = Latency(robot.driver)
    begin = time.monotonic()
    period = max(2.0, options.hours * 3600.0 / 400.0)  # of samples [s]
    due = begin + period
    goals = arrived = 0
    with open(options.rows, "w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)

        def sample():
            delay = latency.take()
            for node in (*robot.nodes, robot.simulator):
                memory, descriptors, threads = state_of(graph.processes[node].pid)
                table.writerow({"robot": robot.name, "node": node, "hours": "%.5f" % ((time.monotonic() - begin) / 3600.0),
                                "memory": "%.3f" % memory, "descriptors": descriptors, "threads": threads,
                                "latency": "%.2f" % delay if node == robot.driver and delay is not None else "",
                                "goals": goals, "arrived": arrived})
            file.flush()

        try:
            while time.monotonic() < begin + 3600.0 * options.hours:
                graph.place(robot.start_pose(draw))
                goal = graph.client.send_goal(robot.goal(TIMEOUT))
                while goal.get_comm_state() != CommState.DONE:
                    time.sleep(0.1)
                    if time.monotonic() > due:
                        due += period
                        sample()
                result = goal.get_result()
                goals += 1
                arrived += int(bool(result and result.success))
                if not result or not result.success:
                    print("soak: %s, goal %d: %s" % (robot.name, goals, result.message if result else "forgotten by its driver"),
                          flush=True)
                for heard in (graph.commands, graph.statuses, graph.truths):
                    heard.clear()
            sample()
        finally:
            graph.stop()
    return 0 if goals == arrived else 1


# ------------------------------------------------------------------------------------------------------------ judgement


def fit(hours, values):
    """Slope and its standard error [1/h] of a line through the means of blocks; None: too few samples."""
    import numpy
    if len(hours) < 2 * BLOCKS:
        return None
    x = numpy.array([block.mean() for block in numpy.array_split(numpy.array(hours), BLOCKS)])
    y = numpy.array([block.mean() for block in numpy.array_split(numpy.array(values), BLOCKS)])
    spread = ((x - x.mean()) ** 2).sum()
    slope = ((x - x.mean()) * (y - y.mean())).sum() / spread
    rest = y - y.mean() - slope * (x - x.mean())
    return slope, (float(rest @ rest) / (BLOCKS - 2) / spread) ** 0.5


def judge(rows):
    """@return a line for each node and quantity: (robot, node, quantity, mean, slope, error, grows)."""
    result = []
    for robot, node in dict.fromkeys((row["robot"], row["node"]) for row in rows):
        own = [row for row in rows if (row["robot"], row["node"]) == (robot, node)]
        last = float(own[-1]["hours"])
        for quantity, least in LEAST.items():
            chosen = [row for row in own if row[quantity] and float(row["hours"]) >= WARM_UP * last]
            hours, values = ([float(row[column]) for row in chosen] for column in ("hours", quantity))
            line = fit(hours, values)
            if line is None:
                continue
            slope, error = line
            grows = slope > SIGNIFICANT * error and slope * (1.0 - WARM_UP) * last > least
            result.append((robot, node, quantity, sum(values) / len(values), slope, error, grows))
    return result


def positive(text):
    value = float(text)
    if not 0.0 < value < 1e5:
        raise argparse.ArgumentTypeError("%s is not a time in hours" % text)
    return value


def main():
    parser = argparse.ArgumentParser(prog="soak", description=__doc__.strip().splitlines()[0])
    parser.add_argument("--hours", type=positive)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", default=".", help="folder for soak.csv")
    parser.add_argument("--short", action="store_true", help="144 s")
    parser.add_argument("--worker", choices=ROBOTS, help=argparse.SUPPRESS)
    parser.add_argument("--rows", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.hours = options.hours or (SHORT if options.short else 1.0)
    if options.worker:
        return work(options)
    os.makedirs(options.out, exist_ok=True)
    path = os.path.join(options.out, "soak.csv")
    parts = {robot: path + "." + robot for robot in ROBOTS}
    bad = False
    for robot, part in parts.items():  # one after the other: three cameras at a time are too much for two processors
        if subprocess.call([sys.executable, os.path.join(HERE, "soak.py"), "--worker", robot, "--rows", part, "--hours",
                            "%g" % (options.hours / len(parts)), "--seed", str(options.seed)]) != 0:
            print("soak: %s: not all goals arrived, or it was cut short" % robot, file=sys.stderr)
            bad = True
    rows = []
    with open(path, "w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        for part in parts.values():
            if os.path.exists(part):
                with open(part, newline="") as own:
                    rows += list(csv.DictReader(own, COLUMNS))
                os.remove(part)
        table.writerows(rows)
    for robot in ROBOTS:
        own = [row for row in rows if row["robot"] == robot]
        if own:
            print("%s: %s goals in %s h, %s arrived" % (robot, own[-1]["goals"], own[-1]["hours"], own[-1]["arrived"]))
    lines = judge(rows)
    print("\n%-14s %-18s %-11s %10s  growth in an hour" % ("robot", "node", "", "mean"))
    for robot, node, quantity, mean, slope, error, grows in lines:
        print("%-14s %-18s %-11s %10.2f  %+.3f +- %.3f %s%s" % (
            robot, node, quantity, mean, slope, error, UNITS[quantity], "  GROWS" if grows else ""))
    print(path)
    return 1 if bad or not lines or any(line[-1] for line in lines) else 0


if __name__ == "__main__":
    # Ctrl-C ends it as it does elsewhere also where a shell has started it in the background.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(main())
