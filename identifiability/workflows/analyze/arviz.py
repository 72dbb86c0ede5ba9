"""Posteriors for ArviZ: every draw, by chain, with names and units. Needs the extra ``arviz``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from identifiability.foundation.errors import ModelError
from identifiability.foundation.names import Array
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.analyze.belief import Belief

if TYPE_CHECKING:
    from xarray import DataTree

Which = Literal["physical", "signs"]

PARAMETER, STANDARD = "parameter", "standard_parameter"


def build_datatree(
    belief: Belief | None,
    result: RungResult,
    which: Which = "physical",
    attributes: dict[str, str] | None = None,
) -> DataTree:
    """Return a posterior of a model as ArviZ reads it.

    Group ``posterior`` holds ``phi`` of the model's parameters, by walker (a chain each) and draw;
    with ``which="physical"`` also ``standard`` of the standard parameters that the model does not
    hold. The coordinate ``ensemble`` says which chains started together, for
    `arviz_stats.rhat_nested`. Group ``constant_data`` holds the estimate, its σ and unit, the
    prior, and ``sway``, by how many sd a mean may move with the prior's density at edges. The
    attribute ``trustworthy`` is 0, with the reasons beside it, where the chains have not converged.

    Parameters
    ----------
    belief : Belief or None
    result : RungResult
        The model that the belief is about.
    which : {"physical", "signs"}
    attributes : dict of str, optional
        Further attributes, such as versions and seeds.

    Raises
    ------
    ModelError
        If there is no such posterior, or no package to hold it.
    """
    try:
        from xarray import Dataset, DataTree  # noqa: PLC0415 - an extra
    except ImportError:
        raise ModelError(
            "A posterior for ArviZ needs the extra 'arviz': pip install 'identifiability[arviz]'."
        ) from None
    if belief is None:
        raise ModelError("The result has no posterior; ask for it with analyze(…, posterior=True).")
    summary = belief.physical if which == "physical" else belief.signs
    if summary is None:
        raise ModelError(f"The result has no posterior '{which}': {belief.note}.")
    estimate, standard = result.estimate, belief.standard
    draws = {"phi": _walkers(summary.chains, PARAMETER)}
    constants = {
        "estimate": (PARAMETER, estimate.value),
        "sigma": (PARAMETER, estimate.sigma),
        "sway": (PARAMETER, summary.sway),
        "unit": (PARAMETER, [v.unit for v in result.verdicts]),
    }
    names = {PARAMETER: list(result.rung.columns)}
    if which == "physical" and standard is not None:
        moving = np.ptp(standard.chains, axis=(0, 1, 2)) > 0
        draws["standard"] = _walkers(standard.chains[..., moving], STANDARD)
        constants["prior_mean"] = (STANDARD, standard.prior_mean[moving])
        constants["prior_sd"] = (STANDARD, standard.prior_sd[moving])
        names[STANDARD] = [n for n, moves in zip(standard.names, moving, strict=True) if moves]
    ensembles, walkers, length = summary.chains.shape[:3]
    along = {
        "chain": np.arange(ensembles * walkers),
        "draw": np.arange(length),
        "ensemble": ("chain", np.repeat(np.arange(ensembles), walkers)),
    }
    groups = {
        "posterior": Dataset(draws, names | along),
        "constant_data": Dataset(constants, names),
    }
    tree = DataTree.from_dict(groups)
    tree.attrs = {  # strings and numbers, which NetCDF can hold
        **(attributes or {}),
        "model": result.name,
        "posterior": which,
        "trustworthy": int(summary.trustworthy),
        "reasons": " ".join(summary.convergence.reasons),
    }
    return tree


def _walkers(chains: Array, of: str) -> tuple[tuple[str, ...], Array]:
    """Walkers of all ensembles as chains: (E, K, N, m) → (E K, N, m)."""
    return ("chain", "draw", of), chains.reshape(-1, *chains.shape[2:])
