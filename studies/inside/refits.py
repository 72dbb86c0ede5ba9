"""Bootstrap: refits on resampled blocks of time."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.bootstrap import draw_blocks, merge_blocks
from identifiability.estimation.least_squares import refit
from identifiability.workflows.analyze import Analysis
from inside.pair import Pair, all_rows, difference, timed


def measure(analysis: Analysis, replicates: int, seed: int) -> Pair:
    """Refit the unpruned model to resampled blocks, from Gram matrices and from rows."""
    full = analysis.full
    information = full.submodel.reduce(analysis.information)
    merged = merge_blocks(information, full.uncertainty.block)
    counts = draw_blocks(len(merged.counts), replicates, np.random.default_rng(seed))
    weights, kept = full.estimate.weights, list(full.estimate.kept)
    ours, values = timed(lambda: refit(merged.select(kept), weights, counts), 5)

    rows = all_rows(analysis, full.submodel, merged)
    blocks = [np.flatnonzero(rows.block == b) for b in range(len(merged.counts))]
    W, tau = rows.weighted(weights)
    W, n = W[:, kept], rows.tau.shape[1]

    def naive() -> list[np.ndarray]:
        out = []
        for drawn in counts.astype(int):
            samples = np.concatenate([blocks[b] for b, c in enumerate(drawn) for _ in range(c)])
            at = (n * samples[:, None] + np.arange(n)).ravel()
            out.append(np.linalg.lstsq(W[at], tau[at], rcond=None)[0])
        return out

    slow, refits = timed(naive)
    return Pair(
        "bootstrap", "least squares on all rows of every resampled log",
        f"{replicates} replicates, {len(W)} rows, {len(kept)} parameters",
        ours, slow, difference(values, np.array(refits)), 1e-8, "values of all refits",
    )  # fmt: skip
