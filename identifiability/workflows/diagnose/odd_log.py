"""A log that disagrees with the others, found before effects are named: which, where and when.

What differs between logs (a load, a temperature, another robot) looks like whatever effect the
logs' motions happen to tell apart. Only a log is told of without which the others agree: an effect
that the model misses makes all of them disagree.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.motions import LEVEL, Motions, compare_motions
from identifiability.foundation.names import Array
from identifiability.regression.information import Information
from identifiability.regression.regression import Regression
from identifiability.workflows.analyze.several_logs import differences

#: Stretches of the log that are looked at, and how much more than the typical one is "when".
STRETCHES, STANDS_OUT = 8, 1.5
#: Logs of which one can be odd.
FEWEST = 3


def find_odd_log(information: Information, fit: Estimate) -> tuple[Motions, int] | None:
    """Return what logs say of each other and the odd one among them; None where none is.

    Parameters
    ----------
    information : Information
        About the base parameters, of several logs.
    fit : Estimate
        To all of them.
    """
    motions = compare_motions(information, fit, fit.memory)
    if motions is None or len(motions.which) < FEWEST or motions.agree:
        return None
    odd = motions.odd()
    return (motions, odd) if motions.without(odd) >= LEVEL and motions.moved.any() else None


def state_odd_log(regression: Regression, information: Information, fit: Estimate) -> str:
    """Return one sentence on the log that disagrees with the others, or none."""
    found = find_odd_log(information, fit)
    if found is None:
        return ""
    motions, odd = found
    log = int(motions.which[odd])
    others = fit.estimator.fit(information.take(information.log != log))
    name, joints = regression.samples[log].name, regression.robot.joints
    scale = np.sqrt(np.maximum(others.variance, 1e-300))
    where = locate_error(regression, log, others.value, scale, joints)
    return (
        f"{name} disagrees with the other logs, and did so before any effect was looked for: "
        f"{differences(motions, information.columns, odd)}; {where}. A payload, a temperature "
        "or another robot does that: leave it out, or diagnose it by itself, or its difference may "
        "be named as an effect."
    )


def locate_error(
    regression: Regression, log: int, value: Array, scale: Array, joints: Sequence[str]
) -> str:
    """Return the joint and the time at which what the other logs say errs most, in words.

    Parameters
    ----------
    regression : Regression
    log : int
    value : (b,)
        From the other logs.
    scale : (n,) [N·m or N]
        What is usual of each joint.
    joints : sequence of str
    """
    only = Regression(
        regression.robot, regression.model, (regression.samples[log],), regression.columns
    )
    parts = [(c.t.copy(), c.tau - c.W @ value) for p in only.parts() for c in p.chunks()]
    t, left = (np.concatenate(x) for x in zip(*parts, strict=True))
    edges = np.linspace(0, len(t), STRETCHES + 1).astype(int)
    rms = np.array(
        [
            np.sqrt(np.mean(left[a:b] ** 2, axis=0)) / scale
            for a, b in pairwise(edges.tolist())
            if b > a
        ]
    )
    k = int(np.argmax(np.mean(rms**2, axis=0)))
    at, typical = int(np.argmax(rms[:, k])), float(np.median(rms[:, k]))
    when = "all the time"
    if rms[at, k] > STANDS_OUT * typical:
        when = f"most from {t[edges[at]]:.3g} to {t[edges[at + 1] - 1]:.3g} s"
    return f"what the others say errs there most in {joints[k]}, {when}"
