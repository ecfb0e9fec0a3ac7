# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""Running nodes that documents are compared with, each set of them under a master of its own."""
import atexit
import ctypes
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time
import unittest
import xmlrpc.client

import rospy

# Debian 11's rospy asks threads by a name that its Python no longer knows.
if not hasattr(threading.Thread, "isAlive"):
    threading.Thread.isAlive = threading.Thread.is_alive

CALLER = "/documents"
SLOWDOWN = float(os.environ.get("VIEW_SERVO_SLOWDOWN", "1"))  # of what is built with sanitizers

# A test that is ended from outside must not leave nodes behind. unittest goes on after SystemExit, not after this.
signal.signal(signal.SIGTERM, signal.default_int_handler)


def end_with_parent():
    """Asks the kernel for a SIGINT when the parent ends, however that happens: a test that takes too long is killed."""
    PR_SET_PDEATHSIG = 1
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGINT)


def free_port():
    with socket.socket() as listener:
        listener.bind(("localhost", 0))
        return listener.getsockname()[1]


def wait_until(what, holds, deadline=60.0 * SLOWDOWN):
    """Waits until `holds()` is true, and returns that. Raises what is missing."""
    end = time.monotonic() + deadline
    while True:
        try:
            value = holds()
            if value:
                return value
        except (OSError, xmlrpc.client.Error):
            pass
        if time.monotonic() > end:
            raise AssertionError("waited %.0f s in vain for %s" % (deadline, what))
        time.sleep(0.1)


def outcome_of_run(path):
    """
    The file that a simulated run writes: 0 for a success, else 1, and a line. What is built with sanitizers is too slow for
    images that come in real time: it only has to get as far as driving, and to say how that ended.
    """
    with open(path) as file:
        outcome = file.read()
    ended = re.match(r"[01] (?!failed: )\S", outcome) if SLOWDOWN > 1.0 else outcome.startswith("0 ")
    if not ended:
        raise AssertionError("the run's outcome is %r" % outcome)
    return int(outcome[0])


class Graph:
    """A master and what roslaunch commands started under it."""

    def __init__(self, directory):
        self.directory = directory
        port = free_port()
        self.uri = "http://localhost:%d" % port
        self.master = xmlrpc.client.ServerProxy(self.uri)
        self.environment = dict(os.environ, ROS_MASTER_URI=self.uri, ROS_HOSTNAME="localhost", ROS_HOME=directory,
                                PWD=directory, PYTHONUNBUFFERED="1")
        self.environment.pop("ROS_NAMESPACE", None)
        self.processes = []
        atexit.register(self.stop)
        self.start("roscore", "-p", str(port))
        wait_until("a master", lambda: self.master.getPid(CALLER))

    def start(self, *command):
        name = "%s-%d.log" % (os.path.basename(command[0]), len(self.processes))
        with open(os.path.join(self.directory, name), "wb") as log:
            self.processes.append(subprocess.Popen(command, env=self.environment, cwd=self.directory, stdout=log,
                                                   stderr=subprocess.STDOUT, start_new_session=True,
                                                   preexec_fn=end_with_parent))
        return self.processes[-1]

    def run(self, command, timeout=60.0, **options):
        """Runs a line as a shell does, and returns its status and what it printed."""
        result = subprocess.run(["bash", "-c", command], env=self.environment, cwd=self.directory, timeout=timeout,
                                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options)
        return result.returncode, result.stdout.decode(errors="replace")

    def stop(self):
        for process in reversed(self.processes):
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in reversed(self.processes):
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.processes = []

    # ----------------------------------------------------------------------------------------- what the master knows

    def state(self):
        """Publishers, subscribers, services: each a dictionary from name to nodes."""
        return [dict(part) for part in self.master.getSystemState(CALLER)[2]]

    def pid_of(self, node):
        """The process of a node, which it tells itself."""
        with xmlrpc.client.ServerProxy(self.master.lookupNode(CALLER, node)[2]) as server:
            return server.getPid(CALLER)[2]

    def topic_types(self):
        return dict(self.master.getTopicTypes(CALLER)[2])

    def nodes(self):
        return {node for part in self.state() for nodes in part.values() for node in nodes}

    def log(self):
        """The end of everything that was printed."""
        texts = []
        for name in sorted(os.listdir(self.directory)):
            if name.endswith(".log"):
                with open(os.path.join(self.directory, name), errors="replace") as file:
                    texts.append("--- %s\n%s" % (name, file.read()[-3000:]))
        return "\n".join(texts)


class GraphTest(unittest.TestCase):
    """A test with a master of its own, and this process as a node under it."""

    @classmethod
    def setUpClass(cls):
        name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower() + "_test"
        cls.directory = tempfile.mkdtemp(prefix="view_servo_%s_" % name)
        cls.graph = Graph(cls.directory)
        os.environ.update(ROS_MASTER_URI=cls.graph.uri, ROS_HOSTNAME="localhost")
        rospy.init_node(name, disable_signals=True)

    @classmethod
    def tearDownClass(cls):
        rospy.signal_shutdown("the tests have ended")
        cls.graph.stop()
        shutil.rmtree(cls.directory, ignore_errors=True)
