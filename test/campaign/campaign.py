#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
Plays each fault at random moments of simulated runs: campaign.py [--runs N] [--seed N] [--out DIR] [--driver NAME]
[--fault TEXT ...] [--list]. Writes DIR/campaign.csv, a row a run, beside it what happened in runs that were bad or did not
arrive, and prints a table. Exit status: 0 all verdicts are good, 1 some are not, 2 bad input.
"""
import argparse
import csv
import os
import signal
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "docs"), os.path.join(os.path.dirname(HERE), "rostest")]

ATTEMPTS = 3  # at a run whose goal ends before the fault begins
DRIVERS = ["homing", "servo_25d", "route_follower"]
KINDS = ("robot", "clock", "disk", "master")


def chosen_faults(driver, words, kind=None):
    import faults
    return [fault for fault in faults.FAULTS[driver]
            if (kind is None or fault.needs == kind) and (not words or any(word in fault.name for word in words))]


# ------------------------------------------------------------------------------------------------------ a graph's runs


def forms_of(fault, runs, first):
    """The forms of a fault's runs in turn: it passes, or stays until the goal ends."""
    forms = [form for form, has in (("passes", fault.passes), ("stays", fault.stays)) if has]
    return [forms[(number + first) % len(forms)] for number in range(runs)]


def play_all(options, kind, writer):
    import play
    import robot_graph
    import robots
    robot = robots.ROBOTS[options.driver]

    def make():
        return robot_graph.RobotGraph(robot, clock=kind == "clock", small_disk=kind == "disk")

    graph = make()
    if kind == "disk" and not graph.small_disk:
        print("campaign: a disk that can be full needs the right to mount one: left out", file=sys.stderr)
        graph.stop()
        return
    try:
        for order, fault in enumerate(chosen_faults(options.driver, options.fault, kind)):
            for number, form in enumerate(forms_of(fault, options.runs, order)):
                for attempt in range(ATTEMPTS):
                    begin = time.monotonic()
                    run = play.Run(graph, fault, form, number, options.seed + 1000 * attempt)
                    row = run.play()
                    if kind == "master":
                        break
                    graph.restore()
                    if row:
                        break
                if row:
                    writer(row, run)
                    print("%-14s %-34s %-6s %5.1f s  zero %s  %s%s" % (
                        options.driver, fault.name, form, time.monotonic() - begin, row["zero"], row["verdict"],
                        ": " + row["why"] if row["why"] else ""), flush=True)
                if kind == "master":
                    return  # this process and the nodes are unknown to the new master
    finally:
        graph.stop()


def work(options):
    """One kind of graph, in a process of its own: rospy knows one master only."""
    import play
    with open(options.rows, "a", newline="") as file:
        table = csv.DictWriter(file, play.COLUMNS)

        def write(row, run):
            table.writerow(row)
            file.flush()
            if row["verdict"] != "good" or (row["form"] == "passes" and not row["success"]):
                with open(options.rows + ".traces", "a") as traces:
                    print(*("%s: %s" % pair for pair in row.items()), *run.trace(), "", sep="\n", file=traces)

        play_all(options, options.worker, write)


# ---------------------------------------------------------------------------------------------------------------- all


def run_worker(options, driver, kind, rows, seed):
    command = [sys.executable, os.path.join(HERE, "campaign.py"), "--worker", kind, "--rows", rows, "--driver", driver, "--runs",
               str(options.runs), "--seed", str(seed)]
    for word in options.fault:
        command += ["--fault", word]
    return subprocess.call(command)


def summary(rows):
    """A line for each fault and driver."""
    lines = {}
    for row in rows:
        lines.setdefault((row["driver"], row["fault"]), []).append(row)
    table = []
    for (driver, fault), group in lines.items():
        wrong = sum("wrong arrival" in row["why"] for row in group)
        far = sum("farther" in row["why"] for row in group)
        bad = sum(row["verdict"] != "good" for row in group)
        arrived = sum(int(row["success"]) for row in group)
        table.append({"driver": driver, "fault": fault, "expected": group[0]["expected"], "runs": len(group), "arrived": arrived,
                      "zero": max(float(row["zero"]) for row in group), "wrong": wrong, "far": far,
                      "interrupted": max([float(row["interrupted"]) for row in group if row["interrupted"]] + [0.0]),
                      "reasons": sorted({row["reason"] for row in group if row["reason"] and not int(row["success"])}),
                      "verdict": "good" if bad == 0 else "bad in %d" % bad})
    return table


def print_summary(rows):
    print("\n%-14s %-34s %-8s %4s %7s %7s %5s %4s %6s  %s" % (
        "driver", "fault", "expected", "runs", "arrived", "zero[s]", "wrong", "far", "SIGINT", "verdict; other ends"))
    for line in summary(rows):
        zero = "%7.3f" % line["zero"] if line["expected"] == "stops" else "      -"
        print("%-14s %-34s %-8s %4d %7d %s %5d %4d %6.2f  %s; %s" % (
            line["driver"], line["fault"], line["expected"], line["runs"], line["arrived"], zero, line["wrong"], line["far"],
            line["interrupted"], line["verdict"], " | ".join(line["reasons"])))
    stopping = [float(row["zero"]) for row in rows if row["expected"] == "stops" and "processors" not in row["fault"]]
    print("\n%d runs, %d bad; wrong arrivals: %d, too far: %d, without a reason: %d; worst time to zero twist %.3f s" % (
        len(rows), sum(row["verdict"] != "good" for row in rows), sum("wrong arrival" in row["why"] for row in rows),
        sum("farther" in row["why"] for row in rows), sum("reason" in row["why"] for row in rows), max(stopping + [0.0])))


def positive(text):
    if int(text) < 1:
        raise argparse.ArgumentTypeError("%s is not a number of runs" % text)
    return int(text)


def main():
    parser = argparse.ArgumentParser(prog="campaign", description=__doc__.strip().splitlines()[0])
    parser.add_argument("--runs", type=positive, default=1, help="of each fault with each driver")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", default=".", help="folder for campaign.csv")
    parser.add_argument("--driver", choices=DRIVERS, help="this one only")
    parser.add_argument("--fault", action="append", default=[], metavar="TEXT", help="only faults whose names have this in them")
    parser.add_argument("--list", action="store_true", help="names the faults")
    parser.add_argument("--worker", choices=KINDS, help=argparse.SUPPRESS)
    parser.add_argument("--rows", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        return work(options)
    drivers = [options.driver] if options.driver else DRIVERS
    chosen = {driver: chosen_faults(driver, options.fault) for driver in drivers}
    if options.list:
        for driver in drivers:
            for fault in chosen[driver]:
                print("%-14s %-34s %s" % (driver, fault.name, fault.expected))
        return 0
    if not any(chosen.values()):
        parser.error("no fault's name has this in it; see --list")
    import play
    os.makedirs(options.out, exist_ok=True)
    path = os.path.join(options.out, "campaign.csv")
    with open(path, "w", newline="") as file:
        csv.DictWriter(file, play.COLUMNS).writeheader()
    if os.path.exists(path + ".traces"):
        os.remove(path + ".traces")
    failures = []
    for driver in drivers:
        for kind in KINDS:
            if not chosen_faults(driver, options.fault, kind):
                continue
            for repetition in range(options.runs if kind == "master" else 1):
                if run_worker(options, driver, kind, path, options.seed + repetition) != 0:
                    failures.append("%s, %s" % (driver, kind))
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    print_summary(rows)
    print(path)
    for failure in failures:
        print("campaign: the runs of %s were cut short" % failure, file=sys.stderr)
    return 0 if rows and not failures and all(row["verdict"] == "good" for row in rows) else 1


if __name__ == "__main__":
    # Ctrl-C ends it as it does elsewhere also where a shell has started it in the background.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(main())
