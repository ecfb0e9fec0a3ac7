# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""A simulated robot, its nodes, each a process of its own under a master of their own, and the relay between them."""
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402
import relay  # noqa: E402
import robots  # noqa: E402

import actionlib  # noqa: E402
import numpy  # noqa: E402
import roslaunch.config  # noqa: E402
import roslaunch.xmlloader  # noqa: E402
import roslib.packages  # noqa: E402
import rospy  # noqa: E402
from geometry_msgs.msg import PoseStamped  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402
from view_servo.msg import ServoStatus  # noqa: E402
from view_servo.srv import SaveView, SaveViewRequest, SetLight, SetPose, StartRoute  # noqa: E402

ENDS_WITHIN = 2.0  # of SIGINT [s]
SMALL_DISK = "8m"


def set_priority(pid, niceness):
    """Where that is allowed."""
    try:
        os.setpriority(os.PRIO_PROCESS, pid, niceness)
    except PermissionError:
        pass


def components(twist):
    return [twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y, twist.angular.z]


class RobotGraph:
    """Made once for many runs. With `clock`, the drivers go by a clock that is published here."""

    def __init__(self, robot, clock=False, small_disk=False):
        set_priority(0, -10)  # what the relay delays is no fault of the nodes'
        self.robot = robot
        self.graph, self.processes, self.specs = None, {}, {}
        self.directory = tempfile.mkdtemp(prefix="view_servo_campaign_")
        self.small_disk = small_disk and self._mount()
        try:
            self._begin(robot, clock)
        except BaseException:
            self.stop()
            raise

    def _begin(self, robot, clock):
        self.graph = graph.Graph(self.directory)
        os.environ.update(ROS_MASTER_URI=self.graph.uri, ROS_HOSTNAME="localhost")
        rospy.init_node("campaign", disable_signals=True)
        self.by_stamps = not clock  # whether stamps of commands are wall time
        self.commands, self.statuses, self.truths = [], [], []
        self.truth = self.goal_truth = None
        self._subscribers = [
            rospy.Subscriber(robot.measured, robot.measured_type, self._take_command, queue_size=1000, tcp_nodelay=True),
            rospy.Subscriber("/status", ServoStatus, self._take_status, queue_size=1000),
            rospy.Subscriber("/ground_truth", PoseStamped, self._take_truth, queue_size=100)]
        self.channels = {name: relay.Channel(source, target, message) for name, (target, source, message) in robot.inputs.items()}
        self.commands_on = relay.Channel("/cmd_vel", "/robot/cmd_vel", robot.command_type)
        self._load()
        for name in self.specs:
            if name in (robot.simulator, "robot_state_publisher"):
                self.start(name)
        graph.wait_until("the simulated robot", lambda: self.truth is not None)
        self.clock = None
        if clock:
            rospy.set_param("/use_sim_time", True)  # the simulator does not go by it
            self.clock = relay.Clock()
        for name in self.specs:
            if name not in self.processes:
                self.start(name)
        self.client = None
        self.wait_for_nodes()
        self.view_picture = None
        self.record_route() if robot.name == "route_follower" else self.save_view()

    # ------------------------------------------------------------------------------------------------------------ nodes

    def _mount(self):
        return subprocess.call(["mount", "-t", "tmpfs", "-o", "size=" + SMALL_DISK, "tmpfs", self.directory],
                               stderr=subprocess.DEVNULL) == 0

    def _load(self):
        world = robots.cheap_world(self.robot.world, self.directory, self.robot.rate)
        config = roslaunch.config.ROSLaunchConfig()
        roslaunch.xmlloader.XmlLoader().load_string(self.robot.launch_text(world), config, verbose=False)
        for parameter in config.params.values():
            rospy.set_param(parameter.key, parameter.value)
        self.specs = {node.name: node for node in config.nodes}

    def start(self, name):
        """Starts one node as roslaunch would."""
        node = self.specs[name]
        remaps = ["%s:=%s" % tuple(remap) for remap in node.remap_args]
        program = roslib.packages.find_node(node.package, node.type)[0]
        self.processes[name] = self.graph.start(program, *node.args.split(), *remaps, "__name:=" + node.name,
                                                "__ns:=" + node.namespace.rstrip("/"))
        self.usual_priority(self.processes[name])
        if name == self.robot.driver:
            self.client = None

    @staticmethod
    def usual_priority(process):
        """Of this process' children, which have its own at first."""
        set_priority(process.pid, 0)

    def wait_for_nodes(self):
        services = ["/%s/set_pose" % self.robot.simulator, "/view_store/save", "/%s/enable" % self.robot.driver]

        def there():
            offered = self.graph.state()[2]
            return all(service in offered for service in services) and all(
                "/" + name in self.graph.nodes() for name in self.specs)

        graph.wait_until("all nodes", there)
        if self.client is None:
            self.client = actionlib.ActionClient(self.robot.action, self.robot.action_type)
        graph.wait_until("the action", lambda: self.client.wait_for_server(rospy.Duration(0.1)))
        end = time.monotonic() + 20.0
        while time.monotonic() < end:
            try:
                if self.call("/%s/enable" % self.robot.driver, SetBool, True).success:
                    return
            except rospy.ServiceException:
                time.sleep(0.1)
        raise AssertionError("%s is not enabled" % self.robot.driver)

    def address(self, name):
        """Where the master has a node; empty: it knows none of that name."""
        code, _, address = self.graph.master.lookupNode("/campaign", "/" + name)
        return address if code == 1 else ""

    def restore(self):
        """Starts what has ended. @return the names."""
        ended = [name for name, process in self.processes.items() if process.poll() is not None]
        before = {name: self.address(name) for name in ended}  # the master still knows who was killed
        for name in ended:
            self.start(name)
        graph.wait_until("new nodes", lambda: all(self.address(name) not in ("", before[name]) for name in ended))
        self.wait_for_nodes()
        return ended

    def interrupt(self, names):
        """@return the longest time that one of the nodes takes to end after SIGINT [s], its name, and its exit status."""
        worst = (0.0, "", 0)
        for name in names:
            process = self.processes[name]
            if process.poll() is not None:
                continue
            begin = time.monotonic()
            process.send_signal(signal.SIGINT)
            try:
                process.wait(5.0 * ENDS_WITHIN)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            worst = max(worst, (time.monotonic() - begin, name, process.returncode))
        return worst

    def stop(self):
        rospy.signal_shutdown("the runs have ended")
        for process in self.processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
        if self.graph is not None:
            self.graph.stop()
        if self.small_disk:
            subprocess.call(["umount", "--lazy", self.directory])
        shutil.rmtree(self.directory, ignore_errors=True)

    # ---------------------------------------------------------------------------------------------------------- what comes

    def _take_command(self, message):
        moment = message.header.stamp.to_sec() if self.by_stamps else relay.now()
        self.commands.append((moment, components(message.twist)))

    def _take_status(self, message):
        self.statuses.append((relay.now(), message))

    def _take_truth(self, message):
        self.truth = message
        if self.goal_truth is not None:
            self.truths.append((message.header.stamp.to_sec(), *self.robot.off(message, self.goal_truth)))

    def last_motion(self, begin, end):
        """When the last command came that moves the robot [s]; None: none did."""
        return max((moment for moment, twist in list(self.commands) if begin <= moment <= end and any(twist)), default=None)

    def off(self):
        return self.robot.off(self.truth, self.goal_truth)

    # -------------------------------------------------------------------------------------------------------------- steps

    def call(self, service, kind, *arguments):
        return rospy.ServiceProxy(service, kind)(*arguments)

    def call_place(self, request):
        """Puts the robot somewhere."""
        answer = self.call("/%s/set_pose" % self.robot.simulator, SetPose, request)
        if not answer.success:
            raise AssertionError(answer.message)

    def place(self, request):
        """Puts the robot somewhere, and waits for its camera's picture from there."""
        self.call_place(request)
        moment = relay.now()
        graph.wait_until("the ground truth from there", lambda: self.truth.header.stamp.to_sec() > moment)
        graph.wait_until("a picture from there", lambda: self.channels["image"].last is not None and
                         self.channels["image"].last.header.stamp.to_sec() > moment)

    def light(self, gain):
        self.call("/%s/set_light" % self.robot.simulator, SetLight, gain, 0.0, 0.0)

    def save_view(self):
        self.place(self.robot.goal_pose())
        request = SaveViewRequest(name="goal", overwrite=True)
        if self.robot.roi:
            roi = request.roi
            roi.x_offset, roi.y_offset, roi.width, roi.height = self.robot.roi
        answer = self.call("/view_store/save", SaveView, request)
        if not answer.success:
            raise AssertionError(answer.message)
        self.keep_goal()

    def keep_goal(self):
        self.view_picture = relay.pixels(self.channels["image"].last).copy()
        self.goal_truth = self.truth

    def record_route(self):
        """Drives the base from where the route begins to the world's goal, by the ground truth."""
        self.place(robots.base_pose(*self.robot.BEGIN))
        answer = self.call("/route_recorder/start", StartRoute, "goal")
        if not answer.success:
            raise AssertionError(answer.message)
        commands = rospy.Publisher("/cmd_vel", self.robot.command_type, queue_size=1)

        def there():
            x, y, yaw = robots.planar(self.truth)
            way = numpy.hypot(x, y)
            command = self.robot.command_type()
            if way > 0.02:
                command.linear.x, command.linear.y = (numpy.cos(yaw) * -x + numpy.sin(yaw) * -y,
                                                      -numpy.sin(yaw) * -x + numpy.cos(yaw) * -y)
                command.linear.x *= 0.15 / way
                command.linear.y *= 0.15 / way
                command.angular.z = -0.3 * yaw
            commands.publish(command)
            return way <= 0.02

        graph.wait_until("the end of the route", there)
        time.sleep(1.0)
        answer = self.call("/route_recorder/stop", Trigger)
        if not answer.success:
            raise AssertionError(answer.message)
        commands.unregister()
        self.keep_goal()


