"""Limits of the drives: torque and power of the nominal model stay below them."""

import numpy as np
import pytest

from identifiability import excite, simulate
from identifiability.simulation import PrescribedMotion

QUICK = {"evaluations": 400, "samples": 200, "duration": 4.0}


def torque_of(robot, motion):
    return simulate(robot, motion).tau


@pytest.mark.parametrize("kind", ["tau", "power"])
def test_a_motion_stays_below_what_the_drives_can_do(two_link, kind):
    free = excite(two_link, **QUICK)
    tau = torque_of(two_link, PrescribedMotion(*free.motion))
    asked = np.abs(tau if kind == "tau" else tau * free.motion[2]).max(0)
    most = {j: {kind: float(0.7 * a)} for j, a in zip(two_link.joints, asked, strict=True)}
    tame = excite(two_link, limits=most, **QUICK)
    for motion in (PrescribedMotion(*tame.motion), tame.play(200.0)):
        used = torque_of(two_link, motion)
        used = np.abs(used if kind == "tau" else used * motion.dq).max(0)
        assert (used <= 1.02 * 0.7 * asked).all()
