"""`KnownValues`: values that a diagnosis keeps, and how far they may be wrong.

Values that nobody refits have errors all the same: those of the logs they were fitted to, or of a
drawing. What is within these errors is no effect. They enter as observations beside the rows of
the logs: of every direction of the base parameters one, with the standard deviation that it has.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import INERTIAL_KINDS, Array, Parameter
from identifiability.foundation.numbers import percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import state_rows
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.predict import Fit, Predicts, read_fit

#: What a diagnosis may be told of the values it keeps.
Given = bool | float | str | Path | Fit | Predicts

#: Shares of the largest variance below which a direction counts as known that well.
LEAST: Tolerance = 1e-10
#: What the ten inertial parameters are numbers of.
VECTORS = (("m",), ("mx", "my", "mz"), INERTIAL_KINDS[4:])


@frozen
class KnownValues:
    """Base parameters that are kept, with their covariance.

    Attributes
    ----------
    values : (b,)
    covariance : (b, b)
        Zero where they are exact.
    words : str
        What they are, as the beginning of a sentence: "the values of fit.json, with their errors,".
    """

    values: Array
    covariance: Array
    words: str

    @property
    def root(self) -> Array:
        """Observations of the values' errors in units of their spread, (d, b).

        Directions without any spread are left out, so that `uncertain` has what these act on.
        """
        sd = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        safe = np.where(sd > 0, sd, 1.0)
        size, directions = np.linalg.eigh(self.covariance / np.outer(safe, safe))
        size = np.maximum(size, LEAST * size.max(initial=0.0))
        there = size > 0
        root: Array = (directions[:, there] / np.sqrt(size[there])).T / safe
        return root[:, self.uncertain][np.any(root[:, self.uncertain] != 0, axis=1)]

    @property
    def uncertain(self) -> np.ndarray:
        """Which of the values have errors, (·,) int."""
        return np.flatnonzero(np.diag(self.covariance) > 0)


@frozen
class NearFile:
    """Bodies that are the file's within a share, beside logs that are refitted otherwise freely.

    Attributes
    ----------
    share : float
    values : (b,)
        Base parameters that are likeliest without logs.
    root : (d, b)
        Rows about their differences from these, each of variance 1; none about what joints alone
        decide, of which files of commanded robots say nothing.
    """

    share: float
    values: Array
    root: Array

    @property
    def hint(self) -> str:
        """What is kept, in one sentence."""
        return (
            f"Bodies are the robot file's within {percent(self.share)} (--prior): without "
            "measured torque what they weigh cannot be told from the servos' gains."
        )


def near_file(share: float, structure: Structure) -> NearFile:
    """Return what robot file and sidecar say of base parameters where torque is not measured.

    Parameters
    ----------
    share : float
        Within which bodies are the file's.
    structure : Structure
    """
    rows, aim, _ = state_rows(structure, share)
    size = np.linalg.norm(rows, axis=0)
    said = size > 0
    size = np.where(said, size, 1.0)
    _, s, Vt = np.linalg.svd(rows / size)
    rank = int(np.sum(s > LEAST * s.max(initial=0.0)))
    standard = structure.nominal + np.linalg.pinv(rows / size) @ (aim - rows @ structure.nominal)
    spread = (structure.G / size) @ (Vt[:rank].T / s[:rank])
    free = (structure.G / size) @ Vt[rank:].T
    unit = np.maximum(np.linalg.norm(np.hstack([spread, free]), axis=1), 1e-300)
    U, own, _ = np.linalg.svd(free / unit[:, None])
    across = U[:, int(np.sum(own > ROUNDOFF * own.max(initial=0.0))) :].T / unit
    values, axes = np.linalg.eigh(across @ spread @ spread.T @ across.T)
    values = np.maximum(values, LEAST * values.max(initial=0.0))
    root = (axes / np.sqrt(np.maximum(values, 1e-300))).T @ across
    return NearFile(share, structure.G @ standard, root)


def read_given(given: Given, robot: Robot) -> tuple[Fit | None, str]:
    """Return the fit whose values are kept, if it is one's, and what to call it."""
    if isinstance(given, str | Path):
        return read_fit(given, robot), Path(given).name
    if isinstance(given, Predicts):
        return given.fit, "the result given"
    return (given, "the result given") if isinstance(given, Fit) else (None, "")


def know_share(share: float, structure: Structure) -> KnownValues:
    """Return the values of the robot file, each with a share of it as its standard deviation.

    Of a body the share is of its mass, of its first moments and of its inertia as they are long;
    of any other parameter of its value.

    Raises
    ------
    IdentifiabilityError
        If it is no share.
    """
    if not 0 < share <= 1:
        raise IdentifiabilityError(
            f"The values may be off by a share above 0 and up to 1, {share:g} was given; 0.1 is a "
            "tenth of each."
        )
    spread = structure.G * share_spread(share, structure)
    words = f"the robot file's values, each within {percent(share)},"
    return KnownValues(structure.nominal_base, spread @ spread.T, words)


def share_spread(share: float, structure: Structure) -> Array:
    """Return the standard deviation of each standard parameter for a share, (p,)."""
    robot, spread = structure.robot, share * np.abs(structure.nominal)
    for body in robot.bodies:
        for kinds in VECTORS:
            at = [k for k, p in enumerate(structure.parameters) if _is_of(p, body, kinds)]
            size = float(np.linalg.norm(structure.nominal[at]))
            spread[at] = robot.prior_share.get(body, share) * size
    for name, (_, sd) in robot.prior.items():
        if name in structure.columns:
            spread[structure.columns.index(name)] = sd
    return spread


def _is_of(p: Parameter, body: str, kinds: tuple[str, ...]) -> bool:
    return p.owner == body and p.group == "rigid_body" and p.kind in kinds


def know_fit(fit: Fit, structure: Structure, name: str) -> KnownValues:
    """Return the values of a fit with their covariance, that of the unpruned model.

    What a reduced model leaves out is not known to be nothing: it is only too small to be seen.

    Parameters
    ----------
    fit : Fit
    structure : Structure
        The robot under the model that is diagnosed.
    name : str
        What to call it.

    Raises
    ------
    IdentifiabilityError
        If the fit is of another model.
    """
    if fit.structure.base.names != structure.base.names:
        raise IdentifiabilityError(
            f"The values of {name} are those of a model of {listing(fit.structure.model.texts)}, "
            f"and {listing(structure.model.texts)} is diagnosed; give that model, or no model."
        )
    covariance, free = fit.base_covariance, fit.base_unknown
    if free.size and np.abs(free).max() > 0:
        # Standard deviation of what the fitted motion never showed, of the largest value
        # there is.
        reach = 100.0 * max(float(np.abs(fit.base).max()), 1e-12) / float(np.abs(free).max())
        covariance = covariance + reach**2 * free @ free.T
    return KnownValues(fit.base, covariance, f"the values of {name}, with their errors,")
