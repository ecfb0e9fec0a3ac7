# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
Reads a recorded run along a route and draws it, for plot_run and report, which import this file from their own directory. The
run is known by the feedback of the action follow.
"""
import os
import textwrap

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

import recorded_run
from recorded_run import AFTERMATH, STATUS_STATES, colour_axis, dart, duration, find_topic, name_of, note, read_table, select, travelled

LARGEST_STEP = 0.3  # between two poses that one way joins; more is a robot that was put elsewhere [m]
LABELS = 12         # of views, at most, in the picture
LEG_COLOURS = ["#1f77b4", "#e69f00"]  # in turn


def read_route(bag):
    """A run along a route; None without feedback. Its times begin with the first feedback, at "start" by the bag's clock."""
    topics = bag.get_type_and_topic_info().topics
    topic = find_topic(topics, "view_servo/FollowRouteActionFeedback", "feedback")
    if topic is None:
        return None

    def table(message_type, name, columns):
        return read_table(bag, find_topic(topics, message_type, name, topic), columns)

    feedback = read_table(bag, topic, {
        "view": lambda m: str(m.feedback.view),
        "share": lambda m: m.feedback.share,
        "sideways": lambda m: m.feedback.sideways,
        "yaw": lambda m: m.feedback.yaw,
    })
    status = table("view_servo/ServoStatus", "status", {
        "state": lambda m: m.state,
        "reason": lambda m: str(m.reason),
    })
    command = table("geometry_msgs/TwistStamped", "cmd_vel_stamped", {
        "ahead": lambda m: m.twist.linear.x,
        "left": lambda m: m.twist.linear.y,
        "turn": lambda m: m.twist.angular.z,
    })
    truth = table("geometry_msgs/PoseStamped", "ground_truth", {
        "x": lambda m: m.pose.position.x,
        "y": lambda m: m.pose.position.y,
        "yaw": lambda m: recorded_run.yaw_of_optical(m.pose.orientation),
    })
    odometry = recorded_run.read_odometry(bag, topics, topic)
    result = table("view_servo/FollowRouteActionResult", "result", {"message": lambda m: str(m.result.message)})
    start = feedback["t"][0]
    for each in (feedback, status, command, truth, odometry, result):
        each["t"] = each["t"] - start
    end = duration(feedback) + AFTERMATH
    path = truth if len(truth["t"]) else odometry
    path = select(path, np.isfinite(path["x"]) & np.isfinite(path["y"]) & np.isfinite(path["yaw"]) & (path["t"] <= end))
    return {
        "topic": topic,
        "start": start,
        "feedback": feedback,
        "status": select(status, (status["t"] >= 0) & (status["t"] <= end)),
        "command": select(command, (command["t"] >= 0) & (command["t"] <= end)),
        "result": result,
        "before": select(path, path["t"] < 0),
        "path": select(path, path["t"] >= 0),
        "path_source": "the camera, ground truth" if len(truth["t"]) else "the base, by odometry",
    }


def legs_of(feedback):
    """The views in the order of driving: [(index of the first feedback about it, its name)]."""
    views = feedback["view"]
    return [(i, views[i]) for i in range(len(views)) if i == 0 or views[i] != views[i - 1]]


def last_leg_begin(run):
    """When the drive to the last view began."""
    return run["feedback"]["t"][legs_of(run["feedback"])[-1][0]]


def ways_of(path):
    """The path's places, cut where the robot was put elsewhere."""
    points = np.column_stack([path["x"], path["y"]])
    jumps = np.flatnonzero(np.hypot(*np.diff(points, axis=0).T) > LARGEST_STEP) + 1 if len(points) else []
    return [way for way in np.split(points, jumps) if len(way) > 1]


def draw_path(axes, run):
    """From above: what was driven before, such as the recording, and the run, in turn of its views."""
    path, legs = run["path"], legs_of(run["feedback"])
    if len(path["t"]) < 2:
        note(axes, "no ground_truth and no odometry during the run")
        return
    handles = []
    for way in ways_of(run["before"]):
        line, = axes.plot(*way.T, color="0.75", linewidth=5, solid_capstyle="round", zorder=1, label="driven before")
        handles = [line]
    points = np.column_stack([path["x"], path["y"]])
    begins = run["feedback"]["t"][[i for i, _ in legs]]
    leg = np.maximum(np.searchsorted(begins, path["t"], side="right") - 1, 0)
    colours = [LEG_COLOURS[k % 2] for k in leg[1:]]
    axes.add_collection(LineCollection(list(zip(points[:-1], points[1:])), colors=colours, linewidths=2, zorder=2))
    handles.append(Line2D([], [], color=LEG_COLOURS[0], linewidth=2, label="followed; the colour changes with the view"))
    for number in np.unique(np.linspace(0, len(legs) - 1, LABELS).astype(int)):
        x, y, _ = recorded_run.pose_at(path, begins[number])
        axes.plot(x, y, "o", color="white", markeredgecolor="0.25", markersize=5, zorder=4)
        axes.annotate(legs[number][1], (x, y), xytext=(6, 6), textcoords="offset points", fontsize=8, color="0.25")
    for place, label, colour in ((0, "start", "white"), (-1, "end", "0.2")):
        axes.plot(*points[place], marker=dart(path["yaw"][place]), color=colour, markeredgecolor="0.2", markersize=15, zorder=5)
        handles.append(Line2D([], [], marker=dart(0.0), color=colour, markeredgecolor="0.2", markersize=12, linestyle="",
                              label=label))
    axes.legend(handles=handles, fontsize=9)
    axes.margins(0.1)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    axes.set_title(f"Path of {run['path_source']}", fontsize=11)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def centre(*both):
    """Zero at the same height."""
    for axes in both:
        limit = max(np.abs(axes.get_ylim()))
        axes.set_ylim(-limit, limit)


def draw_place(axes, run):
    """Where the base says that it is beside the recorded way."""
    feedback = run["feedback"]
    axes.grid(alpha=0.3)
    axes.axhline(0, color="0.4", linewidth=0.6)
    axes.plot(feedback["t"], 1000 * feedback["sideways"], ".-", color="C0", markersize=3, linewidth=1.2)
    colour_axis(axes, "sideways, by its views [mm]", "C0")
    turn = axes.twinx()
    turn.plot(feedback["t"], np.degrees(feedback["yaw"]), ".-", color="C3", markersize=3, linewidth=1.2)
    colour_axis(turn, "yaw [deg]", "C3")
    centre(axes, turn)


def draw_share(axes, run):
    feedback = run["feedback"]
    axes.grid(alpha=0.3)
    axes.plot(feedback["t"], 100 * feedback["share"], ".-", color="C2", markersize=3, linewidth=1.2)
    axes.set_ylim(0, 105)
    axes.set_ylabel("of the view in sight [%]")


def draw_command(axes, run):
    command = run["command"]
    if not len(command["t"]):
        note(axes, "no cmd_vel_stamped during the run")
        return
    axes.grid(alpha=0.3)
    turn = axes.twinx()
    lines = [*axes.plot(command["t"], command["ahead"], color="C0", linewidth=1.2, label="ahead"),
             *axes.plot(command["t"], command["left"], color="C2", linewidth=1.2, label="to the left"),
             *turn.plot(command["t"], np.degrees(command["turn"]), color="C3", linewidth=1.2, label="turn")]
    centre(axes, turn)
    axes.legend(handles=lines, fontsize=8, ncol=3, loc="lower right")
    axes.set_ylabel("command [m/s]")
    colour_axis(turn, "turn [deg/s]", "C3")


def draw_over_time(panels, draws, run):
    """One panel above another, each by its own function; a dotted line where the next view's turn begins."""
    feedback = run["feedback"]
    for axes, draw in zip(panels, draws):
        draw(axes, run)
        if not axes.axison:
            continue
        axes.set_xlim(0, max(duration(feedback), 1e-3))
        for begin, _ in legs_of(feedback):
            axes.axvline(feedback["t"][begin], color="0.3", linewidth=0.8, linestyle=":")
    panels[0].set_title("a dotted line: the next view", fontsize=10)
    panels[-1].set_xlabel("time since the first feedback [s]")


def draw_route(run, name):
    """The figure of a run along a route."""
    feedback, status, result = run["feedback"], run["status"], run["result"]
    figure = plt.figure(figsize=(16, 9), constrained_layout=True)
    left, right = figure.add_gridspec(1, 2, width_ratios=[1.2, 1])
    draw_path(figure.add_subplot(left), run)
    panels = [figure.add_subplot(place) for place in right.subgridspec(3, 1)]
    draw_over_time(panels, (draw_place, draw_share, draw_command), run)

    title = f"{name}, {os.path.dirname(run['topic']) or run['topic']}: {duration(feedback):.1f} s"
    title += f", {len(legs_of(feedback))} views"
    if len(run["path"]["t"]):
        title += f", {travelled(run['path'])[-1]:.2f} m travelled"
    if len(result["t"]):
        title += f"; {result['message'][-1]}"
    elif len(status["t"]):
        title += f"; {name_of(status['state'][-1], STATUS_STATES)}"
        title += f": {status['reason'][-1]}" if status["reason"][-1] else ""
    figure.suptitle(textwrap.fill(title, 150).replace("$", r"\$"), fontsize=13)
    return figure
