"""`Stretch`: consecutive samples of a log, with what the equation of elastic joints needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from identifiability.foundation.linalg import or_one
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen, once_each
from identifiability.logs.prepare import Dataset
from identifiability.logs.prepare.dataset import Piece
from identifiability.logs.signals import differentiate, sampling_step
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import complete_motion

from .deflection import Deflection, LinkEquation, integrate

#: Groups of parameters whose stated values are the start.
STATED = ("rigid_body", "actuator_inertia")
#: Steps of the differences by position, velocity and acceleration: [rad or m, and per s, per s²].
STEPS: tuple[Tolerance, ...] = (1e-4, 1e-3, 1e-2)
#: Most samples of all logs together, as the integration takes time, and fewest of a stretch.
MOST, FEWEST = 6_000, 400
#: Time after which a wrong first deflection has decayed, at most a quarter of a stretch [s].
SETTLE: Tolerance = 2.0
#: Torque of deflections, relative to the largest measured torque, from which links are unstable.
UNSTABLE: Tolerance = 1e3


@frozen
class Springs:
    """Joints that bend, with S sets of their numbers.

    Attributes
    ----------
    joints : tuple of int
        The m joints.
    frequency : (S, m) [Hz]
        Resonance of each link with its motor locked, √(K / M) / 2π, at the mean inertia M.
    ratio : (S, m)
        Damping ratio.
    """

    joints: tuple[int, ...]
    frequency: Array
    ratio: Array

    def with_each(self, joint: int, frequencies: Array, ratio: float) -> Springs:
        """Return sets of springs, each with one more joint of another frequency (S,)."""
        sets = len(frequencies)
        known_frequency = np.repeat(self.frequency, sets, axis=0)
        known_ratio = np.repeat(self.ratio, sets, axis=0)
        frequency = np.column_stack([known_frequency, frequencies])
        ratios = np.column_stack([known_ratio, np.full(sets, ratio)])
        return Springs((*self.joints, joint), frequency, ratios)

    def without(self, joint: int) -> Springs:
        """Return the springs of the other joints."""
        rest = [c for c, j in enumerate(self.joints) if j != joint]
        joints = tuple(self.joints[c] for c in rest)
        return Springs(joints, self.frequency[:, rest], self.ratio[:, rest])

    def stiffness(self, inertia: Array) -> Array:
        """Return the stiffness (S, m), for the mean inertia (n,) of every joint."""
        return (2.0 * np.pi * self.frequency) ** 2 * inertia[list(self.joints)]

    def damping(self, inertia: Array) -> Array:
        """Return the damping (S, m), for the mean inertia (n,) of every joint."""
        own = inertia[list(self.joints)]
        return 4.0 * np.pi * self.ratio * self.frequency * own


class Stretch:
    """Consecutive samples of a log along which joints may bend.

    Values of the model are those of the robot file plus changes of the b kept columns. Where motion
    determines only the sum of a rotor and a link, the rotor is the file's.

    Parameters
    ----------
    structure : Structure
        Of an open chain.
    log : Dataset
    piece : Piece
        Of the log.
    """

    def __init__(self, structure: Structure, log: Dataset, piece: Piece) -> None:
        self.structure = structure
        self.log = log
        self.robot = structure.robot
        self.piece = piece
        t = piece.motion.t
        self.step = sampling_step(t)
        passed = t - t[0]
        #: Samples at which deflections are those of the motion, (N,) bool.
        self.settled = passed >= min(SETTLE, passed[-1] / 4.0)
        parameters = structure.parameters
        self.bodies = np.array([p.group == "rigid_body" for p in parameters])
        stated = np.array([p.group in STATED for p in parameters])
        #: Values of the file, (p,); zero where it has none.
        self.stated = np.where(stated, structure.nominal, 0.0)
        self.kept = np.asarray(structure.base.kept)
        W = structure.model.regressor(self.robot, piece.motion)
        self.columns = W[:, :, self.kept]
        self.stated_torque = W @ self.stated
        self._link_columns = W[:, :, self.bodies]

    def values(self, change: Array) -> Array:
        """Return the values (p,) of the model for changes (b,) of the kept columns."""
        out = self.stated.copy()
        out[self.kept] += change
        return out

    def load(self, values: Array) -> Array:
        """Return the torque of rigid links, (N, n)."""
        return self._link_columns @ values[self.bodies]

    def whole(self, change: Array) -> Array:
        """Return the torque of the rigid model, (N, n)."""
        return self.stated_torque + self.columns @ change

    # Derivatives of the links' torque.

    @once_each
    def derivative_columns(self, joint: int) -> tuple[Array, ...]:
        """Return columns (N, n, p of bodies) of P, D and M by the motion of a joint."""
        return tuple(self._difference(joint, k) for k in range(len(STEPS)))

    def _difference(self, joint: int, order: int) -> Array:
        motion = self.piece.motion
        model = self.structure.model
        links = Model((model.effects[model.names.index("rigid_body")],))
        state = [motion.actuated_q, motion.actuated_v, motion.actuated_a]
        ends = []
        for sign in (1.0, -1.0):
            moved = [x.copy() for x in state]
            moved[order][:, joint] += sign * STEPS[order]
            ends.append(links.regressor(self.robot, complete_motion(self.robot, motion.t, *moved)))
        return (ends[0] - ends[1]) / (2.0 * STEPS[order])

    def derivatives(self, joints: Sequence[int], values: Array) -> Array:
        """Return P, D and M by the motion of m joints, (3, N, n, m)."""
        own = values[self.bodies]
        each = [[c @ own for c in self.derivative_columns(joint)] for joint in joints]
        return np.moveaxis(np.array(each), 0, -1)

    # Torque of deflections, at every sample.

    def equation(self, joints: Sequence[int], parts: Array) -> LinkEquation:
        """Return the equation of the links behind m joints."""
        own = parts[:, :, list(joints)]
        return LinkEquation(self.step, *own)

    def bent_torque(self, springs: Springs, inertia: Array, values: Array) -> Array:
        """Return the torque that springs add to the rigid robot's, (N, n, S)."""
        parts = self.derivatives(springs.joints, values)
        load = self.load(values)[:, None, list(springs.joints)]
        equation = self.equation(springs.joints, parts)
        found = integrate(
            equation,
            load,
            springs.stiffness(inertia),
            springs.damping(inertia),
        )
        return _torque_of(parts, found)

    def sensitivities(self, springs: Springs, inertia: Array, values: Array) -> tuple[Array, Array]:
        """Return the torque (N, n) of one set of springs, and its derivatives (N, n, 2m + b).

        They are by the logarithms of frequencies and of damping ratios, and by the kept columns.
        The derivative of a deflection obeys the same equation under another torque. If the values
        make the links unstable, the torque is infinite and the derivatives are zero.
        """
        joints = list(springs.joints)
        m = len(joints)
        parts = self.derivatives(joints, values)
        equation = self.equation(joints, parts)
        stiffness = springs.stiffness(inertia)
        damping = springs.damping(inertia)
        load = self.load(values)[:, None, joints]
        own = integrate(equation, load, stiffness, damping)
        torque = _torque_of(parts, own)[:, :, 0]
        size = 2 * m + len(self.kept)
        direct = np.zeros((*self.columns.shape[:2], size))
        if not np.abs(torque).max() < UNSTABLE * np.nanmax(np.abs(self.piece.tau)):
            return np.full_like(torque, np.inf), direct
        position, velocity, acceleration = (
            x[:, 0] for x in (own.position, own.velocity, own.acceleration)
        )
        each = np.eye(m)
        # Damping grows with the frequency as well.
        by_frequency = -2.0 * (stiffness * position)[:, None] * each
        by_frequency = by_frequency - (damping * velocity)[:, None] * each
        by_ratio = -(damping * velocity)[:, None] * each
        rows = [by_frequency, by_ratio]
        places = np.flatnonzero(self.bodies)
        of_links = np.isin(self.kept, places)
        columns = np.searchsorted(places, self.kept[of_links])
        by_values = np.zeros((len(load), len(self.kept), m))
        added = np.zeros((*self.columns.shape[:2], len(columns)))
        states = (position, velocity, acceleration)
        for c, joint in enumerate(joints):
            for column, state in zip(self.derivative_columns(joint), states, strict=True):
                added += column[:, :, columns] * state[:, c, None, None]
        by_links = self._link_columns[:, :, columns] - added
        by_values[:, of_links] = np.moveaxis(by_links[:, joints], 1, 2)
        force = np.concatenate([*rows, by_values], axis=1)
        if not np.isfinite(force).all():
            return np.full_like(torque, np.inf), direct
        moved = _torque_of(parts, integrate(equation, force, stiffness, damping))
        direct[:, :, 2 * m :][:, :, of_links] = -added
        return torque, moved + direct

    # Rivals: what else makes torque late, small or smooth.

    def rivals(self, change: Array) -> Array:
        """Return columns (N, n, 4n) of delay, low-pass, encoder zero and torque scale by joint."""
        values = self.values(change)
        n = len(self.robot.actuated)
        whole = self.whole(change)
        late = differentiate(whole, self.step)
        slow = differentiate(late, self.step)
        turned = self.derivatives(range(n), values)[0]
        alone = np.eye(n)
        late = late[:, :, None] * alone
        slow = slow[:, :, None] * alone
        # A common scale of torque, bodies and springs changes nothing, so that it never converges.
        scaled = self.load(values)[:, :, None] * (alone - 1.0 / n)
        return np.concatenate([late, slow, turned, scaled], axis=2)

    def without(self, springs: Springs, inertia: Array, values: Array) -> Dataset:
        """Return its samples, less the torque of springs and of the rotors before them."""
        bent = self.bent_torque(springs, inertia, values)[:, :, 0]
        rotors = [p.name in rotor_names(self.structure, springs) for p in self.structure.parameters]
        columns = self.structure.model.regressor(self.robot, self.piece.motion)[:, :, rotors]
        tau = self.piece.tau - bent - columns @ values[rotors]
        weight = self.piece.weight * self.settled[:, None]
        return replace(
            self.log,
            motion=self.piece.motion,
            tau=tau,
            weight=weight,
            instrument=None,
            own=None,
        )

    # What a fit compares.

    def kept_rows(self, x: Array) -> Array:
        """Return settled x (N, n, …), filtered as torque is, zero where that is no data."""
        rows = self.piece.weighed(self.piece.down(self.piece.silenced(np.array(x))))
        return rows[self.settled[self.piece.at]]


def _torque_of(parts: Array, found: Deflection) -> Array:
    """Return the torque that deflections add to that of a rigid robot, (N, n, S)."""
    states = (found.position, found.velocity, found.acceleration)
    pairs = zip(parts, states, strict=True)
    return -sum(part @ state.swapaxes(1, 2) for part, state in pairs)


def rotor_names(structure: Structure, springs: Springs) -> list[str]:
    """Return the parameters of the rotors of joints that bend."""
    bent = {structure.robot.joints[joint] for joint in springs.joints}
    parameters = structure.parameters
    return [p.name for p in parameters if p.group == "actuator_inertia" and p.owner in bent]


def cut_stretches(structure: Structure, samples: Sequence[Dataset]) -> list[Stretch]:
    """Return a stretch without gaps of each log, where the motion is fastest.

    Together they have at most `MOST` samples.
    """
    most = MOST // max(1, len(samples))
    out = []
    for log in samples:
        length = len(log.motion.t)
        parts = max(1, round(np.ceil(length / most)))
        size = -(-length // parts)
        usual = or_one(np.sqrt(np.mean(log.motion.actuated_a**2, axis=0)))
        pieces = (piece for piece in log.pieces(size) if len(piece.motion.t) >= FEWEST)
        fastest = max(pieces, key=partial(_haste, usual), default=None)
        if fastest is not None:
            out.append(Stretch(structure, log, fastest))
    return out


def _haste(usual: Array, piece: Piece) -> float:
    """Return the sum of squares of the accelerations of a piece, over their usual sizes (n,)."""
    return float(np.sum((piece.motion.actuated_a / usual) ** 2))
