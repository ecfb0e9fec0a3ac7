#!/usr/bin/python3
# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
Every message of the sources about something wrong is in the tables of docs/troubleshooting*.md, which quote some words of its
fixed part, and every quotation there is of the sources. A new message needs a row, or words in one, or a place in NOT_FOR_USERS.
"""
import functools
import glob
import os
import re
import sys
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import documents  # noqa: E402
import messages  # noqa: E402

PAGES = ["docs/troubleshooting.md", "docs/troubleshooting_programs.md"]

# Rooms whose messages are not in the pages, and why not.
ROOMS_LEFT_OUT = {
    "check": "check_robot's lines say what is wrong and what to do",
    "check_ros": "likewise",
    "experiments": "it repeats the thesis' experiments, and is not for users of a robot",
    "trials": "likewise",
}

# Expressions for whole texts that are not in the pages, and why not.
NOT_FOR_USERS = {
    "it tells who calls the library that the arguments are wrong, which nodes and programs see to": [
        r"(detect|segment|profile|Association|Profile|Line|Prepared|Simulated)\w+: .*",
        r"Puma::step: .*",
        r"intensity profiles need .*",
        r"the association has another size .*",
        r"sampling must be UNIFORM .*",
        r"binary features: .*",
        r"the index is full",
    ],
    "it is the name of something, within a message that is in a page": [
        r"([\w.]+ )*parameters( of [\w. ]+)?",
        r"joint (angles|states)",
        r"an obstacle",
        r"a (texture|start|trajectory)'s name",
        r"a pose of the (base|camera)",
        r"its (stamp|camera|pose)",
        r"x, y, width, height",
        r"current image",
        r"fundamental matrix",
        r"image that was worked on",
        r"tf's pose of the camera",
        r"Image to command",
        r"Time an image",
        r"a message on .*",
        r"homographies on .*",
        r"(whole )?number in ",
        r"turns .*",
        r"compressed bgr",
        r"; jpeg compressed ",
        r"view_servo (ViewIndex|structure|views.index) 1.*",
        r"its yaml file",
        r"(save|load) the structure of",
        r"overwrite: true",
    ],
    "it is a status that says how far a node has come": [
        r"looks for the view",
        r"looking for the view",
        r"the goal is being prepared",
        r"waits for a goal",
        r", in dry run",
        r"nothing is known yet",
        r"the heading is known",
        r"the correlation has (risen|dropped after its rise)",
        r"the views agree",
        r"the view's points are .*",
        r"no image has been worked on yet",
        r"drives to the view",
        r"%.2f mm and %.3f degrees from the view",
        r", if its plane is .*",
        r"images arrive",
        r" are in the index",
        r" +views are indexed",
        r"no image was looked at",
        r"(storing a view|no route is recorded|records route .*)",
        r"rename to",
        r"no driver",
        r".* is asked to drive to .*",
        r"Stop: .*, its goals are cancelled",
        r"Stop: all goals are told to end, the gates are being closed",
    ],
    "it is a label, style or key of rviz's panel": [
        r"to go:",
        r"Dry run",
        r"DRY RUN: nothing moves",
        r"Robot Namespace",
        r"(Camera|Overlay) Topic",
        r"Show (Overlay|matches)",
        r"name of a new view",
        r"'Replace' ticked",
        r"Untick 'Show matches' to drag a region for Store",
        r"(QPushButton \{ )?background: .*",
    ],
    "it says what was done or found as it was asked for": [
        r"camera images are (not matched|matched with view .*)",
        r"follows view .*",
        r" as soon as it can: ",
        r"no view was followed",
        r"view ' ... ' is not followed any more",
        r"(saved|deleted) view .*",
        r"stored route '",
        r"route .* is recorded from view .*",
        r".*%zu views.*",
        r"poses in '%s': .*",
        r"views \.\.\. base: .*",
        r"; it is learnt while the base moves by 0.3 m",
        r"none of +... +views has anything in common with the image ",
        r", verified by .*",
        r", not verified",
        r"the image shows ",
        r"no view is verified",
        r"left out: ",
        r", without a (calibration|pose)",
        r", with its pose in ",
        r"the (camera|base) is %.\df mm .*",
        r"line ... +matched, +... +of them on .*",
        r"intersection ... +agree .*",
        r" of +... +matches agree .*",
        r" lie on one plane",
        r", and too little beside it: a homography",
        r", +... +lines and .*",
        r", rms error .*",
        r"; beads: further planes",
        r"rms error of .*",
        r"mean corner error.*",
        r" \(reference -> current\): ",
        r"motion, X_cur = .*",
    ],
    "it is a program's help, or says what to do next": [
        r"Listens to .*",
        r"Usage: .*",
        r"bring the arm to .*",
        r"move the arm to another pose, .*",
        r"drive the base to .*",
        r"(turn|drive) the base (on|straight) .*",
        r" px; odometry since the last one: .*",
        r"the view shows the floor: .*",
        r"the height of ' .* is kept as tf has it.*",
        r"tf has it .* degrees from there: .*",
        r"(arm_servo|homing)\.launch sim:=false \w+:=",
        r"view ' ... ':  ... ; Ctrl-C ends it with what there is",
        r"its axis points .*",
        r"standard deviation, along the least certain direction: .*",
        r"--(base|odom-frame) and --(flange|base)",
        r"that is enough",
        r" +poses (are kept in|before view ).*",
        r"(calibrate_hand_eye)?,  ... : poses for its option --file",
        r"images .* m from the view's camera",
        r"errors:  .*: x y z qx qy qz qw = ",
        r"written to  ... ; to publish it, .*",
        r"the camera sees view '|one plane|a scene with depth|Followed as",
        r"Print this, and end",
        r"Exit status: .*",
        r"match_images (points|lines|scene) REF .*",
        r"find, beside those of scene: ",
        r"Drag a region (with the mouse|on the picture).*",
        r"Region: everywhere",
        r"(Runs|Records) .* in simulation, .*",
        r".* rosrun view_servo .*Parameters, and their defaults:.*",
        r"Listening for .*",
        r" --move: .*",
        r"; then press Enter.",
        r"; the camera's picture is in ",
    ],
}


def quotations(path):
    """What the tables of a page quote, as (place, text)."""
    return [(row.place, text.replace('\\"', '"')) for row in documents.Document(path).rows if row.head[0] == "it says"
            for text in re.findall(r'"((?:\\.|[^"\\])+)"', row.cells[0])]


@functools.lru_cache(maxsize=None)
def sources():
    paths = sorted(path for folder in ("include", "src") for end in ("h", "cpp")
                   for path in glob.glob(os.path.join(documents.ROOT, folder, "**", "*." + end), recursive=True))
    found = []
    for path in paths:
        relative = os.path.relpath(path, documents.ROOT)
        with open(path, encoding="utf-8") as file:
            text = file.read()
        if room_of(relative) not in ROOMS_LEFT_OUT:
            found.append((messages.messages_of(relative, text), messages.literals_of(text)))
    return [message for some, _ in found for message in some], [literal for _, some in found for literal in some]


def room_of(path):
    return re.match(r"(?:include/view_servo|src)/(\w+)", path).group(1)


def quotes(quotation, part):
    """Fewer than three words are in many messages: they have to be all that is fixed."""
    if len(re.findall(r"\w+", quotation)) < 3:
        return quotation.strip() == part.strip()
    return quotation in part


def is_quoted(message, quoted):
    return any(quotes(text, part) for part in message.parts for text in quoted)


def is_for_users(message):
    text = " ... ".join(message.parts)
    return not any(re.fullmatch(expression, text) for expressions in NOT_FOR_USERS.values() for expression in expressions)


class Messages(unittest.TestCase):
    def test_extraction(self):
        """What is taken for one message, and what for none."""
        def found(text):
            return [message.parts for message in messages.messages_of("file.cpp", text)]
        self.assertEqual(found('throw std::runtime_error("no such" " thing as \'" + name(a, b) + "\' is known");'),
                         [["no such thing as '", "' is known"]])
        self.assertEqual(found('ROS_WARN_STREAM_THROTTLE(5.0, "it is late by " << age << " s now");'),
                         [["it is late by ", " s now"]])
        self.assertEqual(found('return bad ? "it is bad" : "";'), [["it is bad"]])
        self.assertEqual(found('reason = bad ? "it is bad" : "it is worse";'), [["it is bad"], ["it is worse"]])
        self.assertEqual(found('ROS_INFO("all is well"); throw std::logic_error("never happens, really");'), [])
        self.assertEqual(found('real("rate", params.rate, "Hz", "> 0", "how often it is done");'), [])
        self.assertEqual(found('// throw Error("it is bad")\n/* "it is bad" */ int a = \'"\'; call("name");'), [])
        self.assertEqual(found('\n\nthrow Error("it is bad");'), [["it is bad"]])

    def test_a_missing_message_is_found(self):
        message = messages.messages_of("file.cpp", 'throw Error("there are no " + what + " bananas left");')[0]
        self.assertFalse(is_quoted(message, [text for page in PAGES for _, text in quotations(page)]))
        self.assertTrue(is_for_users(message))
        self.assertTrue(is_quoted(message, [" bananas left"]))
        self.assertFalse(is_quoted(message, ["bananas", "there are"]))
        self.assertTrue(is_quoted(message, ["are no bananas", "there are no"]))

    def test_every_message_is_in_a_page(self):
        quoted = [text for page in PAGES for _, text in quotations(page)]
        found, _ = sources()
        missing = ["%s: %s" % (message.place, " ... ".join(message.parts)) for message in found
                   if is_for_users(message) and not is_quoted(message, quoted)]
        self.assertEqual(len(missing), 0, "no page has these messages:\n" + "\n".join(missing))
        self.assertGreater(len(found), 300)

    def test_every_quotation_is_of_the_sources(self):
        _, literals = sources()
        for page in PAGES:
            for place, quotation in quotations(page):
                with self.subTest(where=place, quotation=quotation):
                    self.assertTrue(any(quotes(quotation, literal) for literal in literals), "no message has these words")

    def test_what_is_left_out_is_there(self):
        texts = [" ... ".join(message.parts) for message in sources()[0]]
        for expression in sum(NOT_FOR_USERS.values(), []):
            with self.subTest(expression=expression):
                self.assertTrue(any(re.fullmatch(expression, text) for text in texts), "no message is like this any more")


if __name__ == "__main__":
    unittest.main(verbosity=2)
