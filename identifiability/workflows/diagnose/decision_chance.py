"""What tells an effect from its rivals, and how likely: by the rule that calls names undecided."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.workflows.diagnose.lookalikes import DECISIVE, SAME
from identifiability.workflows.excite.criteria import Ask, Discrimination

#: Experiments that are drawn for a chance.
DRAWN = 20_000

#: Columns of an effect, one array for each of its shapes.
Shapes = Sequence[np.ndarray]


def aim_at(
    G: Array, named: Shapes, rivals: Sequence[Shapes], at: int, values: Array
) -> Discrimination:
    """Return what tells an effect, as it was found, from its rivals, and each of them from it.

    Where a rival is true it is as large as the logs take it for the named one. Of two of which one
    is a part of the other only the whole can be told from the part: where it was not found, each
    of its columns has an equal part of the torque.

    Parameters
    ----------
    G : (k, k)
        What the logs say of the columns of the model and of all these effects.
    named : sequence of (p,) int
    rivals : sequence of sequence of (q,) int
    at : int
        The shape that was found.
    values : (p,)
        With that shape.
    """
    every = [np.concatenate(list(shapes)) for shapes in (named, *rivals)]
    model = np.setdiff1d(np.arange(len(G)), np.concatenate(every))
    length = np.sqrt(np.maximum(np.diag(G), 1e-300))
    unit = G / np.outer(length, length)
    base = np.linalg.pinv(unit[np.ix_(model, model)], rcond=1e-12, hermitian=True)
    left = unit - unit[:, model] @ base @ unit[model]
    own = named[at]
    true, asks = values * length[own], []
    whole = float(true @ left[np.ix_(own, own)] @ true)
    for k, shapes in enumerate(rivals):
        found = [_explain(left, b, own, true) for b in shapes]
        best = int(np.argmax([explained for _, explained in found]))
        level, explained = found[best]
        other = shapes[best]
        nested = explained > SAME**2 * whole and len(other) > len(own)
        if nested:
            sign = np.where(level < 0, -1.0, 1.0)
            level = sign * np.linalg.norm(true) / np.sqrt(len(other))
        else:
            asks.append(Ask(k, False, own, values, tuple(shapes)))
        part = not nested and len(other) < len(own) and _within(left, other, own)
        if part:
            asks[-1] = Ask(k, False, own, values, tuple(shapes), nested=True)
        else:
            asks.append(Ask(k, True, other, level / length[other], tuple(named), nested=nested))
    return Discrimination(every[0], np.concatenate(every[1:]), tuple(asks))


def _explain(left: Array, b: np.ndarray, own: np.ndarray, true: Array) -> tuple[Array, float]:
    """Return the level (q,) at which columns explain most of an effect, and how much."""
    cross = left[np.ix_(b, own)] @ true
    level = np.linalg.pinv(left[np.ix_(b, b)], rcond=1e-9, hermitian=True) @ cross
    return level, float(level @ cross)


def _within(left: Array, small: np.ndarray, large: np.ndarray) -> bool:
    """Whether columns are a part of others, beside the model."""
    squares = sum(_explain(left, large, small[[k]], np.ones(1))[1] for k in range(len(small)))
    return squares > SAME**2 * float(np.trace(left[np.ix_(small, small)]))


def decision_chance(aim: Discrimination, G: Array, alike: float) -> float:
    """Return the chance that of several effects the true one is named alone.

    Each may be true, one as likely as the other as long as nothing tells them apart. All are
    scored by the squares that they explain; a name is undecided where another is alike and its
    score comes within `lookalikes.DECISIVE`. Of a part and the whole the part is decided where
    the whole would have to explain as much more than it does.

    Parameters
    ----------
    aim : Discrimination
    G : (k, k)
        Information about its columns, in units of the noise.
    alike : float
        Similarity from which on two names may be undecided.
    """
    e = np.random.default_rng(0).standard_normal((2, DRAWN))
    right: dict[int, np.ndarray] = {}
    for ask in aim.asks:
        whole, left = (part[..., 0] for part in aim.squares(G[None], ask))
        truth = ask.rival + 1 if ask.reverse else 0
        own = right.get(truth, np.ones(DRAWN, bool))
        for outside in np.minimum(left, whole).tolist():
            similarity = np.sqrt(1.0 - outside / max(float(whole), 1e-300))
            first = np.sqrt(whole) + e[0]
            # The other explains what is not the first one's own, and of the noise what it shares.
            second = np.sqrt(max(whole - outside, 0.0))
            second = second + similarity * e[0] + np.sqrt(max(1 - similarity**2, 0.0)) * e[1]
            ahead = 0.5 * (first**2 - second**2)
            own = own & (ahead > (DECISIVE if ask.nested or similarity > alike else 0.0))
        right[truth] = own
        if ask.nested:
            part = 0 if ask.reverse else ask.rival + 1
            told = 0.5 * (float(left.min()) - e[1] ** 2) > DECISIVE
            right[part] = right.get(part, np.ones(DRAWN, bool)) & told
    return float(np.mean([x.mean() for x in right.values()]))
