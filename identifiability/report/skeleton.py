"""The robot as a skeleton, coloured by what a page is about, beside the answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
from markupsafe import Markup, escape

from identifiability.estimation.verdict import Class, Flag, Verdict
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import join, mark_of
from identifiability.foundation.values import frozen
from identifiability.report.blocks import Moving, Sketch, Trace
from identifiability.robot import Motion, Robot
from identifiability.robot.kinematics import WORLD, Point, shortest_turn
from identifiability.workflows.answers import sentence

# The robot as a skeleton: joints as dots, bodies as lines between them, coloured by verdict.


#: Size of the drawing and the margin around it [px].
WIDTH, HEIGHT, MARGIN = 400, 380, 46
SIZE = np.array([WIDTH, HEIGHT], float)


#: A robot whose points lie in a plane up to this share of its size is drawn in that plane.
FLAT = 0.03


#: Where up is without gravity.
UP = np.array([0.0, 0.0, 1.0])

#: Direction that one looks along where the robot is not flat: azimuth and height [rad].
TURN, LIFT = -0.95, 0.42

#: Points of a line that a name may hide, and names that are shown; others are said on pointing.
DENSE, NAMES = 24, 12


@frozen
class Part:
    """How a body or a joint is shown.

    Attributes
    ----------
    tone : str
        Colour by the name of the style sheet's variable.
    text : str
        What is said where the pointer is.
    """

    tone: str
    text: str


def draw_skeleton(
    robot: Robot, pose: Array, parts: Mapping[str, Part], rest: str = ""
) -> Markup | None:
    """Return the robot in a pose as SVG, its moving parts with the attribute ``data-owner``.

    None where all its points coincide.

    Parameters
    ----------
    robot : Robot
    pose : (nq,)
        Configuration of the tree in Pinocchio's convention.
    parts : mapping
        Body, joint or axis to how it is shown; others are grey.
    rest : str
        What is said of bodies that are none of these.
    """
    traced, places = _trace(robot, pose[None])
    limbs, at = {body: lines[:, 0] for body, lines in traced.items()}, places[:, 0]
    every = np.concatenate([*limbs.values(), at])
    if not np.isfinite(every).all() or not np.ptp(every, axis=0).max() > 0:
        return None
    place = _look(every, robot)
    ground = Part("grey", rest)
    joints = list(zip(robot.tree.joints, at, strict=True))
    drawn = [_foot(*place(o[None])[0]) for j, o in joints if j.parent == WORLD]
    for body, lines in limbs.items():
        drawn.append(_limb(body, parts.get(body, ground), place(lines).reshape(-1, 2, 2)))
    for joint, origin in joints:
        drawn.append(_joint(joint.dofs, joint.kind, parts, place(origin[None])[0]))
    named = {b: lines.mean(0) for b, lines in limbs.items() if b in parts}
    if not named:  # it is about joints
        dots = {d: o for j, o in joints for d in j.dofs}
        named = {d: o for d, o in dots.items() if d in parts and parts[d].tone != "grey"}
    drawn += _names(
        {owner: place(o[None])[0] for owner, o in named.items()},
        place(np.concatenate([_between(x) for x in limbs.values()])),
    )
    return Markup(
        f'<svg class="robot" viewBox="0 0 {WIDTH} {HEIGHT}" role="group" '
        f'aria-label="{escape(robot.title or robot.name)}, drawn from its kinematics">'
        f"{''.join(drawn)}</svg>"
    )


def _trace(robot: Robot, poses: Array) -> tuple[dict[str, Array], Array]:
    """Return lines of moving bodies, (2 s, F, 3) each, and places of joints, (j, F, 3) [m].

    Of F poses (F, nq). A body goes from its joint to those that hang on it, to the points at which
    loops close, and, where there are none, to its centre of mass and as far again.
    """
    tree = robot.tree
    frames = tree.frames(poses, range(len(tree.joints)))

    def each(points: Array) -> Array:  # (3, F), or (3, 1) of what stands
        return np.broadcast_to(points.T, (len(poses), 3))

    at = np.stack([each(frames.origin[k]) for k in range(len(tree.joints))])
    limbs: dict[str, Array] = {}
    closing = [p for loop in robot.loops for p in (loop.first, loop.second)]
    for body, link in zip(robot.bodies, robot.links, strict=True):
        k = link.last
        ends = [at[c] for c, j in enumerate(tree.joints) if j.parent == k]
        ends += [each(tree.world_point(frames, p)) for p in closing if p.joint == k]
        if not ends:
            mass = robot.nominal.get(f"{body}.m", 0.0)
            first = np.array([robot.nominal.get(f"{body}.{x}", 0.0) for x in ("mx", "my", "mz")])
            if mass > 0:
                ends = [each(tree.world_point(frames, Point(k, 1.6 * first / mass)))]
        limbs[body] = np.array([p for end in ends or [at[k]] for p in (at[k], end)])
    return limbs, at


#: Poses that are drawn of a motion, at most, and how many a second.
MOST_FRAMES, FRAMES_A_SECOND = 300, 25.0

#: Seconds of a log that move beside its torque, and points of each line of that.
STRETCH, LINE = 12.0, 500


def move_skeletons(
    robot: Robot,
    t: Array,
    motions: Mapping[str, tuple[str, Array]],
    told: Callable[[Array], Sequence[Sequence[str]]],
    caption: str,
) -> Moving | None:
    """Return robots along a motion, one over the other; None where nothing can be drawn.

    Parameters
    ----------
    robot : Robot
    t : (N,) [s]
    motions : mapping
        Name to tone and configurations (N, nq); NaN where there are none.
    told : callable
        Gives what is said of rows (F,), for each motion but the first or for the torque.
    caption : str
    """
    rows = _frames(t)
    traced = []
    for _, poses in motions.values():
        limbs, at = _trace(robot, np.nan_to_num(poses[rows]))
        ends = [lines[1::2] for lines in limbs.values()]
        every = np.concatenate([at, *ends]).transpose(1, 0, 2)
        traced.append(np.where(np.isnan(poses[rows]).any(1)[:, None, None], np.nan, every))
    if not np.ptp(traced[0].reshape(-1, 3), axis=0).max() > 0:
        return None
    place = _look(traced[0].reshape(-1, 3), robot)
    lines, start = [], len(robot.tree.joints)
    for link, own in zip(robot.links, limbs.values(), strict=True):
        count = len(own) // 2
        lines += [(link.last, start + i) for i in range(count)]
        start += count
    return Moving(
        names=tuple((name, tone) for name, (tone, _) in motions.items()),
        t=t[rows] - t[0],
        points=tuple(place(x.reshape(-1, 3)).reshape(*x.shape[:2], 2) for x in traced),
        lines=tuple(lines),
        joints=len(robot.tree.joints),
        told=tuple(map(tuple, told(rows))),
        size=(WIDTH, HEIGHT),
        caption=caption,
    )


def _frames(t: Array) -> np.ndarray:
    """Return the rows of times (N,) that are drawn."""
    frames = int(np.clip((t[-1] - t[0]) * FRAMES_A_SECOND, 2, MOST_FRAMES))
    return np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], frames)).clip(0, len(t) - 1))


def move_with_torque(
    robot: Robot,
    motion: Motion,
    t: Array,
    torque: Array,
    residual: Array,
    lines: Callable[[int], Mapping[str, Array]],
    log: str,
) -> Moving | None:
    """Return the robot as it moved, its joints marked where a model misses torque.

    Below is torque of the joint of which most is missed.

    Parameters
    ----------
    robot : Robot
    motion : Motion
        Of a log.
    t : (N,) [s]
        Some of its times, of which the first seconds are shown.
    torque, residual : (N, n)
        What was measured and what the model leaves of it; NaN where it is no data.
    lines : callable
        Gives what is drawn of a joint, name to (N,).
    log : str
        What the log is called.
    """
    if len(t) < 2 or not np.isfinite(torque).any():
        return None
    end = int(np.searchsorted(t, t[0] + STRETCH, "right"))
    size = np.sqrt(np.nan_to_num(torque**2).mean(0))
    share = np.nan_to_num(np.abs(residual) / np.where(size > 0, size, np.inf))
    joint = int((share**2).mean(0).argmax())
    rows = np.searchsorted(motion.t, t[:end]).clip(0, len(motion.t) - 1)
    name, unit = robot.joints[joint], robot.torque_units[joint]
    moving = move_skeletons(
        robot,
        t[:end],
        {"measured": ("grey", motion.q[rows])},
        lambda at: [[f"{name} misses {100 * x:.0f} %" for x in share[at, joint]]],
        sentence("decision.moving", log=log, joint=name),
    )
    if moving is None:
        return None
    owners = {dof: k for k, one in enumerate(robot.tree.joints) for dof in one.dofs}
    misses = np.zeros((moving.frames, moving.joints))
    misses[:, [owners[j] for j in robot.joints]] = share[_frames(t[:end])]
    drawn = {name: y[:end] for name, y in lines(joint).items()}
    return replace(moving, torque=Trace.of(name, unit, t[:end] - t[0], drawn, LINE), misses=misses)


def _look(points: Array, robot: Robot) -> Callable[[Array], Array]:
    """Return what takes points (N, 3) to the paper, (N, 2) [px], so that some fill it.

    Of a flat robot it shows the plane, from above if it is level, else upright.
    """
    gravity = robot.gravity
    vertical = -gravity / np.linalg.norm(gravity) if gravity.any() else UP
    east, north, _ = pin.exp3(shortest_turn(UP, vertical)).T
    right = np.cos(TURN) * east + np.sin(TURN) * north
    level = np.cos(TURN) * north - np.sin(TURN) * east
    away = np.cos(LIFT) * level - np.sin(LIFT) * vertical
    _, size, axes = np.linalg.svd(points - points.mean(0), full_matrices=False)
    size = np.pad(size, (0, 3 - len(size)))
    if size[0] > 0 and size[2] < FLAT * size[0] < size[1]:
        away = -axes[2] if axes[2][np.argmax(np.abs(axes[2]))] > 0 else axes[2]
        if abs(away @ vertical) > 0.9:
            right, away = east, -vertical
        else:
            right = np.cross(away, vertical)
            right /= np.linalg.norm(right)
    paper = np.stack([right, -np.cross(right, away)], 1)
    low, high = (points @ paper).min(0), (points @ paper).max(0)
    least = 1e-9 + 0.02 * float(np.max(high - low))
    scale = np.min((SIZE - 2 * MARGIN) / np.maximum(high - low, least))
    shift = SIZE / 2 - scale * (low + high) / 2
    return lambda x: scale * (x @ paper) + shift


def _open(owner: str, part: Part) -> str:
    text = escape(f"{owner}: {part.text}" if part.text else owner)
    return (
        f'<g class="tone-{part.tone}" data-owner="{escape(owner)}" tabindex="0" role="button" '
        f'aria-pressed="false" aria-label="{text}"><title>{text}</title>'
    )


def _limb(body: str, part: Part, lines: Array) -> str:
    corners = np.unique(lines.reshape(-1, 2).round(1), axis=0)
    if len(corners) > 2:  # a plate
        middle = corners - corners.mean(0)
        corners = corners[np.argsort(np.arctan2(middle[:, 1], middle[:, 0]))]
        path, kind = f"M{'L'.join(f'{x:.1f} {y:.1f}' for x, y in corners)}Z", "limb plate"
    else:
        path = "".join(f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" for a, b in lines)
        kind = "limb"
    return f'{_open(body, part)}<path class="{kind}" d="{path}"/></g>'


def _joint(dofs: Sequence[str], kind: str, parts: Mapping[str, Part], at: Array) -> str:
    x, y = at
    shape = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="7" class="%s"/>'
    if kind == "prismatic":
        shape = f'<rect x="{x - 6:.1f}" y="{y - 6:.1f}" width="12" height="12" class="%s"/>'
    known = next((d for d in dofs if d in parts), None)
    if known is None:
        small = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.4" class="passive"/>'
        return f"<g><title>{escape(', '.join(dofs))}</title>{small}</g>"
    return f"{_open(known, parts[known])}{shape % 'joint'}</g>"


def _foot(x: float, y: float) -> str:
    """Return what a base stands on."""
    left, right, low = x - 15, x + 15, y + 11
    strokes = "".join(f"M{k:.1f} {low:.1f}l-5 6" for k in np.linspace(left + 5, right, 5))
    return f'<path class="ground" d="M{left:.1f} {low:.1f}H{right:.1f}{strokes}"/>'


def _between(lines: Array) -> Array:
    """Return points along lines (2 s, 3), (s DENSE, 3)."""
    along = np.linspace(0.0, 1.0, DENSE)[:, None, None]
    points: Array = (lines[0::2] + along * (lines[1::2] - lines[0::2])).reshape(-1, 3)
    return points


def _names(places: Mapping[str, Array], points: Array) -> list[str]:
    """Return names beside places (2,), where they hide no other name and the fewest points."""
    texts: list[str] = []
    taken: list[tuple[Array, Array]] = []
    for owner in list(places)[:NAMES]:
        name = owner if len(owner) <= 22 else f"{owner[:12]}…{owner[-9:]}"
        half = np.array([3.1 * len(name), 6.5])
        x, y = half + 10.0
        spots = [(x, 0), (-x, 0), (0, -y), (0, y), (x, -y), (-x, -y), (x, y), (-x, y)]
        at = np.clip(places[owner] + np.array(spots), half + 2, SIZE - half - 2)
        hidden = (np.abs(points - at[:, None]) < half + 3.0).all(2).sum(1)
        for other, room in taken:
            hidden += len(points) * (np.abs(at - other) < half + room).all(1)
        best = at[np.argmin(hidden)]
        taken.append((best, half))
        texts.append(
            f'<text x="{best[0]:.1f}" y="{best[1] + 4:.1f}" text-anchor="middle">'
            f"{escape(name)}</text>"
        )
    return texts


# The robot beside the answers, coloured by what a page is about.


#: Verdicts by what the drawing prefers to show of a body that has several.
BEST = (Class.IDENTIFIABLE, Class.SIGN_ONLY, Flag.NEGLIGIBLE, Flag.NOT_JUDGED)

#: Poses that the drawn one is chosen from.
POSES = 24

#: How far a joint without limits is turned or moved for the drawing [rad, m].
REACH = (1.0, 0.2)


def sketch_verdicts(robot: Robot, verdicts: Sequence[Verdict]) -> Sketch | None:
    """Return the robot, coloured by what is identifiable."""
    owners: dict[str, list[Verdict]] = {}
    for v in verdicts:
        owners.setdefault(v.name.rpartition(".")[0], []).append(v)
    parts = {owner: _part(each) for owner, each in owners.items()}
    return sketch_parts(robot, parts, "decision.drawing", "does not appear in the model")


def sketch_parts(
    robot: Robot, parts: Mapping[str, Part], caption: str, rest: str = ""
) -> Sketch | None:
    """Return the robot drawn with some parts coloured.

    None where it has no extent to draw, as of joints that all lie in one point.

    Parameters
    ----------
    robot : Robot
    parts : mapping
        Body or joint to how it is shown.
    caption : str
        Which of the words say what the colours are.
    rest : str
        What is said of bodies that are none of the parts.
    """
    drawing = draw_skeleton(robot, typical_pose(robot), parts, rest)
    return None if drawing is None else Sketch(drawing, WIDTH, sentence(caption))


def typical_pose(robot: Robot) -> Array:
    """Return the pose within the limits, (nq,), of some in which the robot is least like a line.

    Of a closed chain home.
    """
    if robot.closed:
        return robot.home
    slides = [int(robot.is_prismatic(int(k))) for k in robot.actuated]
    home = robot.actuated_positions(robot.home[None])[0]
    far = np.array(REACH)[slides]
    low, high = np.clip(robot.limits, (home - far)[:, None], (home + far)[:, None]).T
    q = np.random.default_rng(0).uniform(low, np.maximum(low, high), (POSES, len(home)))
    poses = robot.configuration(q)
    limbs, at = _trace(robot, poses)
    every = np.concatenate([*limbs.values(), at]).transpose(1, 0, 2)
    width = np.linalg.svd(every - every.mean(1, keepdims=True), compute_uv=False)
    pose: Array = poses[np.argmax(width[:, :2].prod(1))]
    return pose


def _part(verdicts: Sequence[Verdict]) -> Part:
    kinds = [v.look for v in verdicts]
    best = next((c for c in BEST if c in kinds), kinds[0])
    counts = [f"{kinds.count(k)} {k}" for k in dict.fromkeys(kinds)]
    return Part(mark_of(best).tone, join(counts))
