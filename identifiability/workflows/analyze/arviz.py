"""Posteriors for ArviZ: every draw, by chain, with names and units. Needs the extra ``arviz``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from identifiability.foundation.errors import ModelError
from identifiability.foundation.names import Array
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.analyze.belief import Belief, StandardBelief, Summary

if TYPE_CHECKING:
    from xarray import DataTree

Which = Literal["physical", "signs"]

#: Dimensions and values by name, as xarray takes them.
Variables = dict[str, tuple[tuple[str, ...], Array]]

PARAMETER, STANDARD = "parameter", "standard_parameter"


def build_datatree(
    belief: Belief | None,
    result: RungResult,
    which: Which = "physical",
    attributes: dict[str, str] | None = None,
) -> DataTree:
    """Return a posterior of a model as ArviZ reads it.

    Group ``posterior`` holds ``phi`` of the model's parameters, by walker (a chain each) and draw;
    with ``which="physical"`` also ``standard`` of the standard parameters. The coordinate
    ``ensemble`` says which chains started together, for `arviz_stats.rhat_nested`. Group
    ``constant_data`` holds the estimate and its σ, and the prior. The attribute ``trustworthy`` is
    0, with the reasons beside it, where the chains have not converged.

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
    summary = _choose(belief, which)
    standard = belief.standard if belief is not None and which == "physical" else None
    names = _names(result, standard)
    tree = DataTree.from_dict(
        {
            "posterior": Dataset(
                _draws(summary, standard), names | _chains(summary) | {"unit": _units(result)}
            ),
            "constant_data": Dataset(_constants(result, standard), names),
        }
    )
    tree.attrs = {**(attributes or {}), **_describe(result, summary, which)}
    return tree


def _choose(belief: Belief | None, which: Which) -> Summary:
    if belief is None:
        raise ModelError("The result has no posterior; ask for it with analyze(…, posterior=True).")
    summary = belief.physical if which == "physical" else belief.signs
    if summary is None:
        raise ModelError(f"The result has no posterior '{which}': {belief.note}.")
    return summary


def _draws(summary: Summary, standard: StandardBelief | None) -> Variables:
    """Walkers of all ensembles as chains: (E, K, N, m) → (E K, N, m)."""
    given = {"phi": (summary.chains, PARAMETER)}
    if standard is not None:
        given["standard"] = (standard.chains, STANDARD)
    return {
        name: (("chain", "draw", of), chains.reshape(-1, *chains.shape[2:]))
        for name, (chains, of) in given.items()
    }


def _constants(result: RungResult, standard: StandardBelief | None) -> Variables:
    estimate = result.estimate
    constants: Variables = {
        "estimate": ((PARAMETER,), estimate.value),
        "sigma": ((PARAMETER,), estimate.sigma),
    }
    if standard is not None:
        constants["prior_mean"] = ((STANDARD,), standard.prior_mean)
        constants["prior_sd"] = ((STANDARD,), standard.prior_sd)
    return constants


def _names(result: RungResult, standard: StandardBelief | None) -> Variables:
    names: Variables = {PARAMETER: ((PARAMETER,), np.array(result.rung.columns))}
    if standard is not None:
        names[STANDARD] = ((STANDARD,), np.array(standard.names))
    return names


def _chains(summary: Summary) -> Variables:
    ensembles, walkers, draws = summary.chains.shape[:3]
    return {
        "chain": (("chain",), np.arange(ensembles * walkers)),
        "draw": (("draw",), np.arange(draws)),
        "ensemble": (("chain",), np.repeat(np.arange(ensembles), walkers)),
    }


def _units(result: RungResult) -> tuple[tuple[str, ...], Array]:
    return (PARAMETER,), np.array([v.unit for v in result.verdicts])


def _describe(result: RungResult, summary: Summary, which: Which) -> dict[str, str | int]:
    """Attributes that NetCDF can hold: strings and numbers."""
    return {
        "model": result.name,
        "posterior": which,
        "trustworthy": int(summary.trustworthy),
        "reasons": " ".join(summary.convergence.reasons),
    }
