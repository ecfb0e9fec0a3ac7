# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""The faults: what is done to a simulated robot's inputs and nodes, and what its driver has to do then."""
import functools
import os
import signal
import subprocess
import time
import xmlrpc.client

import graph
import relay

STOPS = "stops"        # no command that moves later than the limit after the fault's begin, as long as the fault lasts
BOUNDED = "bounded"    # may stand or go on, as far as documented: it never arrives wrongly nor gets too far
SURVIVES = "survives"  # goes on, and arrives

LIMIT = 0.3 * graph.SLOWDOWN  # until zero twist [s]
BUSY_LIMIT = 0.5 * graph.SLOWDOWN  # the same with all processors taken by others [s]
JOINT_LIMIT = 1.0 + LIMIT  # joint states may be missing for ~joint_timeout, 1 s, before that counts
MATCH_LIMIT = 1.5 + LIMIT  # a view that is not seen any more is noticed by matches: three periods of those by lines, 2 Hz, more
MANY = 10000        # messages at once
MANY_IMAGES = 300   # the same of images, 92 MB


class Fault:
    """
    `needs` names the kind of graph that it is played in: `robot`, `clock` (nodes go by a clock that is published), `disk` (a
    small one, which can be full) or `master` (one that is not used any more afterwards). `begin` and `end` take the graph
    and a source of random numbers; `begin` returns when the fault begins [s].
    """
    needs = "robot"
    duration = 2.5  # of its passing form [s]
    stays = True    # whether there is a form that lasts until the goal ends
    passes = True   # whether there is one that ends before, so that the robot can go on
    nodes = ()      # that do not run, or not freely, while it lasts
    moves_robot = False  # whether it puts the robot elsewhere

    def __init__(self, name, expected, limit=LIMIT):
        self.name, self.expected, self.limit = name, expected, limit

    def begin(self, robot_graph, draw):
        raise NotImplementedError

    def end(self, robot_graph):
        pass


class OfInput(Fault):
    def __init__(self, channel, what, make, expected, limit=LIMIT, duration=2.5):
        super().__init__("%s: %s" % (channel, what), expected, limit)
        self._channel, self._make, self.duration = channel, make, duration

    def begin(self, robot_graph, draw):
        return robot_graph.channels[self._channel].begin(self._make())

    def end(self, robot_graph):
        robot_graph.channels[self._channel].end()


class OfPicture(Fault):
    """Changes the picture only. `change` may take the picture of the view, too."""

    def __init__(self, name, change, expected, with_view=False):
        super().__init__(name, expected)
        self._change, self._with_view = change, with_view

    def begin(self, robot_graph, draw):
        change = functools.partial(self._change, view=robot_graph.view_picture) if self._with_view else self._change
        return robot_graph.channels["image"].begin(relay.Change(change))

    def end(self, robot_graph):
        robot_graph.channels["image"].end()


class LightOff(Fault):
    def begin(self, robot_graph, draw):
        robot_graph.light(1e-3)
        return relay.now() + 1.0 / robot_graph.robot.rate  # the picture that is being taken is of before

    def end(self, robot_graph):
        robot_graph.light(1.0)


class Carried(Fault):
    """The robot is put elsewhere. Odometry does not notice, as if all that it sees had been moved."""
    moves_robot = True


    def begin(self, robot_graph, draw):
        robot_graph.call_place(robot_graph.robot.carried(robot_graph.truth, draw))
        return relay.now()


class Turned(Fault):
    """The base is turned round, so that the camera looks at another part of the room."""
    duration = 2.0

    def begin(self, robot_graph, draw):
        robot_graph.call_place(robot_graph.robot.turned(robot_graph.truth))
        return relay.now() + 1.0 / robot_graph.robot.rate

    def end(self, robot_graph):
        robot_graph.call_place(robot_graph.robot.turned(robot_graph.truth, -3.0))


class Killed(Fault):
    def __init__(self, nodes, expected, limit=LIMIT, stays=True, passes=True):
        super().__init__("killed: %s" % ", ".join(nodes), expected, limit)
        self.nodes, self.stays, self.passes = nodes, stays, passes

    def begin(self, robot_graph, draw):
        for node in self.nodes:
            robot_graph.processes[node].kill()
        moment = relay.now()
        for node in self.nodes:
            robot_graph.processes[node].wait()
        return moment

    def end(self, robot_graph):
        for node in self.nodes:
            if robot_graph.processes[node].poll() is not None:
                robot_graph.start(node)


class Stopped(Fault):
    """By SIGSTOP, and continued."""
    duration = 2.0

    def __init__(self, nodes, expected, limit=LIMIT, stays=True):
        super().__init__("stopped: %s" % ", ".join(nodes), expected, limit)
        self.nodes, self.stays = nodes, stays

    def begin(self, robot_graph, draw):
        for node in self.nodes:
            robot_graph.processes[node].send_signal(signal.SIGSTOP)
        return relay.now()

    def end(self, robot_graph):
        for node in self.nodes:
            robot_graph.processes[node].send_signal(signal.SIGCONT)


class Busy(Fault):
    """Twice as many processes as there are processors calculate all the time; an input may stop besides."""

    def __init__(self, stopped_input, expected):
        super().__init__("processors taken" + (", %s: stops" % stopped_input if stopped_input else ""), expected, BUSY_LIMIT)
        self._input, self._processes = stopped_input, []

    def begin(self, robot_graph, draw):
        self._processes = [subprocess.Popen(["sh", "-c", "while :; do :; done"], preexec_fn=graph.end_with_parent)
                           for _ in range(2 * os.cpu_count())]
        for process in self._processes:
            robot_graph.usual_priority(process)
        if not self._input:
            return relay.now()
        time.sleep(0.5)
        return robot_graph.channels[self._input].begin(relay.Stop())

    def end(self, robot_graph):
        for process in self._processes:
            process.kill()
            process.wait()
        self._processes = []
        if self._input:
            robot_graph.channels[self._input].end()


class OfClock(Fault):
    needs = "clock"

    def __init__(self, what, change, expected, limit=LIMIT):
        super().__init__("clock: " + what, expected, limit)
        self._change = change

    def begin(self, robot_graph, draw):
        self._change(robot_graph.clock)
        return relay.now()

    def end(self, robot_graph):
        robot_graph.clock.go_on()


class FullDisk(Fault):
    needs = "disk"

    def __init__(self):
        super().__init__("disk full", SURVIVES)

    def begin(self, robot_graph, draw):
        self._file = os.path.join(robot_graph.directory, "filled")
        with open(self._file, "wb", buffering=0) as file:
            for size in (65536, 512, 1):
                try:
                    while True:
                        file.write(b"x" * size)
                except OSError:
                    pass
        return relay.now()

    def end(self, robot_graph):
        os.remove(self._file)


class MasterRestarted(Fault):
    """Killed, and started again two seconds later, without anything that it knew."""
    needs = "master"
    stays = False

    def __init__(self):
        super().__init__("master restarted", SURVIVES)

    def begin(self, robot_graph, draw):
        pid = robot_graph.graph.master.getPid(graph.CALLER)[2]
        moment = relay.now()
        os.kill(pid, signal.SIGKILL)
        return moment

    def end(self, robot_graph):
        port = robot_graph.graph.uri.rsplit(":", 1)[1]
        robot_graph.graph.start("roscore", "-p", port)
        graph.wait_until("the master", lambda: xmlrpc.client.ServerProxy(robot_graph.graph.uri).getPid(graph.CALLER))


def of_input(channel, stops, broken, late, jump, repeats, two, stop_limit=LIMIT):
    """The faults that an input can have; each is said what its driver has to do then."""
    many = MANY_IMAGES if channel == "image" else MANY
    return [
        OfInput(channel, "stops", relay.Stop, stops, stop_limit),
        OfInput(channel, "stutters", relay.Stutter, BOUNDED),
        OfInput(channel, "late by 2 s", relay.Late, late, stop_limit, 4.0),
        OfInput(channel, "10 s ahead", functools.partial(relay.Jump, 10.0), jump, stop_limit),
        OfInput(channel, "10 s back", functools.partial(relay.Jump, -10.0), jump, stop_limit),
        OfInput(channel, "repeats", relay.Repeat, repeats, stop_limit),
        OfInput(channel, "cut off" if channel == "image" else "NaN", functools.partial(relay.Change, relay.turned_to_nan), broken,
                stop_limit),
        OfInput(channel, "two publishers", relay.Second, two),
        OfInput(channel, "%d at once" % many, functools.partial(relay.Burst, many), BOUNDED),
    ]


def of_cameras():
    return (of_input("image", STOPS, STOPS, STOPS, STOPS, STOPS, BOUNDED) +
            of_input("camera_info", STOPS, STOPS, STOPS, STOPS, STOPS, BOUNDED) +
            of_input("tf", BOUNDED, BOUNDED, BOUNDED, BOUNDED, BOUNDED, BOUNDED) +
            [LightOff("light off", STOPS),
             OfPicture("camera covered", relay.covered, STOPS),
             OfPicture("camera blurred", relay.blurred, BOUNDED),
             OfPicture("picture turned round", relay.turned_round, BOUNDED),
             OfPicture("copy of the view beside", relay.with_copy_beside, BOUNDED, with_view=True),
             OfPicture("copy of the view held before", relay.with_copy_held, BOUNDED, with_view=True),
             Carried("view moved", BOUNDED),
             Busy("", BOUNDED), Busy("image", STOPS),
             OfClock("paused", relay.Clock.pause, STOPS),
             OfClock("5 s ahead", lambda clock: clock.jump(5.0), STOPS),
             OfClock("5 s back", lambda clock: clock.jump(-5.0), STOPS),
             FullDisk(), MasterRestarted()])


def of_bases(driver, others=()):
    matchers = ["point_matcher", "line_matcher"]
    return (of_cameras() + of_input("odometry", STOPS, STOPS, STOPS, STOPS, STOPS, STOPS) +
            of_input("point_matches", BOUNDED, BOUNDED, BOUNDED, BOUNDED, BOUNDED, BOUNDED) +
            of_input("line_matches", BOUNDED, BOUNDED, BOUNDED, BOUNDED, BOUNDED, BOUNDED) +
            [Turned("camera turned round", STOPS, MATCH_LIMIT), Busy("odometry", STOPS),
             Killed([driver], STOPS), Killed(["nomad_sim"], STOPS, passes=False), Killed(matchers, BOUNDED),
             Stopped([driver], STOPS, stays=False), Stopped(["nomad_sim"], STOPS), Stopped(matchers, BOUNDED)] +
            [kind([node], BOUNDED) for node in matchers for kind in (Killed, Stopped)] +
            [kind([node], SURVIVES) for node in ("view_store", *others) for kind in (Killed, Stopped)])


FAULTS = {
    "homing": of_bases("homing"),
    "route_follower": of_bases("route_follower", ["route_recorder"]),
    "servo_25d": of_cameras() + of_input("homography", STOPS, STOPS, STOPS, STOPS, STOPS, BOUNDED) +
    of_input("joint_states", STOPS, BOUNDED, BOUNDED, BOUNDED, BOUNDED, BOUNDED, JOINT_LIMIT) + [
        Busy("homography", STOPS),
        Killed(["homography_tracker"], STOPS), Killed(["view_store"], SURVIVES), Killed(["robot_state_publisher"], BOUNDED),
        Killed(["servo_25d"], STOPS), Killed(["puma_sim"], STOPS, passes=False),
        Stopped(["homography_tracker"], STOPS), Stopped(["view_store"], SURVIVES), Stopped(["robot_state_publisher"], BOUNDED),
        Stopped(["servo_25d"], STOPS, stays=False), Stopped(["puma_sim"], STOPS)],
}
