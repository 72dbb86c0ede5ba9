"""What a diagnosis is asked, its `Setting`; and what the model says as well: `find_aliases`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from identifiability.estimation.groups import Missing
from identifiability.foundation.linalg import RANK_TOLERANCE, ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation, Samples
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.known_values import KnownValues
from identifiability.workflows.diagnose.rules import Rules

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
    rules : Rules
    seed : int
    chosen_by : str
        What chose the names, in words.
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
    rules: Rules = Rules()
    seed: int = 0
    chosen_by: str = ""
    verified_on: str = ""
    preparation: Preparation = Preparation()
    changes: tuple[Change, ...] = ()
    commanded: bool = False


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
    structural : bool
        Whether it can never be named from this motion.
    """

    family: str
    place: str
    remaining: float
    behind: tuple[str, ...]
    structural: bool


def find_aliases(missing: Missing, names: Sequence[str], share: float) -> list[Alias]:
    """Return one entry for every family and place, that of its most visible shape.

    Of several columns together it is the most visible of all torques that they can make: how much
    of a spring is gravity must not hang on where its position is counted from.

    Parameters
    ----------
    missing : Missing
    names : sequence of str
        Of the base columns.
    share : float
        Remaining share below which a candidate is structurally aliased.
    """
    # Values with known errors hide nothing for ever: a larger effect shows.
    b = 0 if len(missing.root) else missing.fixed
    rows = missing.seen
    acts = [{k for i, k in missing.entries if i == j} for j in range(rows.y.shape[1])]
    size = np.linalg.norm(rows.y, axis=0)
    scale = np.where(size > 0, size, 1.0)
    base = [rows.X[:, j, :b] / s for j, s in enumerate(scale)]
    length = np.sqrt(np.maximum(sum(np.sum(A**2, axis=0) for A in base), 1e-300))
    square, vectors = np.linalg.eigh(sum((A / length).T @ (A / length) for A in base))
    known = square > ROUNDOFF * max(float(square.max(initial=0.0)), 1e-300)
    F = (vectors[:, known] / np.sqrt(square[known])).T / length
    out: dict[tuple[str, str], Alias] = {}
    for c in missing.candidates:
        at = list(c.columns)
        XZ, ZZ = np.zeros((b, len(at))), np.zeros((len(at), len(at)))
        for j in [j for j, own in enumerate(acts) if own.intersection(at)]:
            none = np.zeros(len(rows.y))
            Z = np.stack([missing.entries.get((j, k), none) for k in at], axis=1) / scale[j]
            XZ += base[j].T @ Z
            ZZ += Z.T @ Z
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
        alias = Alias(*c.group, left, behind, left < share)
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
