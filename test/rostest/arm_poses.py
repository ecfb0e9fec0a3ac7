# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""Places for the simulated arm's camera, before the box of the world `rice`, whose face is at x = 0.96 m."""
import numpy


def quaternion_of(matrix):
    """x, y, z, w of a rotation."""
    values, vectors = numpy.linalg.eigh(numpy.array([
        [matrix[0, 0] - matrix[1, 1] - matrix[2, 2], 0.0, 0.0, 0.0],
        [matrix[0, 1] + matrix[1, 0], matrix[1, 1] - matrix[0, 0] - matrix[2, 2], 0.0, 0.0],
        [matrix[0, 2] + matrix[2, 0], matrix[1, 2] + matrix[2, 1], matrix[2, 2] - matrix[0, 0] - matrix[1, 1], 0.0],
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1], numpy.trace(matrix)]]))
    return vectors[:, numpy.argmax(values)]


def matrix_of(x, y, z, w):
    return numpy.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def looking_at_the_box(x, y, z, roll):
    """The request of set_pose for a place in the world [m] and a turn about the camera's own axis [degrees]."""
    ahead = numpy.array([0.96, 0.0, 0.74]) - [x, y, z]
    ahead /= numpy.linalg.norm(ahead)
    right = numpy.cross(ahead, [0.0, 0.0, 1.0])
    right /= numpy.linalg.norm(right)
    level = numpy.column_stack([right, numpy.cross(ahead, right), ahead])
    c, s = numpy.cos(numpy.radians(roll)), numpy.sin(numpy.radians(roll))
    turned = level @ numpy.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return "{pose: {position: {x: %g, y: %g, z: %g}, orientation: {x: %.9f, y: %.9f, z: %.9f, w: %.9f}}}" % (
        x, y, z, *quaternion_of(turned))
