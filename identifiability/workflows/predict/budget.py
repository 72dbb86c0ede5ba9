"""What the torque of each joint is spent on: weight and springs, motion, friction, and the rest.

The parts are told apart by what they do, not by the names of effects, so that those of a user's
own count too: what is left at rest in the same pose; what changes its sign with velocity; and what
remains of the model, which is inertia, with Coriolis and centrifugal torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from identifiability.foundation.names import Array
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.robot import Motion
from identifiability.workflows.predict.fit import Fit

#: Parts of the torque in the order in which they are shown, and the whole.
PARTS = ("gravity and springs", "inertia", "friction", "left over")

#: A part below this share of the largest is a rounding error.
ROUNDING = 1e-9

#: Samples of all logs that it is worked out at.
ENOUGH = 2000


def torque_budget(fit: Fit, samples: Sequence[Prepared]) -> pd.DataFrame:
    """Return the rms of each part of each joint's torque along some logs, one row a joint.

    Columns are ``joint``, ``unit`` [N or N·m], ``measured`` and `PARTS`, rms each about zero. As
    parts may cancel each other, their squares do not add up to that of what was measured.

    Parameters
    ----------
    fit : Fit
    samples : sequence of Samples or LongSamples
        Prepared logs; torque is taken as it was measured, not low-passed.
    """
    step = max(1, -(-sum(s.survey.kept for s in samples) // ENOUGH))
    n = len(fit.robot.joints)
    squares, count = np.zeros((1 + len(PARTS), n)), np.zeros(n)
    for s in samples:
        thinned = s.thin(step)
        parts = _split(fit, thinned.motion)
        left = thinned.tau - sum(parts)
        data = np.ones(left.shape) if thinned.dwells is None else ~thinned.dwells
        squares += [(part**2 * data).sum(0) for part in (thinned.tau, *parts, left)]
        count += data.sum(0)
    rms = np.sqrt(squares / np.maximum(count, 1))
    rms[rms < ROUNDING * rms.max(axis=0)] = 0.0
    named = dict(zip(("measured", *PARTS), rms, strict=True))
    robot = fit.robot
    return pd.DataFrame({"joint": robot.joints, "unit": robot.torque_units, **named})


def _split(fit: Fit, motion: Motion) -> tuple[Array, Array, Array]:
    """Return the torque at rest, the rest that is even in velocity, and what is odd, (N, n)."""
    values = np.zeros(len(fit.structure.base.parameters))
    values[fit.structure.base.kept] = fit.base

    def torque(direction: float, acceleration: float) -> Array:
        smooth = motion.smooth_v
        moved = replace(
            motion,
            smooth_v=None if smooth is None else smooth * np.array([[direction], [1.0]]),
            v=direction * motion.v,
            actuated_v=direction * motion.actuated_v,
            a=acceleration * motion.a,
            actuated_a=acceleration * motion.actuated_a,
        )
        out: Array = fit.structure.model.regressor(fit.robot, moved) @ values
        return out

    forward, backward, rest = torque(1.0, 1.0), torque(-1.0, 1.0), torque(0.0, 0.0)
    even = (forward + backward) / 2
    return rest, even - rest, (forward - backward) / 2
