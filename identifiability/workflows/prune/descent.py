"""Which move is the cheapest, and the order in which all that is left goes.

Only the fit to everything says what is cheapest. So the order is found with that fit alone, and
those without each fold follow for all models at once (`UpdatedRefits.along`): they are nested.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from identifiability.estimation.updated_refits import UpdatedRefits
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.prune.folds import HELD, Fit
from identifiability.workflows.prune.moves import Kind, Move, Partition

#: Estimates correlated beyond this are one quantity to these logs: "either".
EITHER = 0.95


@frozen
class Descent:
    """A move down, with what the fit to everything says of it.

    Attributes
    ----------
    move : Move
    cost : float
        Rise of the estimator's loss.
    either : str
        The parameter that a dropped one can hardly be told from.
    after : Partition
    held : (r, k)
        All constraints ``held y = 0`` after it.
    """

    move: Move
    cost: float
    either: str
    after: Partition
    held: Array


def descend(fit: Fit, pairs: Sequence[Move], kept: Collection[str]) -> Iterator[Descent]:
    """Yield the cheapest moves until nothing is left that may go.

    Parameters
    ----------
    fit : Fit
        Whose refits are updates.
    pairs : sequence of Move
        Merges of Coulomb levels; such columns are dropped in pairs only.
    kept : collection of str
        Columns that must not be dropped.
    """
    fit, X = fit.alone, fit.whitened.inverse
    square, spread = (X**2).sum(1), measure_spread(fit)
    while True:
        free = spread > HELD * square
        drops = np.where(free, fit.values[0] ** 2 / np.where(free, spread, 1.0), 0.0)
        move = find_cheapest(fit, pairs, kept, drops)
        if move is None:
            return
        after = fit.after(move)
        before, then = (f.refits for f in (fit, after))
        assert isinstance(before, UpdatedRefits)
        assert isinstance(then, UpdatedRefits)
        yield Descent(
            move, fit.cost(move), find_either(fit, move, spread), after.partition, then.held
        )
        if then.solved == before.solved:
            new = then.held[len(before.held) :]
            gone = before.C @ new.T
            of_x = X @ gone
            spread = spread - ((of_x @ np.linalg.inv(new @ gone)) * of_x).sum(1)
        else:
            spread = measure_spread(after)
        fit = after


def measure_spread(fit: Fit) -> Array:
    """Return the inverse information of each column's value, (k,)."""
    X = fit.whitened.inverse
    spread: Array = ((X @ fit.refits.C) * X).sum(1)
    return spread


def find_cheapest(
    fit: Fit, pairs: Sequence[Move], kept: Collection[str], drops: Array | None = None
) -> Move | None:
    """Return the move whose loss raises the sum of squares least per parameter.

    Parameters
    ----------
    fit, pairs, kept
        As in `descend`.
    drops : (k,), optional
        What dropping each group by itself costs, at its leader; the fit is asked without.
    """
    p = fit.partition
    paired: set[int] = set()
    moves = []
    for pair in pairs:
        leaders = p.alive(pair.columns)
        if len(leaders) == 2:
            paired.update(leaders)
            moves.append(pair)
            moves.append(Move(Kind.DROP, tuple(p.columns[g] for g in leaders)))
    bound = set(p.alive(kept))
    moves = [m for m in moves if not set(m.zero).intersection(kept)]
    singles = [g for g in p.leaders if g not in paired and g not in bound]
    if drops is None:
        own = fit.costs([Move(Kind.DROP, p.members(g)) for g in singles])
    else:
        own = drops[singles]
    costs = np.concatenate([own, fit.costs(moves)])
    if not len(costs):
        return None
    best = int(np.argmin(costs))
    if best < len(singles):
        return Move(Kind.DROP, p.members(singles[best]))
    return moves[best - len(singles)]


def find_either(fit: Fit, move: Move, spread: Array | None = None) -> str:
    """Return the parameter that a dropped one can hardly be told from.

    Parameters
    ----------
    fit : Fit
    move : Move
    spread : (k,), optional
        As `measure_spread` has it.
    """
    if move.kind is not Kind.DROP:
        return ""
    partition = fit.partition
    gone = partition.alive(move.zero)
    others = [g for g in partition.leaders if g not in gone]
    if len(gone) != 1 or not others:
        return ""
    X = fit.whitened.inverse
    square = measure_spread(fit) if spread is None else spread
    size = np.sqrt(np.maximum(square, 1e-300))
    rho = np.abs(X[others] @ (fit.refits.C @ X[gone[0]])) / (size[gone[0]] * size[others])
    best = int(np.argmax(rho))
    return partition.columns[others[best]] if rho[best] > EITHER else ""
