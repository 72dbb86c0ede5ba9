"""How much of its weight the torque of each joint carries: none of it, half, all, or the opposite.

Drivers that compensate gravity report what they add to it; torque before a gear is a fraction of
it. At each joint the measured torque is regressed on the torque that holds the file's masses,
beside what else they predict and what any drive adds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.oddities.evidence import Evidence, unexplained

#: The factor is the nearest of these, if its interval lies nearer to it than to any other and is
#: no wider than they lie apart.
FACTORS = (-1.0, 0.0, 0.5, 1.0)
WIDEST = 0.25

#: Weight must be this share of the largest one among like joints.
FELT = 0.05

#: Samples on which models are compared, and how much worse one may fit that is as good.
ENOUGH, WORSE = 300, 1.1

#: Stretches by whose scatter an interval is found, and Student's quantile of as many.
STRETCHES, QUANTILE = 20, 2.09


@frozen
class Carried:
    """How much of the file's weight the torque of a joint carries.

    Attributes
    ----------
    joint : int
    factor, half : float
        With the half width of its 95 % interval.
    moving, moving_half : float
        The same of what the file's masses need to be moved; NaN where it does not show.
    """

    joint: int
    factor: float
    half: float
    moving: float = np.nan
    moving_half: float = np.nan

    @property
    def nearest(self) -> float:
        """The one of `FACTORS` that it is, NaN if it may be several."""
        return _nearest(self.factor, self.half)

    @property
    def moves(self) -> float:
        """The same of what moves the masses."""
        return _nearest(self.moving, self.moving_half)

    @property
    def is_half(self) -> bool:
        """Whether all of it is half of what the masses ask for, as far as it shows."""
        near = abs(self.factor - 0.5) <= self.half + 0.1 * 0.5
        return near and self.nearest == 0.5 and (np.isnan(self.moves) or self.moves == 0.5)


def _nearest(value: float, half: float) -> float:
    if not half < WIDEST:
        return np.nan
    own = {min(FACTORS, key=lambda f: abs(f - x)) for x in (value - half, value + half)}
    return own.pop() if len(own) == 1 else np.nan


def measure_carried(evidence: Evidence) -> list[Carried]:
    """Return how much of the file's weight each joint's torque carries, where it has some."""
    weight = evidence.gravity
    size = np.sqrt(np.mean(weight**2, 0))
    units = np.array(evidence.robot.torque_units)
    most = np.array([size[units == u].max() for u in units])
    found = []
    for k in np.flatnonzero((size > FELT * most) & (size > 0) & evidence.measured):
        moving = evidence.predicted[:, k] - weight[:, k]
        own = np.column_stack([weight[:, k], moving, evidence.ordinary(int(k))])
        value, half = regress(own, evidence.torque[:, k])
        if not half[0] < WIDEST:  # weight that hardly varies is told from no offset
            value, half = regress(own[:, [0, 1, 3, 4, 5]], evidence.torque[:, k])
        if np.isfinite(half[0]):
            found.append(Carried(int(k), value[0], half[0], value[1], half[1]))
    return found


def regress(X: Array, y: Array) -> tuple[Array, Array]:
    """Return coefficients of y (N,) on columns (N, p), and half of their 95 % intervals.

    By the scatter of the scores over stretches, which holds what successive samples share; NaN
    where a column does not differ from the others.
    """
    length = np.linalg.norm(X, axis=0)
    used = length > 0
    A = X[:, used] / length[used]
    square, V = np.linalg.eigh(A.T @ A)
    good = square > 1e-9 * square[-1]
    inverse = (V[:, good] / square[good]) @ V[:, good].T
    value = inverse @ (A.T @ y)
    scores = A * (y - A @ value)[:, None]
    sums = np.stack([s.sum(0) for s in np.array_split(scores, STRETCHES)])
    spread = inverse @ (sums.T @ sums) @ inverse * STRETCHES / (STRETCHES - 1)
    lost = (V[:, ~good] ** 2).sum(1) > 1e-6
    half = np.where(lost, np.nan, QUANTILE * np.sqrt(np.diag(spread)))
    out, halves = np.full((2, len(length)), np.nan)
    out[used], halves[used] = value / length[used], half / length[used]
    return out, halves


def find_gravity(evidence: Evidence) -> tuple[str, ...]:
    """Return one sentence on torque that does not carry the file's weight as it should, or none.

    What the sidecar says of torque goes before: `compensated`, `sign`, `gain` and `ratio`.
    """
    torque = evidence.robot.torque
    if not evidence.weighs or torque.compensated is not None:
        return ()
    carried = measure_carried(evidence)
    none = [c for c in carried if c.nearest == 0.0 and c.moves != 0.0]
    # What the masses need to be moved shows that they are right; else the whole fit has to.
    proved = bool(none) and all(c.moves == 1.0 for c in none)
    if none and (proved or _lacks_weight(evidence, [c.joint for c in none])):
        return (_tell_compensated(evidence, none, len(none) == len(carried)),)
    opposite = [c for c in carried if c.nearest == -1.0]
    if opposite and not torque.sign:
        return (
            f"By the masses of the robot file, {_listed(evidence, opposite)}: the torque pulls "
            "the wrong way. Its sign, the direction or zero of a joint, or gravity (a robot that "
            "hangs from the ceiling) is another one: correct it ([torque] sign = -1 in the "
            "sidecar, or gravity in the file; sign = 1 says that the torque is right).",
        )
    half = [c for c in carried if c.is_half]
    told = [c for c in carried if np.isfinite(c.nearest)]
    sure = len(half) == len(told) > 1 or any(_gear(evidence, c.joint) != 1.0 for c in half)
    if half and sure and not (torque.gain or torque.ratio):
        return (
            f"By the masses of the robot file, {_listed(evidence, half)}, and the torque that "
            'moves them no more: it looks like torque before a gear of 2 (side = "motor" under '
            f"[torque] in the sidecar, with its ratio{_tell_gears(evidence, half)}), or the file's "
            "masses are twice too large (gain = 1 there says so).",
        )
    return ()


def _lacks_weight(evidence: Evidence, joints: list[int]) -> bool:
    """Whether the unpruned model fits as well where some joints carry no weight, whatever it is."""
    step = max(1, len(evidence.torque) // ENOUGH)
    motion, tau = evidence.motion[::step], evidence.torque[::step]
    structure, spread = evidence.structure, tau.std(0)
    if not (spread > 0).all():
        return False
    light = structure.robot.model.copy()
    light.gravity.linear = np.zeros(3)
    W = structure.model.regressor(structure.robot, motion)[:, :, structure.base.kept]
    other = structure.model.regressor(replace(structure.robot, model=light), motion)
    bare = W.copy()
    bare[:, joints] = other[:, joints][:, :, structure.base.kept]
    given, lighter = (unexplained(x / spread[:, None], tau / spread) for x in (W, bare))
    return lighter <= WORSE * given


def _tell_compensated(evidence: Evidence, none: list[Carried], every: bool) -> str:
    names = ", ".join(f'"{evidence.joints[c.joint]}"' for c in none)
    return (
        f"By the masses of the robot file, {_listed(evidence, none)}, although it moves them: the "
        "effort is compensated for gravity, as some drivers report it, and no mass that is found "
        f"stands. Say compensated = {'true' if every else f'[{names}]'} under [torque] in the "
        "sidecar, and what holds the file's weight is added again; false, where a spring or a "
        "counterweight that the file does not state holds it."
    )


def _listed(evidence: Evidence, those: list[Carried]) -> str:
    said = [f"{evidence.joints[c.joint]} {c.factor:.2f} ± {c.half:.2f}" for c in those]
    return f"the torque carries another share of the weight than all of it ({listing(said, 6)})"


def _gear(evidence: Evidence, joint: int) -> float:
    """Return the gear that an MJCF states of a joint; 1 for none."""
    entry = evidence.robot.entries.get("actuator_force", {}).get(evidence.joints[joint])
    return abs(entry.factor) if entry else 1.0


def _tell_gears(evidence: Evidence, half: list[Carried]) -> str:
    gears = [g for c in half if (g := _gear(evidence, c.joint)) != 1.0]
    return f"; the file states a gear of {gears[0]:g}" if gears else ""
