# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
Stands between a simulated robot with its matchers or tracker, and the nodes that listen to them: each topic is a channel,
which passes messages on as they come, or changes them while a fault lasts.
"""
import collections
import copy
import os
import subprocess
import sys
import threading
import time

import numpy
import rospy

QUEUE = 20000        # messages that wait for a slow subscriber; more than a burst has
IMAGE_QUEUE = 500    # likewise of images
NAN = float("nan")


def now():
    """Wall time [s], by the clock that messages are stamped with."""
    return time.time()


# ------------------------------------------------------------------------------------------------------------- messages


def headers(message):
    """All headers of a message whose stamps say when it was measured."""
    if hasattr(message, "transforms"):
        return [transform.header for transform in message.transforms]
    return [message.header]


def shifted(message, seconds):
    """A copy with other stamps."""
    result = copy.deepcopy(message) if hasattr(message, "transforms") else copy.copy(message)
    if not hasattr(message, "transforms"):
        result.header = copy.deepcopy(message.header)
    for header in headers(result):
        header.stamp = header.stamp + rospy.Duration.from_sec(seconds)
    return result


def turned_to_nan(message):
    """A copy whose numbers are NaN; an image, which has none, is cut off in its middle instead."""
    result = copy.deepcopy(message)
    kind = result._type.split("/")[-1]
    if kind == "Image":
        result.data = result.data[:len(result.data) // 2]
    elif kind == "CameraInfo":
        result.K, result.P, result.D = [NAN] * 9, [NAN] * 12, [NAN] * len(result.D)
    elif kind == "Odometry":
        result.pose.pose.position.x = result.pose.pose.orientation.w = NAN
    elif kind == "JointState":
        result.position = [NAN] * len(result.position)
    elif kind == "TFMessage":
        for transform in result.transforms:
            transform.transform.translation.x = transform.transform.rotation.w = NAN
    elif kind == "Homography":
        result.h = [NAN] * 9
        for motion in getattr(result, "solutions", []):
            motion.rotation.w = NAN
        if hasattr(result, "translation_over_distance"):
            result.rotation.w = result.translation_over_distance.x = result.normal.x = result.distance = NAN
    else:
        for match in getattr(result, "matches", []):
            for field in ("reference_x", "current_x", "score"):
                if hasattr(match, field):
                    setattr(match, field, NAN)
        for point in getattr(result, "points", []):
            point.reference_x = point.current_x = point.score = NAN
        if hasattr(result, "homography"):
            result.homography.h = [NAN] * 9
    return result


def of_another_source(message):
    """A copy as a second publisher of the same topic would send it: another place, another camera, another picture."""
    result = copy.deepcopy(message)
    kind = result._type.split("/")[-1]
    if kind == "Image":
        return with_picture(result, pixels(result)[::-1, ::-1])
    if kind == "CameraInfo":
        result.K = [1.3 * value if place in (0, 4) else value for place, value in enumerate(result.K)]
        result.P = [1.3 * value if place in (0, 5) else value for place, value in enumerate(result.P)]
    elif kind == "Odometry":
        result.pose.pose.position.x += 1.0
    elif kind == "JointState":
        result.position = [position + 0.2 for position in result.position]
    elif kind == "TFMessage":
        for transform in result.transforms:
            transform.transform.translation.x += 0.3
    elif kind == "Homography":
        result.h = [1, 0, 80, 0, 1, -40, 0, 0, 1]
    else:
        for match in getattr(result, "matches", []) + getattr(result, "points", []):
            if hasattr(match, "current_x"):
                match.current_x += 80.0
    return result


# --------------------------------------------------------------------------------------------------------------- images


def pixels(image):
    return numpy.frombuffer(image.data, numpy.uint8).reshape(image.height, image.step)[:, :image.width]


def with_picture(image, picture):
    """The image with another picture of its size. The simulators' images are grey, 8 bits."""
    result = copy.copy(image)
    result.step = image.width
    result.data = numpy.ascontiguousarray(picture, numpy.uint8).tobytes()
    return result


def covered(image):
    noise = numpy.random.default_rng(image.header.seq).normal(12.0, 2.0, (image.height, image.width))
    return with_picture(image, noise.clip(0, 255))


def turned_round(image):
    return with_picture(image, pixels(image)[::-1, ::-1])


def blurred(image, radius=12):
    """Out of focus: the mean of a square, taken twice."""
    picture = pixels(image).astype(numpy.float64)
    for axis in (0, 1, 0, 1):
        edge = [(radius + 1, radius) if axis == i else (0, 0) for i in (0, 1)]
        sums = numpy.cumsum(numpy.pad(picture, edge, mode="edge"), axis=axis)
        ahead, behind = [slice(None)] * 2, [slice(None)] * 2
        ahead[axis], behind[axis] = slice(2 * radius + 1, None), slice(None, -2 * radius - 1)
        picture = (sums[tuple(ahead)] - sums[tuple(behind)]) / (2 * radius + 1)
    return with_picture(image, picture)


def with_copy_beside(image, view):
    """A print of the view at half its size hangs in the picture's left half."""
    picture = pixels(image).copy()
    half = view[::2, ::2]
    top = (picture.shape[0] - half.shape[0]) // 2
    picture[top:top + half.shape[0], :half.shape[1]] = half
    return with_picture(image, picture)


def with_copy_held(image, view):
    """A print of the view is held before the camera, and nothing else is to be seen."""
    return with_picture(image, view)


# --------------------------------------------------------------------------------------------------------------- faults


class Fault:
    """What a channel does to messages. `passes` returns those to be sent instead of one that comes."""

    def begin(self, channel):
        pass

    def passes(self, channel, message):
        raise NotImplementedError

    def end(self, channel):
        pass


class Stop(Fault):
    def passes(self, channel, message):
        return []


class Stutter(Fault):
    """Nothing for 0.4 s, then all for 0.1 s, and so on."""

    def passes(self, channel, message):
        return [message] if (now() - channel.since) % 0.5 >= 0.4 else []


class Late(Fault):
    """Messages come later than they were stamped, each as late as the others."""

    def __init__(self, delay=2.0):
        self._delay = delay
        self._waiting = collections.deque()
        self._ends = threading.Event()

    def begin(self, channel):
        threading.Thread(target=self._send, args=(channel,), daemon=True).start()

    def passes(self, channel, message):
        self._waiting.append((now() + self._delay, message))
        return []

    def end(self, channel):
        self._ends.set()

    def _send(self, channel):
        while not self._ends.wait(0.005):
            while self._waiting and self._waiting[0][0] <= now():
                channel.publish(self._waiting.popleft()[1])


class Jump(Fault):
    def __init__(self, seconds):
        self._seconds = seconds

    def passes(self, channel, message):
        return [shifted(message, self._seconds)]


class Repeat(Fault):
    """The last message from before again and again."""

    def __init__(self):
        self._last = None

    def begin(self, channel):
        self._last = channel.last

    def passes(self, channel, message):
        return [self._last or message]


class Change(Fault):
    def __init__(self, change):
        self._change = change

    def passes(self, channel, message):
        return [self._change(message)]


class Second(Fault):
    """Another process publishes the same topic, too."""

    def __init__(self):
        self._process = None

    def begin(self, channel):
        self._process = subprocess.Popen([sys.executable, os.path.abspath(__file__), channel.source, channel.target],
                                         stdout=subprocess.DEVNULL)
        end = time.monotonic() + 20.0
        while channel.publishers() < 2:
            if time.monotonic() > end:
                raise AssertionError("nobody else publishes '%s' after 20 s" % channel.target)
            time.sleep(0.02)

    def passes(self, channel, message):
        return [message]

    def end(self, channel):
        self._process.terminate()
        self._process.wait()


class Burst(Fault):
    """The last message so many times at once, besides those that come."""

    def __init__(self, number):
        self._number = number

    def begin(self, channel):
        threading.Thread(target=self._send, args=(channel,), daemon=True).start()

    def passes(self, channel, message):
        return [message]

    def _send(self, channel):
        message = channel.last
        for _ in range(self._number if message is not None else 0):
            channel.publish(message)


# -------------------------------------------------------------------------------------------------------------- channel


class Channel:
    def __init__(self, source, target, message):
        self.source, self.target = source, target
        self.last = None       # the last message that has come
        self.since = 0.0       # when the fault began [s]
        self._fault = None
        self._lock = threading.Lock()
        self._publisher = rospy.Publisher(target, message, queue_size=IMAGE_QUEUE if "Image" in message._type else QUEUE)
        self._subscriber = rospy.Subscriber(source, message, self._take, queue_size=50, buff_size=2 ** 23, tcp_nodelay=True)

    def publish(self, message):
        try:
            self._publisher.publish(message)
        except rospy.ROSException:
            if not rospy.is_shutdown():  # the runs have ended
                raise

    def publishers(self):
        """How many nodes publish what this channel does."""
        topics = rospy.get_master().getSystemState()[2][0]
        return max([len(nodes) for topic, nodes in topics if topic == self.target] + [0])

    def _take(self, message):
        with self._lock:
            self.last = message
            for one in [message] if self._fault is None else self._fault.passes(self, message):
                self.publish(one)

    def begin(self, fault):
        """@return when the fault begins [s]."""
        fault.begin(self)
        with self._lock:
            self._fault, self.since = fault, now()
            return self.since

    def end(self):
        with self._lock:
            fault, self._fault = self._fault, None
        if fault is not None:
            fault.end(self)


class Clock:
    """Publishes wall time as /clock, for nodes that are told to go by it."""

    def __init__(self):
        from rosgraph_msgs.msg import Clock as Message
        self._message = Message
        self._publisher = rospy.Publisher("/clock", Message, queue_size=10)
        self._offset, self._paused = 0.0, False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not rospy.is_shutdown():
            if not self._paused:
                self._publisher.publish(self._message(clock=rospy.Time.from_sec(now() + self._offset)))
            time.sleep(0.01)

    def pause(self):
        self._paused = True

    def jump(self, seconds):
        self._offset = seconds

    def go_on(self):
        self._paused, self._offset = False, 0.0


def publish_as_second(source, target):
    """The program that this file is, too: takes what comes on one topic, and publishes it on the other, changed."""
    import robots
    rospy.init_node("second_publisher", anonymous=True)
    message = next(kind for robot in robots.ROBOTS.values() for _, taken, kind in robot.inputs.values() if taken == source)
    publisher = rospy.Publisher(target, message, queue_size=50)

    def publish(one):
        try:
            publisher.publish(of_another_source(one))
        except rospy.ROSException:
            if not rospy.is_shutdown():
                raise

    rospy.Subscriber(source, message, publish, queue_size=5, buff_size=2 ** 23)
    rospy.spin()


if __name__ == "__main__":
    sys.path.append(os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "docs"))
    publish_as_second(sys.argv[1], sys.argv[2])
