"""The robot as bodies, joints, cylinders and ground, moving along a log."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import Array
from identifiability.foundation.quoting import for_svg
from identifiability.foundation.rounding import NONE, format_number
from identifiability.robot import Motion, Robot
from identifiability.robot.kinematics import WORLD, Joint, Point, shortest_turn

from .answers.common import WORDS, sentence
from .blocks import Moving, Shape, Trace
from .figures import POINTS

#: Largest size of the drawing, and the margin around it [px].
WIDTH, HEIGHT, MARGIN = 400, 280, 30

#: Direction that one looks along: azimuth and height [rad].
TURN, LIFT = -0.95, 0.42


class _Parts:
    """Points of a robot at F poses, joints first, and the shapes between them."""

    def __init__(self, robot: Robot, poses: Array) -> None:
        self.robot = robot
        self.tree = robot.tree
        self.poses = poses
        self.frames = self.tree.frames(poses, range(len(self.tree.joints)))
        self.points: list[Array] = []
        self.shapes: list[Shape] = []
        self.tips: list[int] = []
        #: Points at which level rails carry the robot.
        self.rails: set[int] = set()
        for k in range(len(self.tree.joints)):
            self.add(self.frames.origin[k])

    def add(self, place: Array) -> int:
        """Add a point (3, F), or (3, 1) if it is fixed, and return its index."""
        self.points.append(np.broadcast_to(place.T, (len(self.poses), 3)))
        return len(self.points) - 1

    def add_point(self, joint: int, position: Array) -> int:
        """Add a point of the body behind a joint, given in the frame of the joint [m]."""
        return self.add(self.tree.world_point(self.frames, Point(joint, position)))

    def connect(self, points: Sequence[int], kind: str, width: float) -> None:
        """Add a stroke between two points [m], or a plate between more."""
        if len(points) > 1:
            places = np.array([self.points[k][0] for k in points])
            ordered = [points[k] for k in _outline(places)]
            self.shapes.append(Shape(tuple(ordered), kind, width))

    @cached_property
    def width(self) -> float:
        """Width of a body [m]."""
        tree = self.tree
        arms = [np.linalg.norm(j.translation) for j in tree.joints if j.parent != WORLD]
        starts = [x[0] for x in self.points]
        # Joints that all lie in one point have bodies that reach from there.
        reach = max(map(self.reach, self.robot.bodies))
        size = float(np.ptp(starts, axis=0).max() or reach)
        lengths = [x for x in arms if x > 0.05 * size]
        usual = float(np.median(lengths)) if lengths else size
        # In proportion to the distances between joints, and to the whole robot.
        return min(max(0.3 * usual, 0.02 * size), 0.07 * size)

    def centre(self, body: str) -> Array:
        """Return the centre of mass of a body by the file, (3,) [m]; its origin without mass."""
        known = self.robot.nominal
        mass, *first = (known.get(f"{body}.{kind}", 0.0) for kind in ("m", "mx", "my", "mz"))
        return np.array(first) / (mass if mass > 0 else np.inf)

    def reach(self, body: str) -> float:
        """Return the length of a body that carries nothing: beyond its centre of mass [m]."""
        return float(1.6 * np.linalg.norm(self.centre(body)))

    def meeting_axes(self, k: int) -> list[int]:
        """Return the revolute joints whose axes meet in the origin of joint k."""
        origin = self.frames.origin
        revolute = [j for j, joint in enumerate(self.tree.joints) if joint.kind == "revolute"]
        return [j for j in revolute if np.abs(origin[j] - origin[k]).max() < 0.01 * self.width]

    def place_of(self, joint: Joint, along: float = 0.0) -> int:
        """Add the place of a sliding joint on its parent, or a point along its axis [m]."""
        return self.add_point(joint.parent, joint.translation + joint.rotation @ joint.axis * along)


def _outline(places: Array) -> list[int]:
    """Return the order of points (k, 3) along a line, or around the plate between them.

    The first point of a plate comes again at its end.
    """
    centred = places - places.mean(0)
    _, size, axes = np.linalg.svd(centred, full_matrices=False)
    flat = centred @ axes[:2].T
    if len(places) < 3 or size[1] <= 0.1 * size[0]:
        return [int(k) for k in np.argsort(flat[:, 0], kind="stable")]
    around = ConvexHull(flat).vertices.tolist()
    return [*around, around[0]]


def _trace(robot: Robot, poses: Array, load: Point | None) -> _Parts:
    """Return the points and shapes of a robot at F poses (F, nq).

    Where a body carries a load, its centre comes after the joints. A body goes from its joint to
    the joints that it carries, and to the points at which loops close. A body without any of these
    goes to its centre of mass, and as far again.
    """
    parts = _Parts(robot, poses)
    joints = robot.tree.joints
    if load is not None:
        parts.add_point(load.joint, load.position)
    width = parts.width
    mounted = [_mount(parts, k, width) for k in range(len(joints))]
    closing = [p for loop in robot.loops for p in (loop.first, loop.second)]
    for loop in robot.loops:
        ball = [parts.add_point(p.joint, p.position) for p in (loop.first, loop.second)]
        parts.shapes.append(Shape(tuple(ball), "joint", 0.9 * width))
    for body, link in zip(robot.bodies, robot.links, strict=True):
        k = link.last
        ends = [at for at, joint in zip(mounted, joints, strict=True) if joint.parent == k]
        ends += [parts.add_point(k, p.position) for p in closing if p.joint == k]
        if not ends:
            ends = _tip(parts, body, k)
        # Bodies become thinner along the chain.
        taper = 0.92 ** len(robot.tree.chain(k))
        parts.connect([k, *ends], "body", width * taper)
    if robot.base is None:
        pairs = zip(mounted, joints, strict=True)
        roots = [at for at, j in pairs if j.parent == WORLD and at not in parts.rails]
        roots += [parts.add_point(WORLD, p.position) for p in closing if p.joint == WORLD]
        parts.connect(roots, "base", 1.2 * width)
        if roots:
            _stand(parts, roots, width)
    return parts


def _stand(parts: _Parts, points: Sequence[int], width: float) -> None:
    """Add a post from the ground to the middle of some points."""
    top = np.mean([parts.points[k][0] for k in points], axis=0)
    up = _directions(parts.robot)[2]
    stand = [parts.add(x[:, None]) for x in (top, top - up * (top @ up))]
    parts.connect(stand, "base", 1.6 * width)


def _tip(parts: _Parts, body: str, joint: int) -> list[int]:
    """Return the end of a body that carries nothing: beyond its centre of mass, if it has one."""
    if parts.robot.nominal.get(f"{body}.m", 0.0) <= 0:
        return []
    parts.tips.append(parts.add_point(joint, 1.6 * parts.centre(body)))
    return [parts.tips[-1]]


def _mount(parts: _Parts, k: int, width: float) -> int:
    """Add the shape of a joint, and return the point at which its parent carries it."""
    joint = parts.tree.joints[k]
    base = parts.robot.base
    links = dict(zip(parts.robot.bodies, parts.robot.links, strict=True))
    if base is not None and k in parts.tree.chain(links[base.body].last):
        return k  # no mechanism moves a floating base
    if joint.kind != "prismatic":
        meeting = parts.meeting_axes(k)
        # The frame's third axis is that of the joint; a ball looks the same from all sides.
        hinge = joint.kind == "revolute" and len(meeting) < 3
        if not hinge and k > min(meeting, default=k):
            return k  # the first axis is drawn as a ball
        axis = parts.frames.axes[k][2] * (0.7 * width if hinge else TINY)
        ends = [parts.add(parts.frames.origin[k] + sign * axis) for sign in (1.0, -1.0)]
        parts.shapes.append(Shape(tuple(ends), "joint", 0.9 * width))
        return k
    return _mount_slide(parts, k, width)


def _mount_slide(parts: _Parts, k: int, width: float) -> int:
    """Add the shape of a sliding joint, and return the point at which its parent carries it."""
    joint = parts.tree.joints[k]
    along = parts.poses[:, joint.iq]
    low = float(along.min())
    high = float(along.max())
    start = parts.place_of(joint)
    stage = joint.parent == WORLD or parts.tree.joints[joint.parent].kind == "prismatic"
    if stage and not {*joint.dofs} <= {*parts.robot.joints}:
        return start  # a coordinate of a platform
    if low > 0.0 and not stage:  # a cylinder, and the rod that comes out of it
        end = parts.place_of(joint, 0.75 * low)
        parts.connect([end, k], "rod", 0.5 * width)
        parts.connect([start, end], "cylinder", 1.1 * width)
    else:  # a carriage on its rail
        rail = [parts.place_of(joint, low - width), parts.place_of(joint, high + width)]
        parts.connect(rail, "rod", 0.45 * width)
        parts.connect([start, k], "rod", 0.45 * width)
        rises = (joint.rotation @ joint.axis) @ _directions(parts.robot)[2]
        if joint.parent == WORLD and abs(rises) < 0.5:
            parts.rails.add(start)
            for end in rail:
                _stand(parts, [end], width)
    return start


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
    for _, poses in motions.values():
        parts = _trace(robot, np.nan_to_num(poses[rows]), load)
        lost = np.isnan(poses[rows]).any(1)[:, None, None]
        traced.append(np.where(lost, np.nan, np.stack(parts.points, 1)))
    seen = traced[0].reshape(-1, 3)
    if not np.nanmax(np.ptp(seen, axis=0)) > 0:
        return None
    place, scale, size = _look(seen, robot)
    names = tuple((name, tone) for name, (tone, _) in motions.items())
    points = tuple(place(x.reshape(-1, 3)).reshape(x.shape) for x in traced)
    shapes = tuple(replace(shape, width=scale * shape.width) for shape in parts.shapes)
    joints = len(robot.tree.joints) + (load is not None)
    return Moving(
        names=names,
        t=t[rows] - t[0],
        points=points,
        shapes=shapes,
        tips=tuple(parts.tips),
        ground=_ground(seen, robot, place),
        joints=joints,
        told=tuple(map(tuple, told(rows))),
        size=size,
        caption=caption,
    )


def _frames(t: Array) -> np.ndarray:
    """Return the rows of times (N,) that are drawn."""
    many = (t[-1] - t[0]) * FRAMES_A_SECOND
    frames = int(
        np.clip(
            many,
            2,
            MOST_FRAMES,
        )
    )
    times = np.linspace(t[0], t[-1], frames)
    return np.unique(np.searchsorted(t, times).clip(0, len(t) - 1))


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
    joint: str = "",
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
    joint : str
        The joint that is shown, if it is another one.
    """
    if len(t) < 2 or not np.isfinite(torque).any():
        return None
    end = int(np.searchsorted(t, t[0] + STRETCH, "right"))
    known = np.ma.masked_invalid(torque)
    if residual is None:
        size = (known**2).mean(0).filled(0.0)
        share = np.broadcast_to(size, torque.shape)
    else:  # over the variation of each joint, as errors are
        size = known.std(0).filled(0.0)
        share = np.nan_to_num(np.abs(residual) / np.where(size > 0, size, np.inf))
    name = joint or robot.joints[int((share**2).mean(0).argmax())]
    k = robot.joints.index(name)
    rows = np.searchsorted(motion.t, t[:end]).clip(0, len(motion.t) - 1)
    how = how or ("loaded" if residual is None else "missed")
    unit = robot.torque_units[k]
    missed = _state_sizes((torque if residual is None else residual)[:, k], how, unit)
    own = {what: y[:end, k] for what, y in lines.items()}
    caption = sentence("moving", how, log=log, joint=name)
    if any(np.isnan(y).any() for y in own.values()):
        caption += sentence("moving", "gaps")
    poses = {"measured": ("grey", motion.q[rows])}
    told = (lambda at: []) if residual is None else (lambda at: [[missed[row] for row in at]])
    moving = move_skeletons(robot, t[:end], poses, told, caption, load)
    if moving is None:
        return None
    quantity = WORDS["moving.quantity"].get(how, "torque")
    trace = Trace.of(for_svg(name), unit, t[:end] - t[0], own, POINTS, quantity)
    # Times of the log, as in the plots below.
    moving = replace(moving, torque=trace, t=moving.t + t[0])
    if load is not None:  # as large in all frames
        marks = np.arange(moving.joints) == moving.joints - 1
        sizes = np.tile(0.5 * marks, (len(moving.t), 1))
        return replace(moving, misses=sizes, mark="blue")
    if residual is None:
        return moving
    owners = {dof: k for k, one in enumerate(robot.tree.joints) for dof in one.dofs}
    misses = np.zeros((len(moving.t), moving.joints))
    shown = _frames(t[:end])
    misses[:, [owners[j] for j in robot.joints]] = share[shown]
    return replace(moving, misses=misses)


def _state_sizes(x: Array, how: str, unit: str) -> list[str]:
    """Return torque (N,) in words at each time; a change of torque has a sign."""
    about = "moving.now"
    word = how if how in WORDS[about] else "missed"
    sizes = x if word in ("changed", "hangs") else np.abs(x)
    texts = (f"{format_number(size, 2)}\N{NO-BREAK SPACE}{unit}" for size in sizes)
    return [sentence(about, "none" if NONE in text else word, size=text) for text in texts]


def _directions(robot: Robot) -> Array:
    """Return the directions east, north and up, against gravity, as rows (3, 3)."""
    up = np.array([0.0, 0.0, 1.0])
    gravity = robot.gravity
    vertical = -gravity / np.linalg.norm(gravity) if gravity.any() else up
    return pin.exp3(shortest_turn(up, vertical)).T


def _ground(points: Array, robot: Robot, place: Callable[[Array], Array]) -> tuple[Array, ...]:
    """Return the lines of a grid below the robot, each (2, 2) [px].

    A fixed robot stands at the height of its base. A floating robot stands on its lowest point.
    """
    east, north, up = _directions(robot)
    level = points @ np.stack([east, north], 1)
    low = np.nanmin(level, axis=0)
    high = np.nanmax(level, axis=0)
    middle = (low + high) / 2 if robot.base is not None else np.zeros(2)
    height = float(np.nanmin(points @ up)) if robot.base is not None else 0.0
    size = max(float(np.nanmax(np.ptp(points, axis=0))), TINY)
    edges = np.meshgrid(np.linspace(-size, size, 13), [-size, size], indexing="ij")
    rows = np.stack(edges, -1)
    ends = np.concatenate([rows, rows[..., ::-1]]) + middle
    corners = ends.reshape(-1, 2) @ np.stack([east, north]) + height * up
    return tuple(place(corners)[:, :2].reshape(ends.shape))


def _look(points: Array, robot: Robot) -> tuple[Callable[[Array], Array], float, tuple[int, int]]:
    """Return the projection of points (N, 3), scaled to `points`, its scale [px/m] and size [px].

    The projection returns places on the paper and the depth behind it, (N, 3) [px]. The paper is as
    narrow and as low as the motion, so that the robot fills a card of any shape.
    """
    east, north, vertical = _directions(robot)
    ahead = np.cos(TURN)
    aside = np.sin(TURN)
    right = ahead * east + aside * north
    level = ahead * north - aside * east
    away = np.cos(LIFT) * level - np.sin(LIFT) * vertical
    paper = np.stack([right, -np.cross(right, away), away], 1)
    shown = (points @ paper)[:, :2]
    low = np.nanmin(shown, axis=0)
    high = np.nanmax(shown, axis=0)
    least = 1e-9 + 0.02 * float(np.max(high - low))
    most = np.array([WIDTH, HEIGHT], float) - 2 * MARGIN
    scale = float(np.min(most / np.maximum(high - low, least)))
    shift = np.append(MARGIN - scale * low, 0.0)
    size = scale * (high - low) + 2 * MARGIN
    width, height = np.ceil(size).astype(int).tolist()
    return (lambda x: scale * (x @ paper) + shift), scale, (width, height)
