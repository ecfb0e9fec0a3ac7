# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""The two simulated robots that faults are played to: their nodes, topics, places and goals, and how far off they are."""
import os
import sys

import numpy
import yaml

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "test", "rostest"))
from arm_poses import looking_at_the_box, matrix_of  # noqa: E402

import genpy.dynamic  # noqa: E402
import genpy.message  # noqa: E402
from geometry_msgs.msg import TransformStamped, Twist, TwistStamped  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from sensor_msgs.msg import CameraInfo, Image, JointState  # noqa: E402
from view_servo.msg import FollowRouteAction, FollowRouteGoal, Homography, HomeToViewAction, HomeToViewGoal, LineMatches, \
    PointMatches, ServoToViewAction, ServoToViewGoal  # noqa: E402
from view_servo.srv import SetPoseRequest  # noqa: E402

# The Python side of tf2_msgs is not needed for anything else, and need not be installed.
TFMessage = genpy.dynamic.generate_dynamic(
    "tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n%s\nMSG: geometry_msgs/TransformStamped\n%s" %
    ("=" * 80, TransformStamped._full_text))["tf2_msgs/TFMessage"]
LOST_TIMEOUT = 4.0  # of both drivers, so that runs which cannot go on end soon [s]
COMMON = {"image": ("/camera/image_raw", "/robot/image_raw", Image),
          "camera_info": ("/camera/camera_info", "/robot/camera_info", CameraInfo),
          "tf": ("/tf", "/robot/tf", TFMessage)}


class Robot:
    """
    What differs between the robots. `inputs` are the channels: name -> (topic that nodes listen to, topic that the relay
    takes it from, type). `measured` is the topic on which commands are heard with their stamps.
    """

    def launch_text(self, world):
        def remaps(of_simulator):
            return "".join('<remap from="%s" to="%s"/>' % (target, source) for target, source, _ in self.inputs.values()
                           if (name_of(source) in self.of_simulator) == of_simulator)

        return """<launch>
          <group>%s<remap from="/cmd_vel" to="/robot/cmd_vel"/>
            <include file="%s/launch/%s"><arg name="world" value="%s"/></include></group>
          <group>%s<include file="%s/launch/%s"><arg name="sim" value="false"/></include></group>
          <param name="/%s/lost_timeout" type="double" value="%g"/>
        </launch>""" % (remaps(True), ROOT, self.simulator_file, world, remaps(False), ROOT, self.file, self.driver, LOST_TIMEOUT)


def name_of(topic):
    return topic.split("/")[-1]


def cheap_world(name, directory, rate):
    """A world with a camera that leaves the processor to the nodes. @return the file."""
    with open(os.path.join(ROOT, "config", "worlds", name + ".yaml")) as file:
        world = yaml.safe_load(file)
    world["camera"].update(rate=rate, supersampling=1)
    path = os.path.join(directory, name + ".yaml")
    with open(path, "w") as file:
        yaml.safe_dump(world, file)
    return path


class Base(Robot):
    name = driver = "homing"
    simulator, simulator_file, file = "nomad_sim", "nomad_sim.launch", "homing.launch"
    world, rate = "desk", 8
    action, action_type = "/home", HomeToViewAction
    command_type, measured, measured_type = Twist, "/cmd_vel_stamped", TwistStamped
    of_simulator = ("image_raw", "camera_info", "odom", "tf")
    inputs = dict(COMMON, odometry=("/odom", "/robot/odom", Odometry),
                  point_matches=("/point_matcher/point_matches", "/robot/point_matches", PointMatches),
                  line_matches=("/line_matcher/line_matches", "/robot/line_matches", LineMatches))
    nodes = ("homing", "point_matcher", "line_matcher", "view_store")
    roi = None
    allowance = 0.3      # how much farther than at its start a goal lets it be [m]
    arrived = (0.03, 0.035)  # how far off a robot may be that says it has arrived [m, rad]
    push = 0.25          # how far it is carried [m]

    @staticmethod
    def goal(timeout):
        return HomeToViewGoal(view="goal", timeout=timeout)

    @staticmethod
    def goal_pose():
        return base_pose(0.0, 0.0, 0.0)

    @staticmethod
    def start_pose(draw):
        way, angle = draw.uniform(0.45, 0.8), draw.uniform(-0.45, 0.45)
        return base_pose(-way * numpy.cos(angle), way * numpy.sin(angle), draw.uniform(-0.08, 0.08))

    @staticmethod
    def carried(truth, draw):
        """Where somebody puts it on its way: 0.25 m aside, turned a little."""
        x, y, yaw = planar(truth)
        aside = draw.choice((-1, 1)) * Base.push
        return base_pose(x - aside * numpy.sin(yaw), y + aside * numpy.cos(yaw), yaw - 0.15 * numpy.sign(aside))

    @staticmethod
    def turned(truth, angle=3.0):
        x, y, yaw = planar(truth)
        return base_pose(x, y, yaw + angle)

    @staticmethod
    def off(truth, goal):
        """@return how far the camera is from the goal, on the floor [m, rad]."""
        x, y, yaw = planar(truth)
        gx, gy, gyaw = planar(goal)
        return float(numpy.hypot(x - gx, y - gy)), abs(float((yaw - gyaw + numpy.pi) % (2 * numpy.pi) - numpy.pi))


class RouteBase(Base):
    """The same base, which follows a route. Its goal is the route's last view."""
    name = driver = "route_follower"
    file = "route.launch"
    action, action_type = "/follow", FollowRouteAction
    nodes = ("route_follower", "route_recorder", "point_matcher", "line_matcher", "view_store")
    BEGIN = (-0.9, 0.3, -0.05)  # of the route, in the world [m, m, rad]

    @staticmethod
    def goal(timeout):
        return FollowRouteGoal(route="goal", timeout=timeout)

    @staticmethod
    def start_pose(draw):
        x, y, yaw = RouteBase.BEGIN
        return base_pose(x + draw.uniform(-0.05, 0.05), y + draw.uniform(-0.1, 0.1), yaw + draw.uniform(-0.04, 0.04))


class Arm(Robot):
    name = driver = "servo_25d"
    simulator, simulator_file, file = "puma_sim", "puma_sim.launch", "arm_servo.launch"
    world, rate = "rice", 12
    action, action_type = "/servo", ServoToViewAction
    command_type, measured, measured_type = TwistStamped, "/cmd_vel", TwistStamped
    of_simulator = ("image_raw", "camera_info", "joint_states", "tf")
    inputs = dict(COMMON, joint_states=("/joint_states", "/robot/joint_states", JointState),
                  homography=("/homography_tracker/homography", "/robot/homography", Homography))
    nodes = ("servo_25d", "homography_tracker", "view_store")
    roi = (172, 31, 296, 418)  # the printed face in the picture [px]
    allowance = 0.05
    arrived = (0.004, 0.01)

    @staticmethod
    def goal(timeout):
        return ServoToViewGoal(view="goal", timeout=timeout)

    @staticmethod
    def goal_pose():
        return arm_pose(0.50, 0.00, 0.74, 0)

    @staticmethod
    def start_pose(draw):
        return arm_pose(draw.uniform(0.38, 0.43), draw.choice((-1, 1)) * draw.uniform(0.06, 0.12), draw.uniform(0.77, 0.84),
                        draw.uniform(-10, 10))

    @staticmethod
    def carried(truth, draw):
        place = truth.pose.position
        return arm_pose(place.x - 0.03, place.y + draw.choice((-1, 1)) * 0.04, place.z, draw.uniform(-8, 8))

    @staticmethod
    def off(truth, goal):
        place, there = truth.pose.position, goal.pose.position
        turn = rotation(truth).T @ rotation(goal)
        angle = numpy.arccos(numpy.clip(0.5 * (numpy.trace(turn) - 1.0), -1.0, 1.0))
        return float(numpy.linalg.norm([place.x - there.x, place.y - there.y, place.z - there.z])), float(angle)


ROBOTS = {robot.name: robot for robot in (Base(), Arm(), RouteBase())}


def rotation(stamped):
    q = stamped.pose.orientation
    return matrix_of(q.x, q.y, q.z, q.w)


def planar(truth):
    """Place on the floor and yaw of a camera's pose."""
    ahead = rotation(truth)[:, 2]
    return truth.pose.position.x, truth.pose.position.y, numpy.arctan2(ahead[1], ahead[0])


def base_pose(x, y, yaw):
    request = SetPoseRequest()
    request.pose.position.x, request.pose.position.y = x, y
    request.pose.orientation.z, request.pose.orientation.w = numpy.sin(0.5 * yaw), numpy.cos(0.5 * yaw)
    return request


def arm_pose(*place):
    request = SetPoseRequest()
    genpy.message.fill_message_args(request, [yaml.safe_load(looking_at_the_box(*place))])
    return request
