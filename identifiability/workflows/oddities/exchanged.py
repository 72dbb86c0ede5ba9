"""Joints that are exchanged, turn the other way round, or are in degrees, by what explains torque.

Where the unpruned model explains a log badly, it is fitted to the same samples as if two joints
had exchanged their positions, or positions and torque, or one were given with the other sign or in
degrees. What `regression.mix_up` finds in the torque columns alone is left to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.values import frozen
from identifiability.robot import complete_motion
from identifiability.workflows.oddities.evidence import Evidence, unexplained

#: Relative error of the unpruned model up to which nothing is looked for.
BAD = 0.1

#: The sum of squared errors must fall below this share of that of the log as it is.
FAR = 0.2

#: Samples that are looked at, and joints beyond which only neighbours are tried.
ENOUGH, MOST = 300, 8

DEGREE = np.pi / 180


@frozen
class _Change:
    """Columns of positions and torque as they might have been meant.

    `order` and `factor` are those of positions, `torques` and `signs` those of torque columns;
    `says` is for "the unpruned model would err by …"; without it nothing is to be said here.
    """

    order: tuple[int, ...]
    factor: tuple[float, ...]
    torques: tuple[int, ...]
    signs: tuple[float, ...]
    says: str = ""


def find_exchanged(evidence: Evidence) -> tuple[str, ...]:
    """Return one sentence on joints that are exchanged, turned, or in degrees, or none."""
    robot, n = evidence.robot, len(evidence.joints)
    if robot.closed or n < 2:
        return ()
    plain = _Change(tuple(range(n)), (1.0,) * n, tuple(range(n)), (1.0,) * n)
    given = _error(evidence, plain)
    if not given > BAD:
        return ()
    tried = [(_error(evidence, c), c) for c in _candidates(evidence, plain)]
    least, best = min(tried, key=lambda pair: pair[0])
    if least**2 >= FAR * given**2 or not best.says:
        return ()
    return (
        f"{best.says}: read so, the unpruned model would err by {100 * least:.2g} % instead of "
        f"{100 * given:.2g} %. Check which column is which, and its unit and direction.",
    )


def _candidates(evidence: Evidence, plain: _Change) -> Iterator[_Change]:
    """Yield what the columns might have been meant to be."""
    names, n = evidence.joints, len(evidence.joints)
    same, one = plain.order, plain.factor
    near = n > MOST
    for i, j in combinations(range(n), 2):
        if near and j > i + 1:
            continue
        order = list(same)
        order[i], order[j] = j, i
        swap, pair = tuple(order), f"{names[i]} and {names[j]}"
        yield _Change(swap, one, same, one, f"The positions of {pair} seem to be exchanged")
        yield _Change(swap, one, swap, one, f"The joints {pair} seem to be exchanged")
        yield _Change(same, one, swap, one)
    for k in range(n):
        turned = tuple(-1.0 if i == k else 1.0 for i in range(n))
        small = tuple(DEGREE if i == k else 1.0 for i in range(n))
        who = names[k]
        yield _Change(
            same, turned, same, one, f"The positions of {who} seem to have the wrong sign"
        )
        yield _Change(same, turned, same, turned, f"The joint {who} seems to turn the other way")
        yield _Change(same, one, same, turned)
        if not evidence.robot.is_prismatic(int(evidence.robot.actuated[k])):
            yield _Change(same, small, same, one, f"The angles of {who} seem to be degrees")
    slides = [evidence.robot.is_prismatic(int(k)) for k in evidence.robot.actuated]
    angles = tuple(1.0 if s else DEGREE for s in slides)
    advice = "The angles seem to be degrees (--angles deg)"
    yield _Change(same, angles, same, one, advice)
    yield _Change(same, one, same[::-1], one)
    for shift in range(1, n):
        yield _Change(same, one, same[shift:] + same[:shift], one)


def _error(evidence: Evidence, change: _Change) -> float:
    """Return the relative error of the unpruned model with an offset a joint, joints alike."""
    step = max(1, len(evidence.torque) // ENOUGH)
    some, tau = evidence.motion[::step], evidence.torque[::step]
    order, factor = list(change.order), np.array(change.factor)
    tau = tau[:, list(change.torques)] * change.signs
    spread = tau.std(0)
    if not (spread > 0).all():
        return 0.0
    if change.order == tuple(range(len(order))) and (factor == 1.0).all():
        motion = some
    else:
        moved = [x[:, order] * factor for x in (some.actuated_q, some.actuated_v, some.actuated_a)]
        try:
            motion = complete_motion(evidence.robot, some.t, *moved)
        except ClosureError:
            return np.inf
    structure = evidence.structure
    W = structure.model.regressor(structure.robot, motion)[:, :, structure.base.kept]
    return unexplained(W / spread[:, None], tau / spread)
