"""What rows count: by their noise, and outlying stretches less."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from identifiability.estimation.estimate import forget_noise, weigh_logs
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.outliers import Outliers, weigh_outliers
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.information import Information

#: Stretches that are listed.
LISTED = 3


def weigh_rows(
    joints: Sequence[str],
    samples: Sequence[Prepared],
    information: Information,
    estimator: Estimator,
) -> tuple[Information, str]:
    """Return the information with rows weighed by their noise, and a sentence on outliers if any.

    Outlying stretches are weighed down, and logs count by their noise. Said is what would have
    moved a value out of its interval.

    Parameters
    ----------
    joints : sequence of str
        The n actuated ones.
    samples : sequence of Samples
        The logs that are fitted.
    information : Information
        About all columns.
    estimator : Estimator
    """
    weighed, found = weigh_outliers(information, forget_noise(estimator))
    weighed = weigh_logs(weighed, estimator)
    if found is None or found.moved.max() <= REACH:
        return weighed, ""
    most = int(np.argmax(found.moved))
    return weighed, (
        f"{_where(joints, samples, found)} is weighed down in the fit: with its whole weight "
        f"{information.columns[most]} moves by {found.moved[most]:.1f} of its standard deviations. "
        "Errors count it. Look at what happened there."
    )


def _where(joints: Sequence[str], samples: Sequence[Prepared], found: Outliers) -> str:
    """Return where outliers are, the farthest first, and how far from the model."""
    ends = np.flatnonzero((np.diff(found.log) != 0) | (found.first[1:] > found.last[:-1])) + 1
    stretches = list(pairwise([0, *ends.tolist(), len(found.log)]))
    stretches.sort(key=lambda ab: -float(found.beyond[ab[0] : ab[1]].max()))
    named = []
    for a, b in stretches:
        log = samples[int(found.log[a])]
        start, stop = _times(log, int(found.first[a]), int(found.last[b - 1]))
        named.append(f"{log.name} from t = {start:.5g} to {stop:.5g} s")
    beyond = found.beyond.max(0)
    worst = int(np.argmax(beyond))
    return (
        f"{listing(named, LISTED)}: the torque of {joints[worst]} is up to "
        f"{np.sqrt(beyond[worst]):.0f} times farther from the model than usual, and"
    )


def _times(samples: Prepared, first: int, last: int) -> Array:
    """Return the times of two outputs [s], of the second the one before it; of long logs about."""
    if isinstance(samples, Samples):
        return samples.output_times()[[first, last - 1]]
    survey, at = samples.survey, np.array([first, last])
    times: Array = survey.start + (survey.stop - survey.start) * at / survey.outputs
    return times
