"""Numbers beside how uncertain they are, in sentences and as shares of simulated experiments.

Binomial intervals hold for shares whose trials are independent, clustered ones where they are not.
"""

from __future__ import annotations

import math

import numpy as np
import scipy

from identifiability.foundation.values import frozen

# Shares counted in simulated experiments, with the Monte-Carlo error of the count.


#: Level of every interval.
LEVEL = 0.95

#: Standard deviations to each side of a normal interval of that level, and quantiles at its ends.
REACH, ENDS = 1.96, (0.025, 0.975)


@frozen
class Share:
    """A share that was counted.

    Attributes
    ----------
    value : float
        NaN where there was nothing to count.
    low, high : float
        Interval within which the true share lies.
    """

    value: float
    low: float
    high: float


def exact_share(count: float, total: float, level: float = LEVEL) -> Share:
    """Return a binomial share with its exact interval [Clopper & Pearson 1934].

    Parameters
    ----------
    count, total : float
        Need not be whole: effective numbers are allowed.
    level : float
        Of the interval.
    """
    if not total > 0:
        return Share(float("nan"), float("nan"), float("nan"))
    tail = 0.5 * (1 - level)
    beta = scipy.stats.beta
    low = float(beta.ppf(tail, count, total - count + 1)) if count > 0 else 0.0
    high = float(beta.ppf(1 - tail, count + 1, total - count)) if count < total else 1.0
    return Share(count / total, low, high)


def clustered_share(events: np.ndarray, among: np.ndarray, related: np.ndarray) -> Share:
    """Return the share of events among what was looked at, several in each experiment.

    Events of one experiment come together, so the count is worth that of fewer independent ones
    [Korn & Graubard 1998]. Where events are rare, how much they come together is taken from
    related events that are not.

    Parameters
    ----------
    events, among, related : (T, k) bool
        Rows are experiments.
    """
    total = float(among.sum())
    if not total:
        return exact_share(0, 0)
    together = max(design_effect(events, among), design_effect(related, among), 1.0)
    effective = total / together
    return exact_share(float((events & among).sum()) / total * effective, effective)


def design_effect(events: np.ndarray, among: np.ndarray) -> float:
    """Return by how much the variance of a share exceeds that of independent events, or 0."""
    trials = len(events)
    size = among.sum(1).astype(float)
    count = (events & among).sum(1).astype(float)
    share = count.sum() / size.sum()
    independent = share * (1 - share) / size.sum()
    if not independent > 0 or trials < 2:
        return 0.0
    left = count - share * size
    return float(left @ left / size.sum() ** 2 * trials / (trials - 1) / independent)


def each_share(events: np.ndarray) -> tuple[Share, ...]:
    """Return the share of every column of (T, k), all intervals right together [Bonferroni]."""
    trials, count = events.shape
    level = 1 - (1 - LEVEL) / max(count, 1)
    return tuple(exact_share(float(c), float(trials), level) for c in events.sum(0))


# Numbers as sentences have them: beside how uncertain they are, and in percent.


def measured(value: float, half: float, unit: str = "") -> str:
    """Return a value and half of its interval, which keeps two digits.

    Parameters
    ----------
    value, half : float
    unit : str
        Goes behind the value.

    Examples
    --------
    >>> measured(1.5234, 0.0412, "kg"), measured(18.26, 3.1, "%"), measured(-60.4, 250.0)
    ('1.523 kg ± 0.041', '18.3 % ± 3.1', '-60 ± 250')
    """
    places = 0
    if 0 < half < math.inf:
        places = max(0, 1 - math.floor(math.log10(half)))
    value, half = round(value, places) + 0.0, round(half, places)
    return f"{value:.{places}f}{f' {unit}' if unit else ''} ± {half:.{places}f}"
