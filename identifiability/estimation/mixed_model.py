"""`MixedModel`: effects that a robot model may lack, as random effects.

``y = X b + Σ Z_g u_g + noise, u_g ~ N(0, s_g² I)``: X are the columns of the model that is fitted,
a group g is a family of effects at a place, or everywhere. The torque determines the sizes; a size
of zero means that the group is not there. It is the textbook's mixed model [Henderson 1975;
Patterson & Thompson 1971], searched as sparse Bayesian learning does [Tipping & Faul 2003]: the
group with the largest gain is added while its odds are large enough.

Rows are whitened once, before the search. The noise is measured with all candidates in the model,
and is the same for every hypothesis. Later questions read one `Information`, and cost the same for
any number of rows.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr, ndtri, softmax

from identifiability.foundation.linalg import ROUNDOFF, find_chains, triangular_factor
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.values import frozen, remember
from identifiability.regression.information import ActuatorBlocks, Information, factor_each

from .gaussian import Normal
from .noise import THIN, ARNoise, JointRuns, whiten
from .rules import RULES

#: Sizes that a group may have, relative to the torque of its joint: uniform in the logarithm.
SIZES = np.geomspace(1e-4, 1.0, 40)
#: Amounts of a group that are tried, in standard errors: from 30 on every group is named.
AMOUNTS = np.linspace(0.0, 30.0, 601)
#: An estimate exceeds the truth less so many standard errors with 95 % probability.
SEEN = float(ndtri(0.95))


def whitened_information(
    columns: Sequence[np.ndarray],
    rows: Iterable[Array],
    noise: ARNoise,
    runs: JointRuns,
    edges: Sequence[int],
    *,
    together: bool = False,
) -> Information:
    """Return the information of rows of each joint, whitened within stretches of data.

    Parameters
    ----------
    columns : sequence of (k,) int
        That act in each joint, rising; the last of all is the torque.
    rows : iterable of (N, k)
        Of each joint, the torque last.
    noise : ARNoise
    runs : JointRuns
        A row without data ends a stretch.
    edges : sequence of int
        Rows at which blocks begin and end.
    together : bool
        Whether products of all joints may be summed; they are where that takes less memory: where
        most columns act in most joints.
    """
    parts = []
    size = columns[0][-1] + 1
    together = together and sum(len(at) ** 2 for at in columns) > size**2
    total = np.zeros((len(edges) - 1, size, size) if together else 0)
    for at, own, of_joint, stretches in zip(columns, rows, noise, runs, strict=True):
        white = whiten(own, stretches, of_joint.pacf) / of_joint.sigma
        each = [white[a:b] for a, b in pairwise(edges)]
        if together:
            total[:, at[:, None], at] += [Z.T @ Z for Z in each]
            continue
        longest = max(map(len, each))
        blocks = np.array([np.pad(Z, ((0, longest - len(Z)), (0, 0))) for Z in each])
        no_target = np.zeros(blocks[:, 0].shape)
        parts.append(ActuatorBlocks(at[:-1], None, blocks, no_target))
    if together:
        length = np.sqrt(np.maximum(np.einsum("fii->i", total), 1e-300))
        blocks = factor_each(total / length / length[:, None]) * length
        no_targets = np.zeros(blocks[:, 0].shape)
        parts.append(ActuatorBlocks(np.arange(size - 1), None, blocks, no_targets))
    names = [str(k) for k in range(columns[0][-1])]
    counts = np.diff(edges)
    data = np.repeat(counts[:, None], len(parts), 1)
    one_log = np.zeros(len(counts), int)
    return Information(tuple(names), tuple(parts), counts, data, one_log)


# Groups, and the terms of a model.


@frozen
class Group:
    """A family of effects at a place, or everywhere: a hypothesis about a missing effect.

    Attributes
    ----------
    family : str
    place : str
        A joint, a body; `EVERYWHERE` for all of the family's places together.
    members : tuple of (k,) int
        Columns that it may have, such as those of each shape of its grid: one of them, nobody knows
        which, and where shapes form a curve all of them at once.
    price : float [nat]
        Minus the log of its prior odds.
    positive : bool
        Whether physics forbids negative levels.
    unnamed : bool
        Whether it is a function that no equation names.
    """

    family: str
    place: str
    members: tuple[np.ndarray, ...]
    price: float
    positive: bool = False
    unnamed: bool = False

    @property
    def key(self) -> tuple[str, str]:
        """Family and place: what is named."""
        return self.family, self.place


#: The place of a group that is at all places of its family.
EVERYWHERE = "*"


@frozen
class Term:
    """A group in a model.

    Attributes
    ----------
    group : Group
    member : int
    variance : float
        Of its values, relative to the torque of their joint.
    odds : float
        Log odds of the group beside the others, averaged over members and sizes, less its price.
    unseen : float [nat]
        What it gains on rows that were held out. It warns and refutes, and is not used for choices.
    places : tuple of str
        Of a family everywhere: the places whose torque shows it; `EVERYWHERE` for all of them.
    rivals : tuple of Term
        Names that explain the same about as well.
    peak : str
        Largest torque of a function without a name in the fitted rows, in words; of others empty.
    """

    group: Group
    member: int = 0
    variance: float = 1.0
    odds: float = 0.0
    unseen: float = 0.0
    places: Strings = (EVERYWHERE,)
    rivals: tuple[Term, ...] = ()
    peak: str = ""

    @property
    def columns(self) -> np.ndarray:
        """Its columns, (k,)."""
        return self.group.members[self.member]

    @property
    def key(self) -> tuple[str, str]:
        """Family and place."""
        return self.group.key

    @property
    def size(self) -> int:
        """Number of its columns."""
        return len(self.columns)


Terms = tuple[Term, ...]


@frozen
class Solution(Normal):
    """A model with some terms, by Henderson's equations.

    Attributes
    ----------
    columns : (c,) int
        Of the fixed model, then of the terms.
    log_likelihood : float
        Restricted, without what all models have in common.
    """

    columns: np.ndarray
    log_likelihood: float

    @cached_property
    def chains(self) -> list[np.ndarray]:
        """Columns of each chain of the robot: values of two of them are independent."""
        return find_chains(self.factor != 0)

    def evidence_of(self, sets: Sequence[np.ndarray]) -> Array:
        """Return the gain in likelihood by each set of values, given the others, (sets,) [nat].

        It is the ratio of their densities at zero, before and after the data [Dickey 1971]. The
        density of the prior is left out.
        """
        # The factor's last rows hold all about the last values.
        first = min((int(at.min()) for at in sets), default=0)
        last = Normal(self.factor[first:, first:], self.half[first:])
        value = last.value
        added = np.zeros(len(sets))
        for k, at in enumerate(sets):
            factor = triangular_factor(last.root[:, at - first])
            apart = solve_triangular(factor, value[at - first], trans="T")
            log_sizes = np.log(np.abs(np.diag(factor)))
            added[k] = 0.5 * apart @ apart + log_sizes.sum()
        return added


@frozen
class Projected:
    """Parts of m columns along a solution: they are nonzero in few chains of the robot.

    Attributes
    ----------
    size : int
        m.
    parts : tuple of (rows, columns, values)
        Of each chain: the solution's columns, those of the m that it moves, and their parts.
    """

    size: int
    parts: tuple[tuple[np.ndarray, np.ndarray, Array], ...]

    @property
    def moved(self) -> np.ndarray:
        """Return which columns each chain moves, (chains, m) bool."""
        out = np.zeros((len(self.parts), self.size), bool)
        for own, (_, acts, _) in zip(out, self.parts, strict=True):
            own[acts] = True
        return out

    def times(self, half: Array) -> Array:
        """Return the products of the parts with a vector of the solution's columns, (m,)."""
        out = np.zeros(self.size)
        for rows, acts, values in self.parts:
            out[acts] += values.T @ half[rows]
        return out

    def squares(self, where: np.ndarray) -> Array:
        """Return products (…, k, k) of the parts of columns (…, k) among themselves."""
        out = np.zeros((*where.shape, where.shape[-1]))
        for _, acts, values in self.parts:
            place = np.full(self.size, len(acts))
            place[acts] = np.arange(len(acts))
            found = place[where]
            inside = (found < len(acts)).any(-1)
            padded = np.vstack([values.T, np.zeros(len(values))])[found[inside]]
            out[inside] += padded @ padded.swapaxes(-1, -2)
        return out


def leave_out_each(blocks: Information) -> list[Information]:
    """Return all blocks but one, for each block in turn; only products are kept."""
    each = np.arange(len(blocks.counts))
    return [blocks.take(np.delete(each, k)).added_up() for k in each]


@frozen
class MixedModel:
    """A model of p fixed columns and groups that it may lack, on products of whitened rows.

    Attributes
    ----------
    products : Information
        About m columns.
    fixed : int
        p; these columns are the first ones.
    groups : tuple of Group
    scale : (m,)
        What a column is divided by: random ones by what makes their torque as large as their
        joint's.
    prior : (p, p)
        What is known of the fixed columns' values without the rows: the inverse of their
        covariance; none where it is empty.
    mean : (p,)
        What these values are known to be, less the values that the torque was taken about; without
        effect where nothing is known.
    sizes : (s,)
        That a group may have, each as likely.
    """

    products: Information
    fixed: int
    groups: tuple[Group, ...]
    scale: Array
    prior: Array = field(default_factory=lambda: np.empty((0, 0)))
    mean: Array = field(default_factory=lambda: np.empty(0))
    sizes: Array = field(default_factory=lambda: SIZES)

    @cached_property
    def target(self) -> Array:
        """Products of all columns with the torque, (m,)."""
        p = self.products
        return p.between(np.arange(p.size)[:, None], np.array([p.size]))[:, 0] / self.scale

    @cached_property
    def plain(self) -> Solution:
        """Values and likelihood without any term."""
        return self.solve()

    def _between(self, some: np.ndarray, others: np.ndarray) -> Array:
        units = self.scale[some] * self.scale[others]
        return self.products.between(some, others) / units

    def solve(self, terms: Terms = ()) -> Solution:
        """Return values, their covariance and the restricted likelihood with some terms."""
        columns = self._columns(terms)
        among = self._between(columns[:, None], columns)
        return self._solve(terms, columns, among, self.target[columns])

    def _project(self, s: Solution, columns: np.ndarray, but: Sequence[int] = ()) -> Projected:
        """Return the parts of m columns along a solution without some of its columns."""
        parts = []
        left_out = np.zeros(len(s.columns), bool)
        left_out[list(but)] = True
        products = self._between(s.columns[:, None], columns)
        for chain in s.chains:
            own = products[chain]
            acts = np.flatnonzero(own.any(0))
            root = s.root[np.ix_(chain, chain)]
            values = root @ own[:, acts]
            if left_out[chain].any():
                basis = np.linalg.qr(root[:, left_out[chain]])[0]
                values -= basis @ (basis.T @ values)
            parts.append((chain, acts, values))
        return Projected(len(columns), tuple(parts))

    def _columns(self, terms: Terms) -> np.ndarray:
        """Return the columns of the fixed model and some terms."""
        of_terms = (t.columns for t in terms)
        return np.concatenate([np.arange(self.fixed), *of_terms])

    def _solve(self, terms: Terms, columns: np.ndarray, P: Array, target: Array) -> Solution:
        """Return the solution of products of columns (c, c) among themselves and with the torque.

        Terms that all models of the same rows share are left out of the likelihood.
        """
        variances = [np.full(t.size, t.variance) for t in terms]
        sizes = np.concatenate(variances or [np.empty(0)])
        first = self.fixed
        P = P + ROUNDOFF * np.diag(np.maximum(np.diag(P), 1e-300))
        P[range(first, len(P)), range(first, len(P))] += 1.0 / sizes
        if self.prior.size:
            units = np.outer(self.scale[:first], self.scale[:first])
            P[:first, :first] += self.prior / units
            target = target.copy()
            target[:first] += self.prior @ self.mean / self.scale[:first]
        x = Normal.of(P, target)
        log_sizes = float(np.log(sizes).sum())
        likelihood = x.evidence - 0.5 * log_sizes
        return Solution(x.factor, x.half, columns, likelihood)

    def beside(self, terms: Terms) -> list[Group]:
        """Return the groups that may join some terms.

        A family that is everywhere has no single place, and the other way round.
        """
        taken = {t.key for t in terms}
        families = {t.group.family for t in terms}
        whole = {t.group.family for t in terms if t.group.place == EVERYWHERE}
        return [
            g
            for g in self.groups
            if g.key not in taken and g.family not in (families if g.place == EVERYWHERE else whole)
        ]

    def gains(self, terms: Terms = (), among: Sequence[Group] | None = None) -> list[Term]:
        """Return further groups with their log odds, given some terms, the likeliest first.

        Each is averaged over its members and sizes, and is returned with the likeliest of both.
        Levels that physics requires to be positive also gain by their sign:
        ``ln 2 P(sign | data)``.

        Parameters
        ----------
        terms : tuple of Term
        among : sequence of Group, optional
            By default all that are not among the terms.
        """
        if among is not None:
            return self._gains(self.solve(terms), among)
        key = tuple((t.group, t.member, t.variance) for t in terms)
        return remember(
            self.made, key, lambda: self._gains(self.solve(terms), self.beside(terms)), 12
        )

    @cached_property
    def made(self) -> dict[Any, Any]:
        """The last gains of all groups, by the terms that they were given."""
        return {}

    def _gains(self, s: Solution, asked: Sequence[Group], but: Sequence[int] = ()) -> list[Term]:
        """Return groups with their log odds, given a solution without some of its columns."""
        sets = [at for g in asked for at in g.members]
        every = np.unique(np.concatenate([np.empty(0, int), *sets]))
        along = self._project(s, every, but)
        left = self.target[every] - along.times(s.half)
        widths = np.array([len(at) for at in sets])
        places = [g.place for g in asked for _ in g.members]
        acts = np.vstack([self.products.acts(every), *along.moved])
        pieces = list[tuple[int, np.ndarray]]()  # of each set, those of each chain
        for k, own in enumerate(sets):
            where = np.searchsorted(every, own)
            apart = find_chains(acts[:, where]) if places[k] == EVERYWHERE else [...]
            pieces += [(k, where[chain]) for chain in apart]
        sums = np.zeros((3, len(sets), len(self.sizes)))
        for width in {len(where) for _, where in pieces}:
            alike = [piece for piece in pieces if len(piece[1]) == width]
            owners = [k for k, _ in alike]
            where = np.array([own for _, own in alike])
            columns = every[where]
            units = self.scale[columns]
            S = self.products.among(columns) / (units[:, :, None] * units[:, None, :])
            rise = self.rise(S, along.squares(where), left[where])
            np.add.at(sums.swapaxes(0, 1), owners, rise)
        rises, means, variances = sums
        signs = np.log(2.0) + log_ndtr(means / np.sqrt(np.where(variances > 0, variances, 1.0)))
        out = []
        stop = 0
        for g in asked:
            at = slice(stop, stop := stop + len(g.members))
            each = rises[at]
            if g.positive:  # shapes of one curve may cancel: its sign is that of the likeliest
                narrow = widths[at][:, None] == widths[at].min()
                narrowest = np.where(narrow, each, -np.inf)
                likeliest = int(np.argmax(narrowest.max(1)))
                each = each + np.where(narrow, signs[at], signs[at][likeliest])
            member, size = np.unravel_index(int(np.argmax(each)), each.shape)
            likely = np.logaddexp.reduce(each.ravel())
            odds = float(likely - np.log(each.size)) - g.price
            out.append(Term(g, int(member), float(self.sizes[size] ** 2), odds))
        # Ties keep their order in spite of rounding.
        return sorted(out, key=lambda t: -round(t.odds, 6))

    def rise(self, S: Array, along: Array, left: Array) -> Array:
        """Return the rise of the log-likelihood by sets of columns, (s, 3, sizes).

        Then mean and variance of the sum of the levels of each set.

        Parameters
        ----------
        S, along : (s, k, k)
            Products of the columns of each set, and of their parts along the model.
        left : (s, k)
            Their products with the torque that the model leaves.
        """
        outside = S - along
        e, U = np.linalg.eigh(0.5 * (outside + outside.transpose(0, 2, 1)))
        told = e > THIN * np.einsum("skk->sk", S).max(1)[:, None]
        e, z = (np.where(told, x, 0.0) for x in (e, (left[:, None] @ U)[:, 0]))
        v = self.sizes[:, None] ** 2
        shrunk = v / (1.0 + v * e[:, None])
        towards = U.sum(1)
        squares = np.stack(np.broadcast_arrays(z**2, towards * z, towards**2), 2)
        found = (shrunk @ squares).swapaxes(1, 2)
        found[:, 0] = 0.5 * (found[:, 0] + np.log(shrunk / v).sum(2))
        return found

    def least_named(self, terms: Terms, group: Group, towards: Array) -> float:
        """Return the smallest amount of a group that is named with 95 % probability.

        Infinite if the rows do not show the group.

        Parameters
        ----------
        terms : tuple of Term
            That are in the model already.
        group : Group
        towards : (k,)
            Values of the columns of its first member at an amount of one.
        """
        every = np.unique(np.concatenate(group.members))
        whole, inside = self._products_given(terms, every)
        planted = np.zeros(len(every))
        scales = self.scale[group.members[0]]
        planted[np.searchsorted(every, group.members[0])] = towards * scales
        left = (whole - inside) @ planted
        information = float(planted @ left)
        if not information > THIN * float(planted @ whole @ planted):
            return np.inf
        standard_error = 1.0 / np.sqrt(information)
        rises = []
        for member in group.members:
            at = np.searchsorted(every, member)
            block = np.ix_(at, at)
            amounts = standard_error * AMOUNTS[:, None] * left[at]
            rises.append(self.rise(whole[block][None], inside[block][None], amounts)[:, 0])
        each = np.concatenate(rises, axis=1)
        likely = np.logaddexp.reduce(each, axis=1)
        odds = likely - np.log(each.shape[1]) - group.price
        named = AMOUNTS[int(np.argmax(odds >= RULES.name))]
        return float((named + SEEN) * standard_error)

    def standard_error(self, terms: Terms, columns: np.ndarray, towards: Array) -> float:
        """Return the standard error of an amount of further columns, given some terms.

        Infinite if the rows do not show them.

        Parameters
        ----------
        terms : tuple of Term
            That are in the model, with values of their own.
        columns : (k,) int
        towards : (k,)
            Values of the columns at an amount of one.
        """
        whole, inside = self._products_given(terms, columns)
        planted = towards * self.scale[columns]
        information = float(planted @ (whole - inside) @ planted)
        shown = information > THIN * float(planted @ whole @ planted)
        return 1.0 / np.sqrt(information) if shown else np.inf

    def levels(self, terms: Terms, columns: np.ndarray) -> tuple[Array, Array]:
        """Return the value of each of some columns alone, given some terms, and its error, (k,)."""
        s = self.solve(terms)
        along = self._project(s, columns)
        each = np.arange(len(columns))[:, None]
        outside = self._between(columns, columns) - along.squares(each)[:, 0, 0]
        left = self.target[columns] - along.times(s.half)
        information = np.maximum(outside, ROUNDOFF)
        unit = self.scale[columns]
        return left / information / unit, 1.0 / np.sqrt(information) / unit

    def _products_given(self, terms: Terms, columns: np.ndarray) -> tuple[Array, Array]:
        """Return products (k, k) of columns, and their part that some terms explain."""
        along = self._project(self.solve(terms), columns)
        whole = self._between(columns[:, None], columns)
        return whole, along.squares(np.arange(len(columns)))

    def update_terms(self, terms: Terms) -> Terms:
        """Return terms with the member, size and odds that each has given the others."""
        s = self.solve(terms)
        for k, term in enumerate(terms):
            new = self._ask_again(s, terms, k)
            terms = (*terms[:k], new, *terms[k + 1 :])
            if (new.member, new.variance) != (term.member, term.variance):
                s = self.solve(terms)
        return terms

    def odds_each(self, terms: Terms) -> Array:
        """Return the log odds of each term given the others as they are, (t,)."""
        s = self.solve(terms)
        return np.array([self._ask_again(s, terms, k).odds for k in range(len(terms))])

    def _ask_again(self, s: Solution, terms: Terms, k: int) -> Term:
        """Return the k-th of terms with the member, size and odds given the others.

        Parameters
        ----------
        s : Solution
            Of all terms.
        terms : tuple of Term
        k : int
        """
        term = terms[k]
        first = self.fixed + sum(t.size for t in terms[:k])
        (again,) = self._gains(s, [term.group], range(first, first + term.size))
        return replace(term, member=again.member, variance=again.variance, odds=again.odds)

    def search(self, most: int = 12) -> Terms:
        """Return the missing terms: add the best group, and remove groups that no longer gain.

        Of groups that are about as good the simplest is added first: a flexible group would absorb
        the evidence of a named effect, and remove that effect if it fails on unseen rows. A family
        with a name goes before an unnamed function.
        """
        terms: Terms = ()
        gone: set[tuple[str, str]] = set()
        exchanges = most
        while len(terms) < most:
            found = [t for t in self.gains(terms) if t.key not in gone and t.odds >= RULES.name]
            if found:
                terms = self.update_terms((*terms, _simplest(found)))
            elif exchanged := exchanges and self._exchange(terms, gone):
                exchanges -= 1
                terms = exchanged
            else:
                break
            while terms and min(t.odds for t in terms) < RULES.name:
                least = min(range(len(terms)), key=lambda k: terms[k].odds)
                gone.add(terms[least].key)
                terms = self.update_terms(without(terms, least))
        return terms

    def _exchange(self, terms: Terms, gone: Collection[tuple[str, str]]) -> Terms:
        """Return terms with a better group in place of one of them; none if each is the best.

        A flexible group that was added early may explain the torque of several effects. Once the
        others are added, the group of its remaining torque is better.
        """
        for k, term in enumerate(terms):
            rest = without(terms, k)
            others = [t for t in self.gains(rest) if t.key not in gone]
            best = _simplest(sorted([term, *others], key=lambda t: -t.odds))
            if best.key != term.key:
                return self.update_terms((*terms[:k], best, *terms[k + 1 :]))
        return ()

    def total_odds(self, terms: Terms) -> float:
        """Return the log odds of all terms together: of each, given those before it."""
        each = (self.gains(terms[:k], [t.group]) for k, t in enumerate(terms))
        return sum(t.odds for (t,) in each)

    def news(self, terms: Terms, unseen: Information) -> list[float]:
        """Return the gain of each term on unseen rows, given the others [nat].

        The density of unseen rows is ``p(unseen | fitted) = p(both) / p(fitted)``.
        """
        columns = self._columns(terms)
        units = self.scale[columns]
        both = self._between(columns[:, None], columns)
        both += unseen.between(columns[:, None], columns) / np.outer(units, units)
        of_torque = unseen.between(columns, np.array(unseen.size))
        aim = self.target[columns] + of_torque / units
        places = self._places(terms, [[k] for k in range(len(terms))])
        after = self._solve(terms, columns, both, aim).evidence_of(places)
        before = self.solve(terms).evidence_of(places)
        return (after - before).tolist()

    def _places(self, terms: Terms, sets: Iterable[Collection[int]]) -> list[np.ndarray]:
        """Return the columns of sets of some terms, in the solution of all these terms."""
        owner = np.repeat(np.arange(len(terms)), [t.size for t in terms])
        return [self.fixed + np.flatnonzero(np.isin(owner, [*some])) for some in sets]

    def confirm(self, terms: Terms, unseen: Information) -> Terms:
        """Return the terms that unseen rows confirm, with their gains; the worst goes first.

        Together with the fitted rows, terms must gain the limits for naming and keeping an effect.
        On their own, unseen rows count as odds against a term where its gain is negative. They
        refute it at the limit for naming.
        """
        while terms:
            gains = self.news(terms, unseen)
            terms = tuple(replace(t, unseen=gain) for t, gain in zip(terms, gains, strict=True))
            over = [t.unseen + min(RULES.name, t.odds - RULES.name - RULES.keep) for t in terms]
            worst = int(np.argmin(over))
            if over[worst] >= 0:
                break
            terms = without(terms, worst)
        return terms

    def left_out(
        self, terms: Terms, folds: Sequence[Information], sets: Sequence[frozenset[int]]
    ) -> Array:
        """Return the gain of sets of terms, given the others, on blocks of rows, (sets,) [nat].

        Each block is predicted from all other blocks, which are a fold, with all terms and without
        those of a set. The rows of the model are all blocks.
        """
        distinct = list(dict.fromkeys(sets))
        places = self._places(terms, distinct)
        whole = self.solve(terms).evidence_of(places)
        gains = np.zeros(len(distinct))
        for others in folds:
            fitted = replace(self, products=others)
            gains += whole - fitted.solve(terms).evidence_of(places)
        of_set = dict(zip(distinct, gains.tolist(), strict=True))
        return np.array([of_set[some] for some in sets])

    def rivals(self, terms: Terms, which: int) -> list[Term]:
        """Return the competing explanations of a term ("A or B"), the likeliest first."""
        own = terms[which]
        rest = without(terms, which)
        others = [t for t in self.gains(rest) if t.key != own.key]
        return [t for t in others if t.odds > own.odds - RULES.rival]

    def alternatives(
        self, terms: Terms = (), unpriced: Collection[str] = ()
    ) -> list[tuple[Term, float, float]]:
        """Return groups of which one more may be present, with two probabilities each.

        The first is that of any parameter, the second that of friction of the group's own joint.

        Parameters
        ----------
        terms : tuple of Term
        unpriced : collection of str
            Families of which each joint may have one more, without the price of a name: those
            whose odds without it would name them. For friction of the same joint, those that
            the rows make likelier than nothing.
        """
        gains = self.gains(terms)
        found = [t for t in gains if t.odds > RULES.unlikely]
        keys = [t.key for t in found]
        shares = one_of([t.odds for t in found])
        priced = dict(zip(keys, shares, strict=True))
        free = [t for t in gains if t.group.family in unpriced and t.group.place != EVERYWHERE]
        named = [t for t in free if t.odds + t.group.price >= RULES.name]
        likely = [t for t in free if t.odds + t.group.price > 0.0]
        usual = weigh_each_place(named, priced)
        own = weigh_each_place(likely, usual)
        return [(t, usual.get(t.key, 0.0), own[t.key]) for t in gains if t.key in own]


def weigh_each_place(
    terms: Sequence[Term], known: Mapping[tuple[str, str], float]
) -> dict[tuple[str, str], float]:
    """Return probabilities of terms, of which each place has at most one, without their prices.

    Known probabilities of the same terms stay where they are larger.
    """
    weights = dict(known)
    for place in {t.group.place for t in terms}:
        here = [t for t in terms if t.group.place == place]
        each = one_of([t.odds + t.group.price for t in here])
        for t, weight in zip(here, each, strict=True):
            weights[t.key] = max(weight, weights.get(t.key, 0.0))
    return weights


def one_of(odds: Sequence[float]) -> list[float]:
    """Return the probability of each of some hypotheses by their log odds against none of them."""
    return softmax([0.0, *odds])[1:].tolist()


def _simplest(found: Sequence[Term]) -> Term:
    """Return the simplest of the terms that are about as likely as the first one."""
    near = [t for t in found if t.odds > found[0].odds - RULES.simpler]
    return min(near, key=lambda t: (t.group.unnamed, t.size, -t.odds))


def without(terms: Terms, k: int) -> Terms:
    """Return all terms but the k-th."""
    return terms[:k] + terms[k + 1 :]
