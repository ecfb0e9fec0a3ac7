# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""
Reads recorded runs and draws them: what plot_run and report share. Topics are found by type and last part of their name.
The programs import this file from their own directory, which is scripts/ or, installed, the package's bin directory.
"""
import math
import os

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import rosbag  # noqa: E402
from matplotlib.collections import LineCollection  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402
from matplotlib.patches import Patch, Rectangle  # noqa: E402
from matplotlib.ticker import StrMethodFormatter  # noqa: E402

BAD_INPUT = 2  # exit status

np.seterr(invalid="ignore")  # NaN is what is not known; an old numpy warns where it is compared.

# By the constants in Heading.msg, ServoStatus.msg.
HEADING_STATES = ["approaching", "near", "docking", "arrived", "lost"]
HEADING_COLOURS = ["#1f77b4", "#e69f00", "#8e5bb5", "#2a9d4e", "#d62728"]
UNKNOWN_COLOUR = "#7f7f7f"
STATUS_STATES = ["idle", "acquiring", "servoing", "lost", "converged", "aborted", "disabled"]
CONVERGED = STATUS_STATES.index("converged")

MOMENTS = 6           # whose histograms are drawn
ARROWS = 10           # along the path
DECADES = 3           # of votes, from the centre of a histogram to its rim
MAX_STATUS_AGE = 0.5  # between a heading and the status that gives its distance [s]
AFTERMATH = 2.0       # drawn after the last heading [s]


class BadInput(Exception):
    """Something the user can put right; its text names the file."""


# ------------------------------------------------------------------------------------------------------- reading


def nearest_topic(topics, found, beside):
    """Of the topics `found` the one nearest to `beside`, then the busiest; or None."""
    return max(found, default=None,
               key=lambda topic: (len(os.path.commonprefix([topic.split("/"), beside.split("/")])),
                                  topics[topic].message_count))


def find_topic(topics, message_type, name, beside=""):
    """The topic of that type and last name, of several the one nearest to `beside`, then the busiest; or None."""
    return nearest_topic(topics, [topic for topic, info in topics.items() if info.msg_type == message_type and
                                  topic.split("/")[-1] == name and info.message_count > 0], beside)


def find_odometry(topics, beside=""):
    """The topic of odometry: odom, or where there is none of that name, one of any name, as of a filter; or None."""
    kind = "nav_msgs/Odometry"
    return find_topic(topics, kind, "odom", beside) or nearest_topic(
        topics, [topic for topic, info in topics.items() if info.msg_type == kind and info.message_count > 0], beside)


def read_odometry(bag, topics, beside):
    """The table of the base's poses by odometry."""
    return read_table(bag, find_odometry(topics, beside), {
        "x": lambda m: m.pose.pose.position.x,
        "y": lambda m: m.pose.pose.position.y,
        "yaw": lambda m: yaw_of_base(m.pose.pose.orientation),
    })


def read_table(bag, topic, columns):
    """A topic's messages by stamp: arrays "t" [s] and those that `columns` gets from a message; empty without one."""
    rows = []
    if topic is not None:
        for _, message, received in bag.read_messages(topics=[topic]):
            stamp = message.header.stamp.to_sec() or received.to_sec()
            rows.append([stamp] + [column(message) for column in columns.values()])
    rows.sort(key=lambda row: row[0])
    table = {}
    for place, name in enumerate(["t", *columns]):
        is_number = not rows or isinstance(rows[0][place], (int, float))
        table[name] = np.empty(len(rows), dtype=float if is_number else object)
        for i, row in enumerate(rows):
            table[name][i] = row[place]
    return table


def select(table, chosen):
    return {name: values[chosen] for name, values in table.items()}


def yaw_of_base(q):
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def yaw_of_optical(q):
    """Where its z axis points."""
    return math.atan2(2 * (q.y * q.z - q.w * q.x), 2 * (q.x * q.z + q.w * q.y))


def find_run(bag, message_type, name):
    """
    The topic that a run is known by, or None; all topics; and a function (message_type, name, columns) that reads the table
    of another topic of the same run.
    """
    topics = bag.get_type_and_topic_info().topics
    topic = find_topic(topics, message_type, name)

    def table(message_type, name, columns):
        return read_table(bag, find_topic(topics, message_type, name, topic), columns)

    return topic, topics, table


def read_homing(bag):
    """A mobile base's run; None without headings. Its times begin with the first heading, at "start" by the bag's clock."""
    topic, topics, table = find_run(bag, "view_servo/Heading", "heading")
    if topic is None:
        return None

    heading = read_table(bag, topic, {
        "heading": lambda m: m.heading,
        "yaw_error": lambda m: m.yaw_error,
        "histogram": lambda m: np.array(m.histogram, dtype=float),
        "roi_min": lambda m: m.roi_min,
        "roi_max": lambda m: m.roi_max,
        "similarity": lambda m: m.similarity,
        "state": lambda m: m.state,
    })
    status = table("view_servo/ServoStatus", "status", {
        "state": lambda m: m.state,
        "reason": lambda m: str(m.reason),
        "translation_error": lambda m: m.translation_error,
    })
    # In a dry run the commands go to the other topic.
    has_commands = find_topic(topics, "geometry_msgs/TwistStamped", "cmd_vel_stamped", topic) is not None
    command = table("geometry_msgs/TwistStamped", "cmd_vel_stamped" if has_commands else "cmd_vel_dry_stamped", {
        "ahead": lambda m: m.twist.linear.x,
        "left": lambda m: m.twist.linear.y,
        "turn": lambda m: m.twist.angular.z,
    })
    ground_truth = table("geometry_msgs/PoseStamped", "ground_truth", {
        "x": lambda m: m.pose.position.x,
        "y": lambda m: m.pose.position.y,
        "yaw": lambda m: yaw_of_optical(m.pose.orientation),
    })
    odometry = read_odometry(bag, topics, topic)

    start = heading["t"][0]
    end = heading["t"][-1] + AFTERMATH
    for t in (heading, status, command, ground_truth, odometry):
        t.update(select(t, (t["t"] >= start) & (t["t"] <= end)))
        t["t"] = t["t"] - start
    for path in (ground_truth, odometry):
        path.update(select(path, np.isfinite(path["x"]) & np.isfinite(path["y"]) & np.isfinite(path["yaw"])))
        path["yaw"] = np.unwrap(path["yaw"])
    has_truth = len(ground_truth["t"]) > 0
    return {
        "kind": "homing",
        "topic": topic,
        "start": start,
        "heading": heading,
        "status": status,
        "command": command,
        "path": ground_truth if has_truth else odometry,
        "path_source": "the camera, ground truth" if has_truth else "the base, by odometry",
    }


# ------------------------------------------------------------------------------------------------------- drawing


def note(axes, text):
    """In the place of a panel that there is nothing for."""
    axes.set_axis_off()
    axes.add_patch(Rectangle((0, 0), 1, 1, transform=axes.transAxes, facecolor="0.97", edgecolor="0.8",
                             clip_on=False))
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="0.4", style="italic")


def name_of(state, names):
    return names[int(state)] if state < len(names) else f"state {int(state)}"


def colour_of(state):
    return HEADING_COLOURS[int(state)] if state < len(HEADING_COLOURS) else UNKNOWN_COLOUR


def duration(table):
    return table["t"][-1] if len(table["t"]) else 0.0


def pose_at(path, t):
    return tuple(np.interp(t, path["t"], path[name]) for name in ("x", "y", "yaw"))


def travelled(path):
    """Length of the path up to each of its poses [m]."""
    steps = np.hypot(np.diff(path["x"]), np.diff(path["y"]))
    return np.concatenate([[0.0], np.cumsum(steps)])[:len(path["t"])]


def last_words(status):
    """How the last goal ended, or what there is of it, for a title: what a driver without a goal says is left out."""
    goals = [i for i, state in enumerate(status["state"]) if name_of(state, STATUS_STATES) not in ("idle", "disabled")]
    if not len(status["t"]):
        return ""
    last = goals[-1] if goals else -1
    reason = status["reason"][last]
    return f"; {name_of(status['state'][last], STATUS_STATES)}" + (f": {reason}" if reason else "")


def status_distance(status, t):
    """translation_error at times; NaN where there is no status near in time."""
    if not len(status["t"]):
        return np.full(len(t), np.nan)
    after = np.searchsorted(status["t"], t).clip(1, max(len(status["t"]) - 1, 1))
    nearest = after - 1 if len(status["t"]) == 1 else \
        np.where(t - status["t"][after - 1] <= status["t"][after] - t, after - 1, after)
    fresh = np.abs(status["t"][nearest] - t) <= MAX_STATUS_AGE
    return np.where(fresh, status["translation_error"][nearest], np.nan)


def choose_moments(run):
    """Indices of headings with a histogram, evenly spread over the distance left; also over time, if too few."""
    heading, path = run["heading"], run["path"]
    voted = np.array([i for i, votes in enumerate(heading["histogram"])
                      if len(votes) > 1 and np.any(np.isfinite(votes) & (votes > 0))], dtype=int)
    if not len(voted):
        return voted
    t = heading["t"][voted]
    left = status_distance(run["status"], t)
    if len(path["t"]):
        length = travelled(path)
        left = np.where(np.isfinite(left), left, length[-1] - np.interp(t, path["t"], length))
    if not np.all(np.isfinite(left)):
        left = t[-1] - t
    moments = {int(np.abs(left - wanted).argmin()) for wanted in np.linspace(left.max(), left.min(), MOMENTS)}
    while len(moments) < min(MOMENTS, len(t)):
        moments.add(int(np.abs(t[:, None] - t[list(moments)][None, :]).min(axis=1).argmax()))
    return voted[sorted(moments)]


def dart(yaw):
    """A marker that points there."""
    outline = np.array([(1.0, 0.0), (-0.8, 0.65), (-0.45, 0.0), (-0.8, -0.65), (1.0, 0.0)])
    c, s = math.cos(yaw), math.sin(yaw)
    return outline @ np.array([(c, s), (-s, c)])


def draw_path(axes, run, moments):
    """From above, in the colours of the states, with the published headings."""
    heading, path = run["heading"], run["path"]
    if not len(path["t"]):
        note(axes, "no ground_truth and no odometry during the run")
        return
    points = np.column_stack([path["x"], path["y"]])
    before = np.maximum(np.searchsorted(heading["t"], path["t"], side="right") - 1, 0)
    colours = [colour_of(state) for state in heading["state"][before]]
    axes.add_collection(LineCollection(list(zip(points[:-1], points[1:])), colors=colours[1:], linewidths=2.5,
                                       capstyle="round", zorder=2))

    known = np.flatnonzero(np.isfinite(heading["heading"]) & (heading["t"] >= path["t"][0]) &
                           (heading["t"] <= path["t"][-1]))
    if len(known):
        way = np.interp(heading["t"][known], path["t"], travelled(path))
        places = {int(np.abs(way - wanted).argmin()) for wanted in np.linspace(way[0], way[-1], ARROWS)}
        chosen = known[sorted(places)]
        x, y, yaw = pose_at(path, heading["t"][chosen])
        direction = yaw + heading["heading"][chosen]
        axes.quiver(x, y, np.cos(direction), np.sin(direction), angles="xy", scale_units="inches", scale=2.2,
                    units="inches", width=0.018, headwidth=5, headlength=7, headaxislength=6, color="0.25", zorder=3)
    aside = math.atan2(*(points[-1] - points[0])[::-1]) - math.pi / 2
    for number, t in enumerate(heading["t"][moments], 1):
        if path["t"][0] <= t <= path["t"][-1]:
            x, y, _ = pose_at(path, t)
            axes.plot(x, y, "o", color="white", markeredgecolor="0.25", markersize=5, zorder=4)
            axes.annotate(str(number), (x, y), xytext=(13 * math.cos(aside), 13 * math.sin(aside)),
                          textcoords="offset points", ha="center", va="center", fontsize=9, color="0.25")

    handles = []
    converged = run["status"]["t"][run["status"]["state"] == CONVERGED]
    if len(converged):
        x, y, _ = pose_at(path, converged[-1])
        handles += axes.plot(x, y, "*", color="#ffd23f", markeredgecolor="0.2", markersize=24, zorder=5, linestyle="",
                             label="view (here it converged)")
    for place, label, colour in ((0, "start", "white"), (-1, "end", "0.2")):
        axes.plot(*points[place], marker=dart(path["yaw"][place]), color=colour, markeredgecolor="0.2", markersize=17,
                  zorder=6 if place == 0 else 7)
        handles.append(Line2D([], [], marker=dart(0.0), color=colour, markeredgecolor="0.2", markersize=12,
                              linestyle="", label=label))
    handles.append(Line2D([], [], marker=r"$\rightarrow$", color="0.25", markersize=14, linestyle="",
                          label="heading, published"))
    if len(moments):
        handles.append(Line2D([], [], marker="o", color="white", markeredgecolor="0.25", markersize=5, linestyle="",
                              label="histogram below"))
    axes.legend(handles=handles, fontsize=9, labelspacing=0.7)

    pad = max(0.15 * np.ptp(points, axis=0).max(), 0.05)
    # auto: fixed limits would be widened for the aspect just as well, but with a complaint on standard error.
    axes.set_xlim(points[:, 0].min() - pad, points[:, 0].max() + pad, auto=True)
    axes.set_ylim(points[:, 1].min() - pad, points[:, 1].max() + pad, auto=True)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    axes.set_title(f"Path of {run['path_source']}", fontsize=11)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def draw_histograms(figure, place, run, moments):
    """Votes for directions on a logarithmic scale, ahead is up; the heading (thick) and its region (dashed)."""
    heading = run["heading"]
    if not len(moments):
        note(figure.add_subplot(place), "no heading histograms")
        return
    above, below = place.subgridspec(2, 1, height_ratios=[1, 5])
    caption = figure.add_subplot(above)
    caption.set_axis_off()
    text = caption.text(0.5, 0.5, "Votes for headings, logarithmic: from a ring to the next ten times as many.  "
                        "Thick: the heading taken.  Dashed: region of interest.", ha="center", va="center", fontsize=11)
    text.set_in_layout(False)
    histograms = [np.nan_to_num(heading["histogram"][i], nan=0.0, posinf=0.0, neginf=0.0) for i in moments]
    floor = max(votes.max() for votes in histograms) / 10**DECADES
    behind = np.any(np.abs(heading["heading"][moments]) > math.pi / 2 + 1e-6)
    distances = status_distance(run["status"], heading["t"][moments])
    grid = below.subgridspec(1, MOMENTS)
    for column, (i, votes) in enumerate(zip(moments, histograms)):
        axes = figure.add_subplot(grid[0, column], projection="polar")
        axes.set_theta_zero_location("N")
        axes.set_thetalim(*((-math.pi, math.pi) if behind else (-math.pi / 2, math.pi / 2)))
        ticks = np.arange(-135, 181, 45) if behind else np.arange(-90, 91, 45)
        labels = [f"{tick:+d}°" if tick % 180 else f"{tick}°" for tick in ticks]
        axes.set_xticks(np.radians(ticks))
        axes.set_xticklabels(labels, fontsize=8, color="0.3")
        axes.tick_params(axis="x", pad=0)
        axes.set_ylim(0, DECADES)
        axes.set_yticks(range(1, DECADES + 1))
        axes.set_yticklabels([])
        axes.grid(color="0.75", linewidth=0.7)
        axes.set_axisbelow(True)

        state = heading["state"][i]
        angles = np.linspace(-math.pi / 2, math.pi / 2, len(votes))
        radii = np.log10(np.maximum(votes / floor, 1.0))
        axes.fill_between(angles, 0, radii, color=colour_of(state), alpha=0.3, linewidth=0)
        axes.plot(angles, radii, color=colour_of(state), linewidth=1)
        for bound in (heading["roi_min"][i], heading["roi_max"][i]):
            if np.isfinite(bound):
                bound = np.clip(bound, -math.pi / 2, math.pi / 2)
                axes.plot([bound, bound], [0, DECADES], "--", color="0.2", linewidth=1.2)
        if np.isfinite(heading["heading"][i]):
            axes.plot([heading["heading"][i]] * 2, [0, DECADES], color="0.1", linewidth=3.5, solid_capstyle="butt",
                      zorder=1.5)
        title = f"{column + 1}: {heading['t'][i]:.1f} s, {name_of(state, HEADING_STATES)}"
        if np.isfinite(distances[column]):
            title += f"\n{distances[column]:.3g} m left" if distances[column] >= 0.1 else \
                f"\n{1000 * distances[column]:.3g} mm left"
        axes.annotate(title, (0, DECADES), xytext=(0, 20), textcoords="offset points", ha="center", fontsize=10)


def shade_states(axes, heading):
    """The states as background."""
    changes = np.concatenate([[0], np.flatnonzero(np.diff(heading["state"])) + 1, [len(heading["t"]) - 1]])
    for begin, end in zip(changes[:-1], changes[1:]):
        axes.axvspan(heading["t"][begin], heading["t"][end], color=colour_of(heading["state"][begin]), alpha=0.16,
                     linewidth=0, zorder=0)


def colour_axis(axes, label, colour):
    axes.set_ylabel(label, color=colour)
    axes.tick_params(axis="y", colors=colour)


def draw_similarity(axes, run):
    heading = run["heading"]
    if not np.any(np.isfinite(heading["similarity"])):
        note(axes, "no similarity in the headings")
        return
    shade_states(axes, heading)
    axes.plot(heading["t"], heading["similarity"], ".-", color="0.15", markersize=3, linewidth=1.2)
    axes.margins(y=0.2)
    axes.grid(alpha=0.3)
    axes.set_ylabel("similarity")


def draw_errors(axes, run):
    heading, status = run["heading"], run["status"]
    distance = np.where(status["translation_error"] > 0, status["translation_error"], np.nan)
    has_distance = np.any(np.isfinite(distance))
    has_yaw = np.any(np.isfinite(heading["yaw_error"]))
    if not has_distance and not has_yaw:
        note(axes, "no yaw error in the headings, " + ("no translation error in status" if len(status["t"]) else
                                                       "no status"))
        return
    shade_states(axes, heading)
    axes.grid(alpha=0.3)
    if has_distance:
        axes.plot(status["t"], 1000 * distance, ".-", color="C0", markersize=3, linewidth=1.2)
        if np.nanmax(distance) > 10 * np.nanmin(distance):
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        colour_axis(axes, "translation error [mm]", "C0")
    else:
        axes.set_yticks([])
        axes.set_ylabel("translation error:\n" + ("not known" if len(status["t"]) else "no status"), color="0.4",
                        style="italic")
    if has_yaw:
        yaw_axes = axes.twinx()
        yaw_axes.plot(heading["t"], np.degrees(heading["yaw_error"]), ".-", color="C3", markersize=3, linewidth=1.2)
        yaw_axes.axhline(0, color="C3", linewidth=0.6)
        colour_axis(yaw_axes, "yaw error [deg]", "C3")


def draw_command(axes, run):
    """Returns the axes of turns; None without commands."""
    heading, command = run["heading"], run["command"]
    values = np.concatenate([command["ahead"], command["left"], command["turn"]])
    if not np.any(np.isfinite(values)):
        note(axes, "no cmd_vel_stamped during the run")
        return None
    shade_states(axes, heading)
    turn_axes = axes.twinx()
    lines = [
        *axes.plot(command["t"], command["ahead"], color="C0", linewidth=1.2, label="ahead"),
        *axes.plot(command["t"], command["left"], color="C2", linewidth=1.2, label="to the left"),
        *turn_axes.plot(command["t"], np.degrees(command["turn"]), color="C3", linewidth=1.2, label="turn"),
    ]
    for a in (axes, turn_axes):  # Zero at the same height.
        limit = max(np.abs(a.get_ylim()))
        a.set_ylim(-limit, limit)
    axes.grid(alpha=0.3)
    axes.legend(handles=lines, fontsize=8, ncol=3, loc="lower right")
    axes.set_ylabel("command [m/s]")
    colour_axis(turn_axes, "turn [deg/s]", "C3")
    return turn_axes


def draw_over_time(panels, run, moments):
    """Similarity, errors and commands, in panels with these names. Returns what draw_command() does."""
    heading = run["heading"]
    draw_similarity(panels["similarity"], run)
    draw_errors(panels["errors"], run)
    turn_axes = draw_command(panels["command"], run)
    seen = sorted(set(heading["state"]))
    over_time = [panels[panel] for panel in ("similarity", "errors", "command") if panels[panel].axison]
    end = max(duration(heading), duration(run["status"]), duration(run["command"]))
    for axes in over_time:
        axes.set_xlim(0, max(end, 1e-3))
        axes.tick_params(labelbottom=axes is over_time[-1])
        for number, t in enumerate(heading["t"][moments], 1):
            axes.axvline(t, color="0.3", linewidth=0.8, linestyle=":")
            if axes is over_time[0]:
                axes.annotate(str(number), (t, 1), xycoords=("data", "axes fraction"), xytext=(2, -10),
                              textcoords="offset points", fontsize=8, color="0.3")
    if over_time:
        over_time[0].legend(handles=[Patch(color=colour_of(s), alpha=0.45, label=name_of(s, HEADING_STATES))
                                     for s in seen],
                            loc="lower left", bbox_to_anchor=(0.0, 1.0), ncol=len(seen), frameon=False, fontsize=9)
        over_time[-1].set_xlabel("time since the first heading [s]")
    return turn_axes


def draw_homing(run, name):
    """The figure of a mobile base's run."""
    heading, status = run["heading"], run["status"]
    moments = choose_moments(run)
    figure = plt.figure(figsize=(16, 10.5), constrained_layout=True)
    top, bottom = figure.add_gridspec(2, 1, height_ratios=[3.1, 1.1])
    left, right = top.subgridspec(1, 2)
    panels = {name: figure.add_subplot(place)
              for name, place in zip(("similarity", "errors", "command"), right.subgridspec(3, 1))}
    draw_path(figure.add_subplot(left), run, moments)
    draw_over_time(panels, run, moments)
    draw_histograms(figure, bottom, run, moments)

    title = f"{name}, {run['topic']}: {duration(heading):.1f} s"
    if len(run["path"]["t"]):
        title += f", {travelled(run['path'])[-1]:.2f} m travelled"
    title += last_words(status)
    figure.suptitle(title.replace("$", r"\$"), fontsize=13)
    return figure


def read_arm(bag):
    """An arm's run; None without errors of servoing. Its times begin with the first of them."""
    topic, _, table = find_run(bag, "view_servo/ServoError", "servo_error")
    if topic is None:
        return None

    def length(v):
        return math.hypot(v.x, v.y, v.z)

    run = {
        "kind": "arm",
        "topic": topic,
        "error": read_table(bag, topic, {
            "point_x": lambda m: m.point_x, "point_y": lambda m: m.point_y,
            "wanted_x": lambda m: m.wanted_x, "wanted_y": lambda m: m.wanted_y,
            "log_depth": lambda m: m.log_depth,
            "turn_x": lambda m: m.rotation.x, "turn_y": lambda m: m.rotation.y, "turn_z": lambda m: m.rotation.z,
            "gain_x": lambda m: m.gain_x, "gain_y": lambda m: m.gain_y,
            "translation_error": lambda m: m.translation_error, "rotation_error": lambda m: m.rotation_error,
            "speed": lambda m: length(m.twist.linear), "turn_rate": lambda m: length(m.twist.angular),
        }),
        "homography": table("view_servo/Homography", "homography", {
            "valid": lambda m: float(m.valid), "inliers": lambda m: float(m.inliers),
            "matches": lambda m: float(m.matches)}),
        "status": table("view_servo/ServoStatus", "status",
                        {"state": lambda m: m.state, "reason": lambda m: str(m.reason)}),
        "truth": table("geometry_msgs/PoseStamped", "ground_truth", {
            "x": lambda m: m.pose.position.x, "y": lambda m: m.pose.position.y, "z": lambda m: m.pose.position.z}),
    }
    start = run["error"]["t"][0]
    end = run["error"]["t"][-1] + AFTERMATH
    run["start"] = start
    for name in ("error", "homography", "status", "truth"):
        run[name]["t"] = run[name]["t"] - start
        run[name] = select(run[name], (run[name]["t"] >= -AFTERMATH) & (run[name]["t"] <= end - start))
    return run


def draw_point_path(axes, error):
    """In the image, as the camera sees it."""
    axes.plot(error["point_x"], error["point_y"], "-", color="0.75", linewidth=1)
    points = axes.scatter(error["point_x"], error["point_y"], s=9, c=error["t"], cmap="viridis")
    axes.plot(error["point_x"][0], error["point_y"][0], "o", color="black", markersize=8, fillstyle="none",
              label="first")
    axes.plot(error["wanted_x"][-1], error["wanted_y"][-1], "+", color="C3", markersize=14, markeredgewidth=2,
              label="in the stored view")
    axes.figure.colorbar(points, ax=axes, label="time [s]", shrink=0.7)
    axes.set_aspect("equal", adjustable="datalim")
    axes.invert_yaxis()
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    axes.set_xlabel("u [px]")
    axes.set_ylabel("v [px]")
    axes.set_title("the chosen point in the image", fontsize=10)


ARM_CURVES = ("point", "depth", "gains", "twist", "inliers")


def draw_arm_curves(panels, run):
    """Errors, gains and twist against time, in panels of the names ARM_CURVES. Returns the axes of turns of the twist."""
    error, homography = run["error"], run["homography"]
    curves = {
        "point": ("point error [px]", [(error["point_x"] - error["wanted_x"], "x"),
                                       (error["point_y"] - error["wanted_y"], "y")]),
        "depth": ("turn [deg]", [(np.degrees(error[f"turn_{axis}"]), axis) for axis in "xyz"]),
        "gains": ("adaptive gain", [(error["gain_x"], "x"), (error["gain_y"], "y")]),
        "twist": ("speed [mm/s]", [(1e3 * error["speed"], "speed")]),
    }
    for panel, (label, lines) in curves.items():
        for i, (values, line) in enumerate(lines):
            panels[panel].plot(error["t"], values, color=f"C{i}", linewidth=1.4, label=line)
        panels[panel].set_ylabel(label, fontsize=9)
        panels[panel].grid(alpha=0.3)
        panels[panel].legend(fontsize=8, loc="upper right")
    panels["gains"].set_ylim(-0.05, 1.1)
    depth = panels["depth"].twinx()
    depth.plot(error["t"], error["log_depth"], color="C3", linewidth=1.4)
    colour_axis(depth, "log(Z / Z*)", "C3")
    turn = panels["twist"].twinx()
    turn.plot(error["t"], np.degrees(error["turn_rate"]), color="C3", linewidth=1.4)
    colour_axis(turn, "turn [deg/s]", "C3")
    if len(homography["t"]):
        panels["inliers"].plot(homography["t"], homography["matches"], color="0.7", label="looked for")
        panels["inliers"].plot(homography["t"], homography["inliers"], color="C0", label="found")
        panels["inliers"].legend(fontsize=8, loc="lower right")
    panels["inliers"].set_ylim(bottom=0)
    panels["inliers"].set_ylabel("points", fontsize=9)
    panels["inliers"].grid(alpha=0.3)
    panels["inliers"].set_xlabel("time since the first error [s]")
    for panel in ARM_CURVES:
        panels[panel].set_xlim(0, max(duration(error), 1e-3))
        panels[panel].tick_params(labelbottom=panel == "inliers")
    return turn


def draw_arm_distance(axes, run):
    """How far the camera is from the view, against time."""
    error, truth = run["error"], run["truth"]
    axes.plot(error["t"], 1e3 * error["translation_error"], color="C0", label="distance from the view, estimated [mm]")
    axes.plot(error["t"], np.degrees(error["rotation_error"]), color="C3", label="rotation, estimated [deg]")
    if len(truth["t"]) > 1:
        place = np.stack([truth[axis] for axis in "xyz"], axis=1)
        axes.plot(truth["t"], 1e3 * np.linalg.norm(place - place[-1], axis=1), ":", color="0.3",
                  label="distance from where it ended, true [mm]")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_ylim(bottom=0.01)
    axes.grid(which="both", alpha=0.2)
    axes.legend(fontsize=8)
    axes.set_xlabel("time since the first error [s]")
    axes.set_xlim(0, max(duration(error), 1e-3))


def draw_arm(run, name):
    """The figure of an arm's run."""
    error, status = run["error"], run["status"]
    figure = plt.figure(figsize=(16, 9.5), constrained_layout=True)
    left, right = figure.add_gridspec(1, 2)
    places = [*left.subgridspec(2, 1, height_ratios=[3, 2]), *right.subgridspec(5, 1)]
    panels = {name: figure.add_subplot(place) for name, place in zip(("path", "distance", *ARM_CURVES), places)}
    draw_point_path(panels["path"], error)
    draw_arm_curves(panels, run)
    draw_arm_distance(panels["distance"], run)

    title = f"{name}, {run['topic']}: {duration(error):.1f} s"
    title += last_words(status)
    figure.suptitle(title.replace("$", r"\$"), fontsize=13)
    return figure


# The kinds of runs: what reads one from a bag, giving None when it is not in there, and what draws it.
KINDS = ((read_homing, draw_homing), (read_arm, draw_arm))


def read_bag(path, read):
    """What `read` makes of an open bag; a file that is no bag, or a damaged one, is BadInput with cause and remedy."""
    try:
        with rosbag.Bag(path) as bag:
            return read(bag)
    except BadInput:
        raise
    except rosbag.ROSBagUnindexedException as error:
        raise BadInput(f"{path}: it has no index; try `rosbag reindex`") from error
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or error}") from error
    except Exception as error:  # What a broken bag makes rosbag raise has no common base.
        raise BadInput(f"{path}: not a bag that can be read: {type(error).__name__}: {error}") from error


def read_run(bag, kinds=KINDS):
    """The run in an open bag, and what draws it; None when there is none."""
    for read, draw in kinds:
        run = read(bag)
        if run is not None:
            return run, draw
    return None


def load(path, kinds=KINDS):
    """The run in a bag, and what draws it."""
    found = read_bag(path, lambda bag: read_run(bag, kinds))
    if found is None:
        raise BadInput(f"{path}: there are no view_servo/Heading messages on a topic called heading, "
                       "and no view_servo/ServoError messages on one called servo_error")
    return found
