"""A log that disagrees with the others, found before effects are named: which, where and when.

What differs between logs (a load, a temperature, another robot) looks like whatever effect the
logs' motions happen to tell apart. Only a log is told of without which the others agree: an effect
that the model misses makes all of them disagree. It is left out while effects are named. One whose
motion alone shows an effect is odd, too: where what is named with it explains it, it stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from identifiability.estimation.estimate import find_estimator
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.uncertainty import LEVEL, Motions, compare_motions
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze.words import differences

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


@frozen
class OddLog:
    """A log that disagrees with the others.

    Attributes
    ----------
    number : int
        Which of the logs, fitted ones first.
    name : str
    difference : str
        What differs there, in which joint and when, in words.
    """

    number: int
    name: str
    difference: str

    @property
    def left_out(self) -> str:
        """What is said where effects are named without it."""
        return (
            f"{self.name} disagrees with the other logs, and did so before any effect was looked "
            f"for: {self.difference}. A payload, a temperature or another robot does that: it was "
            "left out, and effects are named from the others; diagnose it by itself."
        )

    @property
    def doubted(self) -> str:
        """What is said of a log that is not fitted, and so cannot be left out."""
        return (
            f"{self.name}, which judges what was named, disagrees with the fitted logs, and did so "
            f"before any effect was looked for: {self.difference}. A payload, a temperature or "
            "another robot does that, or motion that alone shows what is missing: what it refutes "
            "may be right; verify on another log, or fit this one, too."
        )

    @property
    def kept(self) -> str:
        """What is said where effects that are named with it explain it."""
        return (
            f"{self.name} disagreed with the other logs before any effect was looked for: "
            f"{self.difference}. What is named here explains that, so it was kept."
        )


def describe_odd_log(
    regression: Regression, information: Information, fit: Estimate
) -> OddLog | None:
    """Return the log that disagrees with the others, or None."""
    found = find_odd_log(information, fit)
    if found is None:
        return None
    motions, odd = found
    log = int(motions.which[odd])
    others = fit.estimator.fit(information.take(information.log != log))
    scale = np.sqrt(np.maximum(others.variance, 1e-300))
    where = locate_error(regression, log, others.value, scale, regression.robot.joints)
    difference = f"{differences(motions, information.columns, odd)}; {where}"
    return OddLog(log, regression.samples[log].name, difference)


def still_odd(structure: Structure, samples: Sequence[Prepared], number: int) -> bool:
    """Whether a log disagrees with the others under a model, too."""
    information = gather_information(structure.regression(tuple(samples)))
    found = find_odd_log(information, find_estimator("wls").fit(information))
    return found is not None and int(found[0].which[found[1]]) == number


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
