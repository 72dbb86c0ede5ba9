"""What rows count: stretches that no model follows are left out where they would decide."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from identifiability.estimation.decisive import Decisive, find_decisive, leave_out_bursts
from identifiability.estimation.estimate import weigh_logs
from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.information import Information

#: Stretches that are listed.
LISTED = 3


def state_decisive(
    joints: Sequence[str], samples: Sequence[Prepared], information: Information, fit: Estimate
) -> str:
    """Return one sentence on stretches that decide a value though no model follows them, or none.

    Parameters
    ----------
    joints : sequence of str
        The n actuated ones.
    samples : sequence of Samples
        The logs that were fitted.
    information : Information
        About the fitted columns.
    fit : Estimate
    """
    found = find_decisive(information, fit)
    if found is None:
        return ""
    name = information.columns[found.parameter]
    return (
        f"{_where(joints, samples, found)} decides: without it {name} moves by "
        f"{found.moved:.1f} of the standard deviations that the rest of the logs leaves. Look at "
        "what happened there, and cut it out if it is no motion of this robot."
    )


def weigh_rows(
    joints: Sequence[str],
    samples: Sequence[Prepared],
    information: Information,
    estimator: Estimator,
) -> tuple[Information, str]:
    """Return the information without stretches that would decide, and a sentence on them if any.

    Logs are weighed by their noise.

    Parameters
    ----------
    joints, samples
        As in `state_decisive`.
    information : Information
        About all columns.
    estimator : Estimator
    """
    kept, found = leave_out_bursts(information, estimator)
    kept = weigh_logs(kept, estimator)
    if found is None:
        return kept, ""
    return kept, (
        f"{_where(joints, samples, found)} would decide: with it "
        f"{information.columns[found.parameter]} moves by {found.moved:.1f} of the standard "
        "deviations that the rest of the logs leaves. It was left out of the fit; errors count it. "
        "Look at what happened there."
    )


def _where(joints: Sequence[str], samples: Sequence[Prepared], found: Decisive) -> str:
    """Return where stretches are and how far from the model, up to what they do."""
    ends = np.flatnonzero((np.diff(found.log) != 0) | (found.first[1:] > found.last[:-1])) + 1
    stretches = list(pairwise([0, *ends.tolist(), len(found.log)]))
    named = []
    for a, b in stretches:
        log = samples[int(found.log[a])]
        start, stop = _times(log, int(found.first[a]), int(found.last[b - 1]))
        named.append(f"{log.name} from t = {start:.5g} to {stop:.5g} s")
    worst = int(np.argmax(found.beyond))
    return (
        f"{listing(named, LISTED)}: the torque of {joints[worst]} is up to "
        f"{np.sqrt(found.beyond[worst]):.0f} times farther from the model than usual, and"
    )


def _times(samples: Prepared, first: int, last: int) -> Array:
    """Return the times of two outputs [s], of the second the one before it; of long logs about."""
    if isinstance(samples, Samples):
        return samples.output_times()[[first, last - 1]]
    survey, at = samples.survey, np.array([first, last])
    times: Array = survey.start + (survey.stop - survey.start) * at / survey.outputs
    return times
