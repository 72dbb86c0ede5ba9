"""What a diagnosis is asked, its `Setting`; and what the model says as well: `find_aliases`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from identifiability.estimation.groups import Missing
from identifiability.estimation.mixed_model import Products
from identifiability.foundation.linalg import RANK_TOLERANCE, ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation, Samples
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.known_values import KnownValues

if TYPE_CHECKING:
    from identifiability.workflows.diagnose.changes import Change

#: Decimals that count where shares and sizes are compared: those beyond are another processor's
#: rounding, and of what ties the first comes first, in the order of candidates and parameters.
DECIMALS = 9


@frozen
class Setting:
    """What is diagnosed, and from what.

    Attributes
    ----------
    structure : Structure
        The robot under the model that is diagnosed.
    samples, validation : tuple of Samples
        Fitted, and unseen.
    known : KnownValues
        What is known of the model's values beside the logs.
    fixed : bool
        Whether the model keeps these.
    seed : int
    verified_on : str
        Unseen motion, in words: it was not fitted.
    preparation : Preparation
        How logs were turned into motion, with one cut-off.
    changes : tuple of Change
        What changed in the middle of fitted logs: what was logged meanwhile was left out.
    commanded : bool
        Whether torque is what servos made of commands.
    """

    structure: Structure
    samples: tuple[Samples, ...]
    known: KnownValues
    validation: tuple[Samples, ...] = ()
    fixed: bool = False
    seed: int = 0
    verified_on: str = ""
    preparation: Preparation = Preparation()
    changes: tuple[Change, ...] = ()
    commanded: bool = False


#: Share of a candidate's own torque below which it is hidden by the model.
HIDDEN: Tolerance = 0.03


@frozen
class Alias:
    """How much of a candidate the base model does not contain.

    Attributes
    ----------
    family, place : str
    remaining : float
        Root mean square of what is left, as a share of the candidate's own; of several columns
        the largest share of all that they can be.
    behind : tuple of str
        Parameters that make up what is not left, the largest first.
    """

    family: str
    place: str
    remaining: float
    behind: tuple[str, ...]

    @property
    def structural(self) -> bool:
        """Whether it can never be named from this motion."""
        return self.remaining < HIDDEN


def find_aliases(missing: Missing, products: Products, names: Sequence[str]) -> list[Alias]:
    """Return one entry for every family and place, that of its most visible shape.

    Of several columns together it is the most visible of all torques that they can make: how much
    of a spring is gravity must not hang on where its position is counted from.

    Parameters
    ----------
    missing : Missing
    products : Products
        Of its rows.
    names : sequence of str
        Of the base columns.
    """
    # Values with known errors hide nothing for ever: a larger effect shows.
    base = np.arange(0 if len(missing.root) else missing.fixed)
    P = products.between(base, base)
    length = np.sqrt(np.maximum(np.diag(P), 1e-300))
    square, vectors = np.linalg.eigh(P / np.outer(length, length))
    known = square > ROUNDOFF * max(float(square.max(initial=0.0)), 1e-300)
    F = (vectors[:, known] / np.sqrt(square[known])).T / length
    out: dict[tuple[str, str], Alias] = {}
    for c in missing.candidates:
        at = np.array(c.columns) + missing.fixed
        XZ, ZZ = products.between(base, at), products.between(at, at)
        unit = np.sqrt(np.maximum(np.diag(ZZ), 1e-300))
        values, axes = np.linalg.eigh(ZZ / np.outer(unit, unit))
        seen = values > RANK_TOLERANCE * max(float(values[-1]), 1e-300)
        left = 0.0
        behind: tuple[str, ...] = ()
        if seen.any() and values[-1] > ROUNDOFF:
            inside = F @ XZ / unit @ (axes[:, seen] / np.sqrt(values[seen]))
            # Rounding is of squares: of what is wholly hidden a root of it would remain.
            rest = round(1.0 - float(np.linalg.eigvalsh(inside.T @ inside)[0]), DECIMALS)
            left = float(np.sqrt(max(0.0, rest)))
            behind = _hiding(F.T @ inside * length[:, None], names)
        alias = Alias(*c.group, left, behind)
        if c.group not in out or out[c.group].remaining < left:
            out[c.group] = alias
    return list(out.values())


def _hiding(weights: Array, names: Sequence[str]) -> tuple[str, ...]:
    """Return the parameters that make up most of what is hidden, the largest first."""
    size = np.linalg.norm(weights, axis=1)
    size = np.round(size / (size.max(initial=0.0) or 1.0), DECIMALS)
    order = np.argsort(-size, kind="stable")[:3]
    # Of this share of the largest at least.
    return tuple(names[k] for k in order if size[k] > 0.1)
