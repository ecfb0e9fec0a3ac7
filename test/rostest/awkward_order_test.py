#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
Starts the nodes of launch files in the most awkward order: the last one first, with pauses, and the camera, or the simulated
robot that has it, seconds after everything else. Nodes have to live, their services to answer, and what needs an image has to
wait for it.
"""
import os
import signal
import subprocess
import sys
import threading
import time
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "docs"))
import graph  # noqa: E402

import numpy  # noqa: E402
import roslaunch.config  # noqa: E402
import roslaunch.xmlloader  # noqa: E402
import roslib.packages  # noqa: E402
import rospy  # noqa: E402
import rosservice  # noqa: E402
from sensor_msgs.msg import CameraInfo, Image  # noqa: E402
from view_servo.srv import SaveView, SaveViewRequest  # noqa: E402

PAUSE = 0.3        # between one node and the next [s]
CAMERA_LATE = 5.0  # after the first node [s]
EARLY = 2.0  # after which a request that came before the camera has no answer yet; view_store waits for 5 s [s]
CALLERS = 5  # more than a node has threads to answer them
PATIENCE = 60.0 * graph.SLOWDOWN  # [s]


class Camera:
    """A calibrated camera before a picture of many patches."""

    WIDTH, HEIGHT = 320, 240

    def __init__(self):
        generator = numpy.random.default_rng(1)
        picture = numpy.kron(generator.integers(0, 256, (self.HEIGHT // 8, self.WIDTH // 8)), numpy.ones((8, 8)))
        self.image = Image(height=self.HEIGHT, width=self.WIDTH, encoding="mono8", step=self.WIDTH,
                           data=picture.astype(numpy.uint8).tobytes())
        self.info = CameraInfo(height=self.HEIGHT, width=self.WIDTH, distortion_model="plumb_bob", D=[0.0] * 5,
                               K=[300.0, 0, 159.5, 0, 300.0, 119.5, 0, 0, 1], R=[1.0, 0, 0, 0, 1, 0, 0, 0, 1],
                               P=[300.0, 0, 159.5, 0, 0, 300.0, 119.5, 0, 0, 0, 1, 0])
        self.publishers = [rospy.Publisher("camera/image_raw", Image, queue_size=1),
                           rospy.Publisher("camera/camera_info", CameraInfo, queue_size=1)]
        self.ends = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        while not self.ends.wait(0.1):
            for publisher, message in zip(self.publishers, (self.image, self.info)):
                message.header.stamp = self.image.header.stamp if message is self.info else rospy.Time.now()
                message.header.frame_id = "camera_optical_frame"
                publisher.publish(message)

    def stop(self):
        self.ends.set()
        self.thread.join()
        for publisher in self.publishers:
            publisher.unregister()


class AwkwardOrder(graph.GraphTest):
    """Each test starts one launch file's nodes under the same master, and stops them."""

    def setUp(self):
        self.nodes = {}  # by name
        self.camera = None

    def tearDown(self):
        if self.camera:
            self.camera.stop()
        for process in self.nodes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)  # roscpp takes leave of the master then, and only then
        for process in self.nodes.values():
            try:
                process.wait(15.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        for name in self.nodes:
            if rospy.has_param(name):
                rospy.delete_param(name)

    # ---------------------------------------------------------------------------------------------------------- steps

    def load(self, file, *arguments):
        """The nodes of a launch file, in the file's order; their parameters are set."""
        config = roslaunch.config.ROSLaunchConfig()
        roslaunch.xmlloader.XmlLoader().load(os.path.join(ROOT, "launch", file), config, argv=list(arguments), verbose=False)
        for parameter in config.params.values():
            rospy.set_param(parameter.key, parameter.value)
        return config.nodes

    def start(self, node):
        """Starts one node as roslaunch would."""
        found = roslib.packages.find_node(node.package, node.type)
        self.assertTrue(found, "%s/%s is not built" % (node.package, node.type))
        name = node.namespace + node.name
        remaps = ["%s:=%s" % tuple(remap) for remap in node.remap_args]
        self.nodes[name] = self.graph.start(found[0], *node.args.split(), *remaps, "__name:=" + node.name,
                                            "__ns:=" + node.namespace.rstrip("/"))
        return name

    def start_backwards(self, nodes):
        for node in reversed(nodes):
            self.start(node)
            time.sleep(PAUSE)

    def services_of(self, name):
        return [service for service, nodes in self.graph.state()[2].items() if name in nodes]

    def assert_alive(self):
        for name, process in self.nodes.items():
            self.assertIsNone(process.poll(), "%s has ended\n%s" % (name, self.graph.log()))

    def assert_services_answer(self, *wanted):
        for service in wanted:
            graph.wait_until(service, lambda: service in self.graph.state()[2], PATIENCE)
        for name in self.nodes:
            for service in self.services_of(name):
                self.assertTrue(rosservice.get_service_type(service), service)  # asks the node itself

    def save_before_the_camera(self):
        """Requests for the camera's image, made before there is one, are answered when there is, however many wait."""
        rospy.wait_for_service("view_store/save", PATIENCE)
        answers = []
        requests = [SaveViewRequest(name="early_%d" % i, overwrite=True) for i in range(CALLERS)]
        callers = [threading.Thread(target=lambda request=request: answers.append(
            rospy.ServiceProxy("view_store/save", SaveView)(request))) for request in requests]
        for caller in callers:
            caller.start()
        time.sleep(EARLY)
        self.assertEqual(answers, [], "there was no camera yet")
        self.camera = Camera()
        for caller in callers:
            caller.join(PATIENCE)
        self.assertEqual([answer.success for answer in answers], CALLERS * [True], answers)

    def start_all_before_the_camera(self, file, arguments, services):
        self.start_backwards(self.load(file, *arguments))
        self.assert_services_answer(*services)
        self.save_before_the_camera()
        self.assert_alive()
        self.assert_services_answer(*services)

    # ---------------------------------------------------------------------------------------------------------- tests

    def test_matching(self):
        self.start_all_before_the_camera("matching.launch", [],
                                         ["/view_store/save", "/line_matcher/match", "/point_matcher/match",
                                          "/scene_matcher/match"])

    def test_homing(self):
        self.start_all_before_the_camera("homing.launch", ["sim:=false"], ["/view_store/save", "/homing/enable"])

    def test_arm(self):
        self.start_all_before_the_camera("arm_servo.launch", ["sim:=false"],
                                         ["/view_store/save", "/servo_25d/enable", "/homography_tracker/start"])

    def test_paused_clock(self):
        """A request for an image that does not come is answered although ROS' time stands still."""
        rospy.set_param("/use_sim_time", True)
        self.addCleanup(rospy.delete_param, "/use_sim_time")
        nodes = self.load("matching.launch")
        self.start(next(node for node in nodes if node.name == "view_store"))
        self.assert_services_answer("/view_store/save")
        answers = []
        request = SaveViewRequest(name="never")
        caller = threading.Thread(target=lambda: answers.append(rospy.ServiceProxy("view_store/save", SaveView)(request)),
                                  daemon=True)
        caller.start()
        caller.join(PATIENCE)
        self.assertTrue(answers, "there is no answer")
        self.assertFalse(answers[0].success)
        self.assertIn("/camera/image_raw", answers[0].message)

    def run_simulation(self, file, robot, run):
        """A whole run in which the simulated robot comes last, and late."""
        result = os.path.join(self.directory, run + ".result")
        nodes = self.load(file, "result:=" + result, "patience:=%g" % PATIENCE)
        self.start_backwards([node for node in nodes if node.name != robot])
        time.sleep(CAMERA_LATE)
        self.start(next(node for node in nodes if node.name == robot))
        process = self.nodes["/" + run]
        process.wait(2.0 * PATIENCE)
        try:
            self.assertEqual(process.returncode, graph.outcome_of_run(result))
        except (AssertionError, OSError) as error:
            self.fail("%s\n%s" % (error, self.graph.log()))

    def test_run_of_homing(self):
        self.run_simulation("homing.launch", "nomad_sim", "run_homing")

    def test_run_of_the_arm(self):
        self.run_simulation("arm_servo.launch", "puma_sim", "run_arm")


if __name__ == "__main__":
    unittest.main(warnings="ignore")  # ROS leaves sockets to the end
