# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""The simulated arm before the world `rice` and the nodes of arm_servo.launch, for tests that send goals to them."""
import graph

import actionlib
import numpy
import rospy
from actionlib import CommState
from geometry_msgs.msg import PoseStamped
from view_servo.msg import ServoToViewAction

SERVICES = ("/puma_sim/set_pose", "/view_store/save", "/servo_25d/enable", "/homography_tracker/start")


class ArmTest(graph.GraphTest):
    @classmethod
    def start_arm(cls, subscribers, *arguments):
        """Waits until all is there. `subscribers` are ended with the tests; `arguments` are for arm_servo.launch."""
        cls.place = None  # of the camera in the world [m]
        cls.subscribers = [rospy.Subscriber("/ground_truth", PoseStamped, cls.take_truth), *subscribers]
        cls.graph.start("roslaunch", "view_servo", "puma_sim.launch", "world:=rice")
        cls.graph.start("roslaunch", "view_servo", "arm_servo.launch", "sim:=false", *arguments)
        cls.client = actionlib.SimpleActionClient("/servo", ServoToViewAction)
        graph.wait_until("all nodes", lambda: cls.place is not None and all(
            service in cls.graph.state()[2] for service in SERVICES))
        graph.wait_until("the action", lambda: cls.client.wait_for_server(rospy.Duration(0.1)))

    @classmethod
    def tearDownClass(cls):
        for subscriber in cls.subscribers:
            subscriber.unregister()
        super().tearDownClass()

    @classmethod
    def take_truth(cls, message):
        place = message.pose.position
        cls.place = numpy.array([place.x, place.y, place.z])

    def wait_for_result(self, deadline=60.0 * graph.SLOWDOWN):
        """
        The result of the goal that was sent last, not before it is here: the status by which actionlib tells the goal's end
        comes on another topic, and may be earlier. None where the node has forgotten the goal.
        """
        graph.wait_until("the goal's result", lambda: self.client.gh.get_comm_state() == CommState.DONE, deadline)
        return self.client.get_result()
