"""The robot as a skeleton, joints as dots and bodies as lines between them, moving."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from identifiability.foundation.names import Array
from identifiability.foundation.quoting import for_svg
from identifiability.robot import Motion, Robot
from identifiability.robot.kinematics import Point, shortest_turn

from .answers.common import sentence
from .blocks import Moving, Trace
from .figures import POINTS

#: Size of the drawing and the margin around it [px].
WIDTH, HEIGHT, MARGIN = 400, 280, 30

#: Direction that one looks along: azimuth and height [rad].
TURN, LIFT = -0.95, 0.42


def _trace(
    robot: Robot, poses: Array, load: Point | None = None
) -> tuple[Array, list[tuple[int, int]]]:
    """Return points (F, P, 3) [m], joints first, and the pairs of points that bodies connect.

    Where a body carries a load, its centre comes after the joints.

    Of F poses (F, nq). A body goes from its joint to the joints that it carries, and to the points
    at which loops close. A body without any of these goes to its centre of mass, and as far again.
    """
    tree = robot.tree
    known = robot.nominal
    count = len(tree.joints)
    frames = tree.frames(poses, range(count))
    points = [frames.origin[k] for k in range(count)]
    lines: list[tuple[int, int]] = []
    if load is not None:
        lines.append((load.joint, len(points)))
        points.append(tree.world_point(frames, load))
    closing = [p for loop in robot.loops for p in (loop.first, loop.second)]
    for body, link in zip(robot.bodies, robot.links, strict=True):
        k = link.last
        hanging = [c for c, j in enumerate(tree.joints) if j.parent == k]
        ends = [tree.world_point(frames, p) for p in closing if p.joint == k]
        mass = known.get(f"{body}.m", 0.0)
        if not (hanging or ends) and mass > 0:
            first = np.array([known.get(f"{body}.{x}", 0.0) for x in ("mx", "my", "mz")])
            ends = [tree.world_point(frames, Point(k, 1.6 * first / mass))]
        lines += [(k, joint) for joint in hanging]
        lines += [(k, len(points) + at) for at in range(len(ends))]
        points += ends
    # Coordinates of fixed points are (3, 1).
    return np.stack([np.broadcast_to(x.T, (len(poses), 3)) for x in points], 1), lines


#: Poses that are drawn of a motion, at most, and how many a second.
MOST_FRAMES, FRAMES_A_SECOND = 300, 25.0

#: Seconds of a log that are drawn.
STRETCH = MOST_FRAMES / FRAMES_A_SECOND


def move_skeletons(
    robot: Robot,
    t: Array,
    motions: Mapping[str, tuple[str, Array]],
    told: Callable[[Array], Sequence[Sequence[str]]],
    caption: str,
    load: Point | None = None,
) -> Moving | None:
    """Return robots along a motion, one over the other; None if nothing can be drawn.

    Parameters
    ----------
    robot : Robot
    t : (N,) [s]
    motions : mapping
        Name to tone and configurations (N, nq); NaN where there are none.
    told : callable
        Returns the text for rows (F,), for each motion but the first or for the torque.
    caption : str
    load : Point, optional
        Centre of mass of what hangs on a body.
    """
    rows = _frames(t)
    traced = []
    lines: list[tuple[int, int]] = []
    for _, poses in motions.values():
        points, lines = _trace(robot, np.nan_to_num(poses[rows]), load)
        traced.append(
            np.where(
                np.isnan(poses[rows]).any(1)[:, None, None],
                np.nan,
                points,
            )
        )
    if not np.ptp(traced[0].reshape(-1, 3), axis=0).max() > 0:
        return None
    place = _look(traced[0].reshape(-1, 3), robot)
    return Moving(
        names=tuple((name, tone) for name, (tone, _) in motions.items()),
        t=t[rows] - t[0],
        points=tuple(place(x.reshape(-1, 3)).reshape(*x.shape[:2], 2) for x in traced),
        lines=tuple(lines),
        joints=len(robot.tree.joints) + (load is not None),
        told=tuple(map(tuple, told(rows))),
        size=(WIDTH, HEIGHT),
        caption=caption,
    )


def _frames(t: Array) -> np.ndarray:
    """Return the rows of times (N,) that are drawn."""
    frames = int(
        np.clip(
            (t[-1] - t[0]) * FRAMES_A_SECOND,
            2,
            MOST_FRAMES,
        )
    )
    return np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], frames)).clip(0, len(t) - 1))


def move_with_torque(
    robot: Robot,
    motion: Motion,
    t: Array,
    torque: Array,
    lines: Mapping[str, Array],
    log: str,
    residual: Array | None = None,
    how: str = "",
    load: Point | None = None,
) -> Moving | None:
    """Return the robot along its motion, over torque of a joint; None if there is nothing to show.

    With a residual, the joint with the largest residual is shown, and marks of joints grow with
    theirs; without, the one that is loaded most. A load is marked at its centre of mass.

    Parameters
    ----------
    robot : Robot
    motion : Motion
        Of a log.
    t : (N,) [s]
        Times of the drawing, beginning with the first seconds.
    torque : (N, n)
        What was measured; NaN where it is no data.
    lines : mapping of str to (N, n)
        What is drawn of a joint.
    log : str
        What the log is called.
    residual : (N, n), optional
        What a model leaves of the torque.
    how : str, optional
        Key of its text (`moving` of the sentences).
    load : Point, optional
    """
    if len(t) < 2 or not np.isfinite(torque).any():
        return None
    end = int(np.searchsorted(t, t[0] + STRETCH, "right"))
    size = np.sqrt(np.nan_to_num(torque**2).mean(0))
    share = np.zeros((len(t), len(size)))
    if residual is not None:
        share = np.nan_to_num(
            np.abs(residual)
            / np.where(
                size > 0,
                size,
                np.inf,
            )
        )
    joint = int((size if residual is None else (share**2).mean(0)).argmax())
    rows = np.searchsorted(motion.t, t[:end]).clip(0, len(motion.t) - 1)
    name = robot.joints[joint]
    unit = robot.torque_units[joint]
    how = how or ("loaded" if residual is None else "missed")
    word = "misses" if how == "missed" else "differs by"
    missed = [f"{name} {word} {100 * x:.0f} %" for x in share[:, joint]]
    moving = move_skeletons(
        robot,
        t[:end],
        {"measured": ("grey", motion.q[rows])},
        lambda at: [] if residual is None else [[missed[k] for k in at]],
        sentence(
            "moving",
            how,
            log=log,
            joint=name,
        ),
        load,
    )
    if moving is None:
        return None
    own = {what: y[:end, joint] for what, y in lines.items()}
    moving = replace(
        moving,
        torque=Trace.of(
            for_svg(name),
            unit,
            t[:end] - t[0],
            own,
            POINTS,
        ),
    )
    if load is not None:  # as large in all frames
        marks = np.arange(moving.joints) == moving.joints - 1
        return replace(moving, misses=np.tile(0.3 * marks, (moving.frames, 1)))
    if residual is None:
        return moving
    owners = {dof: k for k, one in enumerate(robot.tree.joints) for dof in one.dofs}
    misses = np.zeros((moving.frames, moving.joints))
    misses[:, [owners[j] for j in robot.joints]] = share[_frames(t[:end])]
    return replace(moving, misses=misses)


def _look(points: Array, robot: Robot) -> Callable[[Array], Array]:
    """Return the projection of points (N, 3) to the paper, (N, 2) [px], scaled to `points`."""
    up = np.array([0.0, 0.0, 1.0])
    gravity = robot.gravity
    vertical = -gravity / np.linalg.norm(gravity) if gravity.any() else up
    east, north, _ = pin.exp3(shortest_turn(up, vertical)).T
    ahead = np.cos(TURN)
    aside = np.sin(TURN)
    right = ahead * east + aside * north
    level = ahead * north - aside * east
    away = np.cos(LIFT) * level - np.sin(LIFT) * vertical
    paper = np.stack([right, -np.cross(right, away)], 1)
    shown = points @ paper
    low = shown.min(0)
    high = shown.max(0)
    least = 1e-9 + 0.02 * float(np.max(high - low))
    size = np.array([WIDTH, HEIGHT], float)
    scale = np.min((size - 2 * MARGIN) / np.maximum(high - low, least))
    shift = size / 2 - scale * (low + high) / 2
    return lambda x: scale * (x @ paper) + shift
