"""Motion in place of a robot that floats: its base shifts over its feet, and each swings in turn.

Candidates say how the base moves, what each foot does while it is in the air, and what joints do
that carry no foot; joints of the legs follow, as planted feet stay where they are. The robot stands
as its home position has it, on a plane through its feet. Nothing of this is a limit of one joint:
what a candidate asks of joints, and how far the zero-moment point [Vukobratovic 1972] of the file's
masses is inside of the feet that stand, is punished while searching and refused at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import format_count
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot, complete_motion
from identifiability.robot.floating import SIX, Contact, base_acceleration, contact_jacobian
from identifiability.robot.kinematics import Point
from identifiability.robot.rules import RULES as ROBOT_RULES
from identifiability.simulation.motion import Trajectory
from identifiability.workflows.excite.limits import Drive, Limits, Workspace
from identifiability.workflows.excite.rules import RULES

#: Harmonics of a foot in the air.
AIR = 3

#: When, in its part of the motion, the base leans over the other feet and a foot is in the air.
LEANS: tuple[Tolerance, Tolerance] = (0.3, 0.25)
LIFTS: tuple[Tolerance, Tolerance, Tolerance] = (0.3, 0.75, 0.2)

#: Step of differences along a plan [s]; steps of Newton's, how far one goes [rad or m], what is
#: left of a distance that is none [m], and of one that is solved for.
STEP: Tolerance = 1e-3
NEWTON = 14
FAR: Tolerance = 0.3
REACHED: Tolerance = 1e-10
SOLVED: Tolerance = 1e-12

#: What is left of a position beyond which harmonics of a series are dropped [rad or m].
SERIES: Tolerance = 1e-5

#: Leans that are tried for a foot, each by this share of what is left to the middle of the others,
#: and samples of a trial.
LEANING = 10
LEAN: Tolerance = 0.15
LOOKED = 100

#: Sizes that are tried of a candidate, by bisection between itself and swings alone, which keep all
#: limits.
SIZES = 7

#: Samples at which the search looks, for each part of a motion.
LOOKS = 40

#: Seconds that each part of a motion takes where nobody says how long it shall be: the first with
#: which swings alone leave `spare` of the limits of joints.
PARTS: tuple[Tolerance, Tolerance, Tolerance, Tolerance, Tolerance] = (2.5, 3.5, 5.0, 7.0, 10.0)


def smooth(x: Array) -> Array:
    """Return a step from zero to one with two continuous derivatives, beyond [0, 1] constant."""
    x = np.clip(x, 0.0, 1.0)
    step: Array = x**3 * (10 - 15 * x + 6 * x * x)
    return step


def bounded(x: Array) -> Array:
    """Return what grows as x does where it is small, and stays between −1 and 1."""
    inside: Array = x / np.sqrt(1 + x * x)
    return inside


@frozen
class Foot:
    """What stands on the ground together: the contacts of a body.

    Attributes
    ----------
    name : str
    contacts : tuple of int
        Among those of the robot.
    middle : Contact
        That stays where it is, and as it is turned where ``kind`` is surface.
    """

    name: str
    contacts: tuple[int, ...]
    middle: Contact


@frozen
class Swing:
    """A foot that leaves the ground: which, and where the base goes while it does, (3,) [m]."""

    foot: int
    lean: Array


@frozen
class InPlace:
    """All motions in place of a robot within limits, each from rest to rest.

    It is to a robot that floats what `Series` is to one that stands.

    Attributes
    ----------
    robot : Robot
    limits : Limits
        Of the joints that motors drive.
    period : float [s]
        Of the whole motion.
    harmonics : int
        Of the base.
    feet : tuple of Foot
    swings : tuple of Swing
        One after the other, after a part in which all feet stand.
    """

    robot: Robot
    limits: Limits
    period: float
    harmonics: int
    feet: tuple[Foot, ...]
    swings: tuple[Swing, ...] = ()

    # Where it stands at home: the world has the axes of the base there.

    @cached_property
    def home(self) -> Array:
        """Positions of the joints that motors drive, (n,)."""
        home: Array = self.robot.actuated_positions(self.robot.home[None])[0, SIX:]
        return home

    @cached_property
    def _standing(self) -> tuple[Array, Array, Array, float]:
        """Points on which it stands (c, 3), up (3,), two axes of the ground (2, 3), its height."""
        contacts, tree = self.contacts, self.robot.tree
        full = self._full(self.home[None])
        middle = np.stack([tree.positions(full, c.point)[0] for c in contacts])
        away = middle.mean(0)
        spread = np.linalg.svd(middle - away)
        up = spread[2][2] * (-1.0 if spread[2][2] @ away > 0 else 1.0)
        points = middle - np.array([[c.radius] for c in contacts]) * up
        return points, up, spread[2][:2], float(-(points @ up).mean())

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Where it may stand."""
        assert self.robot.base is not None
        return self.robot.base.contacts

    @property
    def height(self) -> float:
        """Of the base above the ground [m]."""
        return self._standing[3]

    @cached_property
    def margin(self) -> float:
        """How far the zero-moment point stays inside of the feet that stand [m]."""
        points, _, plane, _ = self._standing
        return RULES.stable * float(np.sqrt(ConvexHull(points @ plane.T).volume))

    def edges(self, lifted: int | None) -> Array | None:
        """Return edges of the polygon of the feet that stand, (e, 3); None where there is none."""
        points, _, plane, _ = self._standing
        up = set() if lifted is None else set(self.feet[lifted].contacts)
        try:
            hull = ConvexHull([p @ plane.T for k, p in enumerate(points) if k not in up])
        except (QhullError, ValueError):
            return None
        return np.asarray(hull.equations)

    @property
    def yields(self) -> bool:
        """Whether feet can stay where they are at home, whatever a base does."""
        full = self._full(self.home[None])
        frames = self.robot.tree.frames(full, [f.middle.point.joint for f in self.feet])
        own = self.robot.actuated[SIX:]
        parts = [contact_jacobian(self.robot.tree, frames, f.middle, None, 1) for f in self.feet]
        size = np.linalg.svd(np.concatenate(parts)[:, own, 0], compute_uv=False)
        rows = sum(len(part) for part in parts)
        return len(own) >= rows and bool(size[rows - 1] > ROBOT_RULES.leg_stretched * size[0])

    # Candidates.

    @property
    def joints(self) -> int:
        """Number of joints that motors drive."""
        return len(self.limits.joints)

    @cached_property
    def idle(self) -> np.ndarray:
        """Which of them carry no foot, (i,) int."""
        tree, names = self.robot.tree, self.limits.joints
        carry = {d for f in self.feet for k in tree.chain(f.middle.point.joint)
                 for d in tree.joints[k].dofs}  # fmt: skip
        return np.array([k for k, name in enumerate(names) if name not in carry], int)

    @property
    def looks(self) -> int:
        """Samples at which a search looks at a candidate."""
        return LOOKS * (1 + len(self.swings))

    @property
    def _parts(self) -> list[int]:
        moving = SIX + len(self.idle)
        return [moving * 2 * self.harmonics, len(self.swings) * 3 * 2 * AIR]

    @property
    def size(self) -> int:
        """Numbers a candidate has."""
        return sum(self._parts)

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Return random candidates (count, size), each made smaller until it keeps all limits."""
        x = rng.standard_normal((count, self.size))
        x *= np.exp(rng.uniform(-1.5, 0.5, count))[:, None]
        return self.shrink(x, self.looks)

    def shrink(self, x: Array, samples: int) -> Array:
        """Return candidates (m, size), each made smaller so far that it keeps all limits."""
        kept, tried, wild = np.zeros(len(x)), np.ones(len(x)), np.arange(len(x))
        for step in 0.5 ** np.arange(1, SIZES + 1):
            some = tried[wild, None] * x[wild]
            motion = self.complete(self.robot, some, samples)
            good = np.zeros(len(wild), bool)
            if motion is not None:
                good = self.survey(self.robot, motion, some, samples).kept(np.inf)
            kept[wild[good]] = tried[wild[good]]
            tried[wild] += np.where(good, step, -step)
            wild = wild[kept[wild] < 1]
            if not len(wild):
                break
        return kept[:, None] * x

    def swinging(self, t: Array) -> tuple[Array, Array, Array]:
        """Return how far the base leans, and feet are lifted and into the air, (swings, N) each.

        Shares, at times t; the last one is how much of its time in the air is over.
        """
        part = self.period / (1 + len(self.swings))
        phase = t[None] / part - 1 - np.arange(len(self.swings))[:, None]
        lean = smooth(np.minimum(phase / LEANS[0], (1 - phase) / LEANS[1]))
        air = (phase - LIFTS[0]) / (LIFTS[1] - LIFTS[0])
        return lean, smooth(np.minimum(air, 1 - air) / LIFTS[2]), np.clip(air, 0.0, 1.0)

    def closed(self, t: Array) -> np.ndarray:
        """Return which contacts stand on the ground, (N, c) bool."""
        closed = np.ones((len(t), len(self.contacts)), bool)
        _, _, air = self.swinging(t)
        for swing, share in zip(self.swings, air, strict=True):
            closed[np.ix_((share > 0) & (share < 1), self.feet[swing.foot].contacts)] = False
        return closed

    def plan(self, x: Array, t: Array) -> tuple[Array, Array, Array, Array]:
        """Return what candidates (m, size) do at times t (N,).

        Where the base is (m, N, 3), by what it is turned (m, N, 3), where feet are from where they
        stood (m, N, f, 3), and joints that carry none (m, N, i).
        """
        m, H, height = len(x), self.harmonics, self.height
        base, air = np.split(x, self._parts[:1], axis=1)
        along = np.outer(t, 2 * np.pi / self.period * np.arange(1, H + 1))
        waves = np.concatenate([np.sin(along), np.cos(along)], 1) / np.sqrt(H)
        size = np.array([*[RULES.reach * height] * 3, *[RULES.turn] * 3, *np.ones(len(self.idle))])
        lean, lift, over = self.swinging(t)
        sides = np.minimum(t, self.period - t) / (0.1 * self.period)
        calm = smooth(sides) * (1 - (1 - RULES.calm) * lean.sum(0))
        moved = bounded(np.einsum("mkh,nh->mnk", base.reshape(m, len(size), 2 * H), waves))
        moved = moved * size * calm[:, None]
        moved[..., :3] += lean.T @ np.reshape([s.lean for s in self.swings], (-1, 3))
        feet = np.zeros((m, len(t), len(self.feet), 3))
        up, plane = self._standing[1], self._standing[2]
        at = 2 * np.pi * np.arange(1, AIR + 1)
        for k, (swing, own) in enumerate(
            zip(self.swings, air.reshape(m, -1, 3, 2 * AIR).swapaxes(0, 1), strict=True)
        ):
            angle = np.outer(over[k], at)
            waves = np.concatenate([np.sin(angle), np.cos(angle)], 1) / np.sqrt(AIR)
            wave = bounded(np.einsum("mkh,nh->mnk", own, waves))
            go = RULES.swing * wave[..., :2] @ plane + RULES.reach * (1 + 0.8 * wave[..., 2:]) * up
            feet[:, :, swing.foot] = height * lift[k][:, None] * go
        room = 0.5 * (self.limits.high - self.limits.low)[self.idle]
        near = np.minimum(self.limits.high - self.home, self.home - self.limits.low)[self.idle]
        idle = self.home[self.idle] + moved[..., SIX:] * np.minimum(room, np.maximum(near, 0.0))
        return moved[..., :3], moved[..., 3:SIX], feet, idle

    def motion(self, x: Array, samples: int) -> tuple[Array, Array, Array]:
        """Return q, dq, ddq (m, samples, n) of the joints that motors drive."""
        t = np.arange(samples) * self.period / samples
        parts = self._joint_motion(np.atleast_2d(x), t)[:3]
        q, v, a = (part.reshape(-1, samples, self.joints) for part in parts)
        return q, v, a

    def trajectory(self, x: Array, samples: int, name: str) -> Trajectory:
        """Return the trajectory of one candidate: as many harmonics as its positions need."""
        full = np.fft.rfft(self.motion(x, samples)[0][0], axis=0) / samples
        left = np.cumsum(2 * np.abs(full[::-1]).max(1))[::-1]
        H = max(1, min(int((left > SERIES).sum()) - 1, (samples - 1) // 2))
        w = 2 * np.pi / self.period * np.arange(1, H + 1)[:, None]
        ahead = 2 * full[1 : H + 1]
        sin, cos = -ahead.imag * w, -ahead.real * w
        return Trajectory(name, self.period, samples, full[0].real, sin.T.copy(), cos.T.copy())

    # What the whole robot does.

    def complete(self, robot: Robot, x: Array, samples: int) -> Motion | None:
        """Return the motion of candidates one after the other; where feet do not stay, less."""
        x = np.atleast_2d(x)
        t = np.arange(samples) * self.period / samples
        q, v, a, base, reached = self._joint_motion(x, t)
        touch = np.concatenate([base[3], np.tile(self.closed(t), (len(x), 1))], axis=1)
        still = np.zeros((len(q), SIX))
        speed = np.hstack([np.zeros((len(q), 3)), base[1], v])
        faster = np.hstack([base_acceleration(*base[:3]), a])
        rows = np.flatnonzero(reached)
        if not len(rows):
            return None
        many = np.arange(len(q), dtype=float)
        own = [part[rows] for part in (many, np.hstack([still, q]), speed, faster, touch)]
        return replace(complete_motion(robot, *own), kept=rows)

    def _full(self, q: Array) -> Array:
        return self.robot.configuration(np.hstack([np.zeros((len(q), SIX)), q]))

    def _joint_motion(self, x: Array, t: Array) -> tuple[Array, Array, Array, list[Array], Array]:
        """Return q, dq, ddq (M, n), proper acceleration, spin, its rate and up, what is reached."""
        plans = [self.plan(x, t + shift) for shift in (-STEP, 0.0, STEP)]
        flat = [[y.reshape(len(x) * len(t), *y.shape[2:]) for y in plan] for plan in plans]
        turns = [Rotation.from_rotvec(plan[1]) for plan in flat]
        q, error = self._reach(flat[1], turns[1], None)
        near = [self._reach(flat[k], turns[k], q)[0] for k in (0, 2)]
        v, a = (near[1] - near[0]) / (2 * STEP), (near[1] - 2 * q + near[0]) / STEP**2
        place = [plan[0] for plan in flat]
        up = turns[1].inv().apply(np.array(self._standing[1]))
        forced = (place[2] - 2 * place[1] + place[0]) / STEP**2
        assert self.robot.base is not None
        acc = turns[1].inv().apply(forced) + float(np.linalg.norm(self.robot.base.gravity)) * up
        ahead, back = ((turns[1].inv() * turns[k]).as_rotvec() for k in (2, 0))
        base = [acc, (ahead - back) / (2 * STEP), (ahead + back) / STEP**2, up]
        return q, v, a, base, error < REACHED

    def _reach(self, plan: Sequence[Array], turn: Rotation, q: Array | None) -> tuple[Array, Array]:
        """Return joints with which feet are where they shall, (M, n), and what is left, (M,) [m].

        In the axes of the base, in which its own joints stand still; a foot whose body may not turn
        has as many equations more. Legs with more joints than that stay near home.
        """
        place, _, feet, idle = plan
        tree, rows = self.robot.tree, self.robot.actuated[SIX:]
        joints = [f.middle.point.joint for f in self.feet]
        home = tree.frames(self._full(self.home[None]), joints)
        out = np.repeat(self.home[None], len(place), 0) if q is None else np.array(q)
        out[:, self.idle] = idle
        back = turn.inv()
        stood = [tree.world_point(home, f.middle.point)[:, 0] for f in self.feet]
        wanted = [back.apply(at + feet[:, k] - place) for k, at in enumerate(stood)]
        legs = np.setdiff1d(np.arange(self.joints), self.idle)
        left = np.full(len(place), np.inf)
        for _ in range(NEWTON):
            frames = tree.frames(self._full(out), joints)
            errors, parts = [], []
            for foot, goal in zip(self.feet, wanted, strict=True):
                point = foot.middle.point
                errors.append(goal - tree.world_point(frames, point).T)
                parts.append(contact_jacobian(tree, frames, foot.middle, None, len(out)))
                if foot.middle.kind == "surface":
                    axes, was = (tree.world_axes(f, point.joint, np.eye(3)) for f in (frames, home))
                    goals = [back.apply(np.array(was[i, :, 0])) for i in range(3)]
                    turned = [np.cross(axes[i].T, goals[i]) for i in range(3)]
                    errors.append(0.5 * sum(turned, np.zeros(3)))
            error = np.concatenate(errors, 1)
            left = np.abs(error).max(1)
            if not np.nanmax(left, initial=0.0) > SOLVED:
                break
            J = np.concatenate(parts).transpose(2, 0, 1)[:, :, rows[legs]]
            square = J @ J.swapaxes(1, 2)
            square += 1e-11 * np.eye(square.shape[1])  # a stretched leg has no inverse
            step = J.swapaxes(1, 2) @ np.linalg.solve(square, error[..., None])
            out[:, legs] += np.clip(step[..., 0], -FAR, FAR)
        return out, left

    def survey(
        self, robot: Robot, motion: Motion, x: Array, samples: int, drive: Drive | None = None
    ) -> Workspace:
        """Return what candidates ask of joints, and how far they are from falling over."""
        count, rows = len(x), motion.kept
        which = rows // samples
        missing = samples - np.bincount(which, minlength=count)
        limits = self.limits
        q, v, a = (y[:, SIX:] for y in (motion.actuated_q, motion.actuated_v, motion.actuated_a))
        used = [np.abs(q - limits.middle) / limits.half_range,
                np.abs(v) / limits.speed, np.abs(a) / limits.acceleration]  # fmt: skip
        load = np.max(used, axis=(0, 2), initial=0.0)
        t = np.arange(samples) * self.period / samples
        place, turn = (part.reshape(-1, 3)[rows] for part in self.plan(x, t)[:2])
        axes, up = Rotation.from_rotvec(turn), self._standing[1]
        force, moment = (axes.apply(part) for part in np.split(self._wrench(motion), 2, axis=1))
        press = np.maximum(force @ up, 1e-9)
        along = np.linalg.norm(force - (force @ up)[:, None] * up, axis=1)
        load = np.maximum(load, along / (RULES.grip * press))
        # About the base, above the ground by its height and what it rose.
        depth = -self.height - place @ up
        zero = place + (np.cross(up, moment) + depth[:, None] * force) / press[:, None]
        worst, far = np.zeros(count), np.full(count, -np.inf)
        np.maximum.at(worst, which, load)
        np.maximum.at(far, which, self._fallen(zero, np.tile(self.closed(t), (count, 1))[rows]))
        return Workspace(missing, np.ones(count), np.zeros(count, int), far + self.margin, worst)

    def _wrench(self, motion: Motion) -> Array:
        """Return what the ground does to the file's masses, about the base, its axes, (N, 6)."""
        model, out = self.robot.model, np.empty((len(motion), SIX))
        data, at = model.createData(), self.robot.actuated[:SIX]
        for k in range(len(motion)):
            out[k] = pin.rnea(model, data, motion.q[k], motion.v[k], motion.a[k])[at]
        return out

    def _fallen(self, zero: Array, stands: np.ndarray) -> Array:
        """Return how far the zero-moment point (N, 3) is outside of the feet that stand [m]."""
        place, out = zero @ self._standing[2].T, np.full(len(zero), np.inf)
        for lifted in (None, *(s.foot for s in self.swings)):
            edges, own = self.edges(lifted), np.ones(stands.shape[1], bool)
            own[[] if lifted is None else list(self.feet[lifted].contacts)] = False
            rows = (stands == own).all(1)
            if edges is not None and rows.any():
                out[rows] = (place[rows] @ edges[:, :2].T + edges[:, 2]).max(1)
        return out

    # What it tells.

    @property
    def times(self) -> list[tuple[str, float, float]]:
        """Feet that leave the ground, when, and when they are back [s]."""
        part = self.period / (1 + len(self.swings))
        return [
            (self.feet[s.foot].name, part * (1 + k + LIFTS[0]), part * (1 + k + LIFTS[1]))
            for k, s in enumerate(self.swings)
        ]

    @property
    def told(self) -> str:
        """When which foot is in the air, in words."""
        count = format_count(len(self.feet), "foot", "feet")
        if not self.swings:
            return f"The robot stands on its {count} all the time while its base shifts."
        air = [f"{name} {low:.3g} … {high:.3g} s" for name, low, high in self.times]
        return (
            f"The robot stands in place on its {count}, its base shifts, and in turn a foot is in "
            f"the air: {listing(air, 8)}."
        )

    def to_dict(self) -> dict[str, Any]:
        """Return which feet leave the ground when, for JSON."""
        swings = [{"foot": name, "from": low, "to": high} for name, low, high in self.times]
        return {"feet": [f.name for f in self.feet], "swings": swings, "margin": self.margin}

    # How it comes to stand on the other feet before it lifts one.

    def prepared(self) -> tuple[InPlace, list[str]]:
        """Return it with those swings that it can do, and the names of feet that cannot."""
        able, unable = [], []
        for k, foot in enumerate(self.feet):
            opens = not any(self.contacts[c].always for c in foot.contacts)
            swing = self._leaning(k) if opens else None
            if swing is None:
                unable.append(foot.name)
            else:
                able.append(swing)
        return replace(self, swings=tuple(able)), unable

    def _leaning(self, foot: int) -> Swing | None:
        """Return the swing of a foot with the least lean that keeps the robot up, if there is."""
        edges, plane = self.edges(foot), self._standing[2]
        if edges is None:
            return None
        points = np.delete(self._standing[0], self.feet[foot].contacts, axis=0) @ plane.T
        inner = points[ConvexHull(points).vertices].mean(0)
        lean = np.zeros(2)
        for _ in range(LEANING):
            tried = replace(self, swings=(Swing(foot, lean @ plane),), period=2 * PARTS[-1])
            x = np.zeros((1, tried.size))
            motion = tried.complete(self.robot, x, LOOKED)
            if motion is None or len(motion) < LOOKED:
                return None
            space = tried.survey(self.robot, motion, x, LOOKED)
            if space.kept(np.inf)[0] and space.outside[0] < -self.margin:
                return tried.swings[0]
            # A step towards the middle of the feet that stand.
            lean = lean + LEAN * (inner - lean - self._weighed @ plane.T)
        return None

    @cached_property
    def _weighed(self) -> Array:
        """The middle of the file's masses at home, (3,) [m]."""
        full = self._full(self.home[None])[0]
        model = self.robot.model
        return np.array(pin.centerOfMass(model, model.createData(), full))


def find_in_place(
    robot: Robot, limits: Limits, period: float | None, harmonics: int
) -> tuple[InPlace, list[str]]:
    """Return all motions in place of a robot that floats, and what to say of them.

    Parameters
    ----------
    robot : Robot
    limits : Limits
        Of the joints that motors drive.
    period : float [s] or None
        Of the whole motion; by default as long as its parts take.
    harmonics : int

    Raises
    ------
    RobotError
        If it does not stand.
    """
    base = robot.base
    assert base is not None
    stand = "put it on a stand (--base fixed)."
    if not base.contacts:
        raise RobotError(
            f"{robot.path} floats, and its sidecar states no [[contacts]] on which it stands while "
            f"it moves in place; state them, or {stand}"
        )
    if limits.boxes or np.isfinite(limits.torque).any() or np.isfinite(limits.power).any():
        raise RobotError(
            f"{robot.path} floats: motion in place keeps limits of position, speed and "
            "acceleration of joints, and not of torque, power or a workspace; leave these out, or "
            f"{stand}"
        )
    if robot.closed:
        raise RobotError(
            f"{robot.path} floats and has loops: motion in place is found of legs without; {stand}"
        )
    feet = _feet(robot)
    whole = InPlace(robot, limits, period or PARTS[0], harmonics, feet)
    if len(base.contacts) < 3 or whole.edges(None) is None:
        raise RobotError(
            f"{robot.path} stands on {listing([c.name for c in base.contacts], 4)}, which are no "
            "three points that are not in line, so it does not stand while its limbs move: state "
            f"the corners of each sole as [[contacts]] of kind point, or {stand}"
        )
    if not whole.yields:
        raise RobotError(
            f"The feet of {robot.path} cannot stay where they are while its base moves: a leg is "
            "stretched at home or has too few joints; state a home position with bent legs in the "
            f"sidecar, or {stand}"
        )
    found, unable = whole.prepared()
    for part in () if period else PARTS:
        found = replace(found, period=part * (1 + len(found.swings)))
        still = np.zeros((1, found.size))
        motion = found.complete(robot, still, LOOKED)
        if motion and found.survey(robot, motion, still, LOOKED).load[0] < RULES.spare:
            break
    said = []
    if unable:
        said.append(
            f"{listing(unable, 4)} cannot be lifted without falling over or leaving limits of "
            "joints where the robot stands at home, so one parameter per foot stays unknown; "
            "measure it on a stand."
        )
    return found, said


def _feet(robot: Robot) -> tuple[Foot, ...]:
    """Return the contacts of each body together."""
    assert robot.base is not None
    bodies: dict[int, list[int]] = {}
    for k, contact in enumerate(robot.base.contacts):
        bodies.setdefault(contact.point.joint, []).append(k)
    feet = []
    for joint, own in bodies.items():
        contacts = [robot.base.contacts[k] for k in own]
        flat = len(own) > 1 or contacts[0].kind == "surface"
        at = Point(joint, np.mean([c.point.position for c in contacts], axis=0))
        middle = Contact(contacts[0].name, at, "surface" if flat else "point")
        feet.append(Foot(contacts[0].name, tuple(own), middle))
    return tuple(feet)
