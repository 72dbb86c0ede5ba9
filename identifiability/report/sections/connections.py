"""How torque and parameters hang together: the budget of each joint, the map of confusions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.blocks import Section
from identifiability.report.figures.confusion import (
    CONFUSED,
    MOST,
    draw_budget,
    draw_confusion,
    order_confused,
)
from identifiability.report.numbers import digits, format_number, join
from identifiability.report.tables import Column, Table
from identifiability.report.words import picture, section
from identifiability.workflows.predict.fit import PARTS, Fit, torque_budget
from identifiability.workflows.predict.prediction import correlation_of

#: Pairs that are named in words.
PAIRS = 3


def section_budget(fit: Fit, samples: Sequence[Prepared]) -> Section:
    """Return what the torque of each joint is spent on along some logs."""
    frame = torque_budget(fit, samples)
    whole = frame["measured"].to_numpy()
    shares = frame[list(PARTS)].to_numpy() / np.where(whole > 0, whole, np.nan)[:, None]
    text = [f"{format_number(x, 3)} {unit}" for x, unit in zip(whole, frame["unit"], strict=True)]
    figure = draw_budget(list(frame["joint"]), shares, PARTS, text)
    own = (
        Column("joint"),
        Column("unit"),
        *(Column(name, digits(3)) for name in ("measured", *PARTS)),
    )
    table = Table.of("", own, frame.itertuples(index=False, name=None))
    return section("analysis.budget", picture("budget", figure), table)


def section_confused(fit: Fit) -> Section:
    """Return the parameters whose estimates hang together, as a map and in words."""
    correlation = correlation_of(fit.covariance)
    at = order_confused(correlation)
    if not len(at):
        text = f"None: no two estimates are correlated by more than {CONFUSED:g}."
        return section("analysis.confused", text=text)
    names = [fit.names[k] for k in at]
    own = correlation[np.ix_(at, at)]
    figure = draw_confusion(names, own)
    return section("analysis.confused", picture("confused", figure), text=_words(names, own))


def _words(names: Sequence[str], correlation: Array) -> str:
    rows, columns = np.triu_indices(len(names), 1)
    rho = np.nan_to_num(correlation[rows, columns])
    first = np.argsort(-np.abs(rho), kind="stable")[:PAIRS]
    pairs = [
        f"{names[rows[k]]} and {names[columns[k]]} ({format_number(float(rho[k]), 2)})"
        for k in first
        if abs(rho[k]) > CONFUSED
    ]
    most = " (the strongest groups are shown)" if len(names) == MOST else ""
    return (
        f"The logs tell these {len(names)} parameters apart worse than each from zero{most}. Most "
        f"confused: {join(pairs)}. Where the correlation is near −1 their sum, near 1 their "
        "difference is known better than either of them; a motion that moves them apart helps."
    )
