"""Effects that a robot model may lack, as groups of a mixed model: every family at every place.

A group has the columns of its family's whole grid of shapes. Friction is rarely in one joint only,
so each family is a group everywhere, too; smooth functions of known coordinates are families as
well, and return to zero where there were no data.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import chain, pairwise

import numpy as np
from scipy.linalg import block_diag

from identifiability.effects import Family, name_place
from identifiability.effects.friction import REVERSALS, ReversalFriction
from identifiability.foundation.linalg import (
    NEARLY,
    RANK_TOLERANCE,
    ROUNDOFF,
    or_one,
    triangular_factor,
)
from identifiability.foundation.names import INERTIAL_KINDS, Array, Strings
from identifiability.foundation.rounding import ENDS, join, state_probability
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import signals
from identifiability.logs.prepare.dataset import Piece
from identifiability.logs.rows import WINDOW
from identifiability.regression.columns import (
    Candidate,
    Entries,
    Present,
    compute_entries,
    list_candidates,
    number,
)
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import LogPart, Regression, choose_windows
from identifiability.robot import Robot

from .estimator import Estimate
from .mixed_model import EVERYWHERE, Group, MixedModel, Term, Terms, whitened_information
from .noise import HIGHEST_ORDER, ARNoise, JointNoise, JointRuns, Runs, rich_noise, split_runs
from .rules import RULES

#: Inertial parameters of a compact load of 1 kg, by its radius [m].
RADIUS: Tolerance = 0.1
LOAD = {kind: RADIUS ** min(k, 1 + (k > 3)) for k, kind in enumerate(INERTIAL_KINDS)}

#: Samples of all logs up to which all are looked at; of more so many windows of so many samples.
EXCERPT = (6_000, 6, 1_000)
#: Share of the largest pulse at reversals from which rows are of one.
TURNS: Tolerance = 0.05
#: Largest number of values in the columns of candidates, where all act at all joints.
NUMBERS = 2**27
#: Families of bodies, with typical values of their kinds.
BODIES = {"rigid_body": LOAD, "payload": {f"payload_{kind}": x for kind, x in LOAD.items()}}


@frozen
class Excerpt:
    """Rows of logs that are looked at one by one: torque and columns of a model.

    Attributes
    ----------
    robot : Robot
    X : (N, n, p)
    y : (N, n) [N·m or N]
    raw : (N, n) [N·m or N]
        Torque as it was measured, before any low-pass.
    data : (N, n) bool
        Where torque of each joint is data; elsewhere its rows are zero.
    t : (N,) [s]
    log : (N,) int
        Which log a row comes from.
    runs : JointRuns
        Stretches of data without gaps, of each joint.
    pieces : tuple of Piece
        Of the motion at these rows, which effects are computed along.
    """

    robot: Robot
    X: Array
    y: Array
    raw: Array
    data: np.ndarray
    t: Array
    log: np.ndarray
    runs: JointRuns
    pieces: tuple[Piece, ...]

    @staticmethod
    def of(regression: Regression, most: tuple[int, int, int] = EXCERPT) -> Excerpt:
        """Return the rows of a regression, without instruments; an excerpt if there are many."""
        parts, pieces = _look_at(regression, most)
        chunks = [chunk for part in parts for chunk in part.shown()]
        t = np.concatenate([c.t for c in chunks])
        log = np.concatenate([np.full(len(c.t), c.log) for c in chunks])
        each = [t[log == k] for k in np.unique(log)]
        closed = (np.append(signals.has_gap(own), True) for own in each)
        ends = np.concatenate([[], *closed])
        stops = np.flatnonzero(ends) + 1
        runs = tuple(pairwise([0, *stops.tolist()]))
        kinds = ("W", "tau", "raw", "data")
        X, y, raw, data = (np.concatenate([getattr(c, k) for c in chunks]) for k in kinds)
        own = split_runs(runs, data)
        return Excerpt(regression.robot, X, y, raw, data, t, log, own, pieces)

    @cached_property
    def centre(self) -> Array:
        """Values of the model by least squares, (p,), each joint by the size of its torque.

        The torque minus that of these values is as small as the effects that the model lacks.
        Products of all of the torque would hold that to half of their digits only.
        """
        torque = self.torque_norm
        weight = np.divide(1.0, torque, out=np.zeros_like(torque), where=torque > 0)
        both = [self.X, self.y[:, :, None]]
        rows = np.concatenate(both, axis=2) * weight[:, None]
        R = triangular_factor(rows.reshape(-1, rows.shape[2]))
        length = or_one(np.linalg.norm(R[:, :-1], axis=0))
        unit = R[:, :-1] / length
        return np.linalg.lstsq(unit, R[:, -1], rcond=RANK_TOLERANCE)[0] / length

    @cached_property
    def torque_norm(self) -> Array:
        """Norm of the measured torque of each joint, (n,) [N·m or N]."""
        return np.linalg.norm(self.raw * self.data, axis=0)

    def leave_out(self, joints: np.ndarray) -> Excerpt:
        """Return the same without the torque of some joints, (n,) bool."""
        data = self.data & ~joints
        runs = tuple(() if out else own for out, own in zip(joints, self.runs, strict=True))
        return replace(self, data=data, runs=runs)

    def residual(self, values: Array) -> Array:
        """Return the torque minus that of some values of the model, (N, n) [N·m or N]."""
        return self.y - self.X @ values

    def entries(self, candidates: Sequence[Candidate]) -> Entries:
        """Return the torque (N,) of candidates by joint and column, where it is not zero."""
        parts = [(c.part, c.columns) for c in candidates]
        found = compute_entries(self.robot, parts, self.pieces)
        return {at: x * self.data[:, at[0]] for at, x in found.items()}


def _look_at(
    regression: Regression, most: tuple[int, int, int]
) -> tuple[list[LogPart], tuple[Piece, ...]]:
    """Return parts of a regression without instruments, and the pieces that are looked at."""
    plain = regression
    if regression.instruments is not None:
        plain = replace(regression, instruments=None)
    windows = choose_windows([s.outputs for s in plain.samples], most)
    parts = [replace(part, windows=windows[part.log]) for part in plain.parts()]
    pieces = (part.samples.pieces(WINDOW, part.windows - part.start) for part in parts)
    return parts, tuple(chain.from_iterable(pieces))


@frozen
class Missing:
    """Candidates that a model may lack, along some logs.

    Attributes
    ----------
    candidates : tuple of Candidate
    seen : Excerpt
        Of the logs that are fitted.
    root : (d, p)
        What is known of the model's values beforehand: observations of zero, in units of their
        standard deviation.
    given : ARNoise or None
        The noise, where it is known.
    families : collection of str or None
        Those that may be named; all where it is None.
    refuted : collection of (str, str)
        Families and places that may not be named.
    apart : bool
        Whether the rows in which a joint turns are left out.
    """

    candidates: tuple[Candidate, ...]
    seen: Excerpt
    root: Array = field(default_factory=lambda: np.empty((0, 0)))
    given: ARNoise | None = None
    families: Collection[str] | None = None
    refuted: Collection[tuple[str, str]] = ()
    apart: bool = False

    @staticmethod
    def of(regression: Regression, families: Sequence[Family], present: Present) -> Missing:
        """Return the candidates of families that a model does not have."""
        robot = regression.robot
        _, pieces = _look_at(regression, EXCERPT)
        motions = [piece.sparse.motion for piece in pieces]
        listed, _ = list_candidates(robot, families, present, motions, fixed=False)
        candidates = with_reversals(robot, listed, present)
        columns = sum(len(c.columns) for c in candidates)
        most = max(NUMBERS // (columns * len(robot.actuated) or 1), EXCERPT[1])
        few = (most, EXCERPT[1], most // EXCERPT[1])
        rows = sum(len(piece.moves) for piece in pieces)
        return Missing(candidates, Excerpt.of(regression, few if rows > most else EXCERPT))

    @cached_property
    def entries(self) -> Entries:
        """Columns of the fitted rows."""
        return self.seen.entries(self.candidates)

    @property
    def fixed(self) -> int:
        """Number of columns of the model."""
        return int(self.seen.X.shape[2])

    @cached_property
    def scale(self) -> Array:
        """Scale at which columns of candidates are as large as the torque of their joint, (c,).

        Pieces of one curve are alike, reached or not: beyond the data it returns to zero. Columns
        of a body are scaled as those of a compact one.
        """
        square = self._squares.sum(0)
        for c in self.candidates:
            at = list(c.columns)
            if c.family.flexible and not c.family.pairs:
                square[at] = square[at].max()
            elif c.family.name in BODIES and len(at) > 1:
                typical = np.array([LOAD[kind.rpartition("_")[2]] for kind in c.kinds])
                square[at] = np.sum(square[at] * typical**2) / typical**2
        return np.where(square > 0, np.sqrt(square), 1.0)

    @cached_property
    def noise(self) -> ARNoise:
        """Noise of each joint, with all candidates in the model that would hide in it."""
        return self.given or tuple(map(self.noise_of, range(self.seen.y.shape[1])))

    def beside(self, named: Sequence[Term]) -> Missing:
        """Return a copy whose noise is measured with the named terms, or near rivals, in the model.

        Smooth functions have a price that a named effect need not pay. They also lack effects of
        passive joints and of the path to a state: without the named terms these would count as
        noise.
        """
        columns = [k for t in named for k in (t.columns - self.fixed).tolist()]
        noise = list(self.noise)
        for j in {j for j, k in self.entries if k in columns}:
            noise[j] = self.noise_of(j, columns)
        return self.under(noise)

    def noise_of(
        self, joint: int, named: Sequence[int] = (), *, functions: bool = True
    ) -> JointNoise:
        """Return the noise of a joint, given some columns of candidates, and functions."""
        X = self.seen.X[:, joint]
        random = list[Array]()
        model = [X[:, X.any(0)]]
        for session, columns in [(False, named), *(self._beside_noise if functions else ())]:
            own = [self.entries[joint, k] for k in columns if (joint, k) in self.entries]
            if own:
                (model if session else random).append(np.stack(own, 1))
        return self._measure(joint, self.seen.runs[joint], [np.column_stack(model), *random])

    def noise_within(self, joint: int, runs: Runs) -> JointNoise:
        """Return the noise of a joint in some stretches, with the plain model alone."""
        X = self.seen.X[:, joint]
        return self._measure(joint, runs, [X[:, X.any(0)]])

    def _measure(self, joint: int, runs: Runs, blocks: Sequence[Array]) -> JointNoise:
        least = NEARLY * float(self.seen.torque_norm[joint])
        return rich_noise(blocks, self.torque[:, joint], runs, least)

    @cached_property
    def torque(self) -> Array:
        """Torque of the fitted rows minus that of the centre, (N, n) [N·m or N]."""
        return self.seen.residual(self.seen.centre)

    @cached_property
    def _beside_noise(self) -> list[tuple[bool, list[int]]]:
        """Columns of the smooth functions for the measurement of noise, nonparametric ones first.

        Differences between logs of a session have no information on the memory within them, so they
        belong to the model.
        """
        found: dict[tuple[str, str], list[Candidate]] = defaultdict(list)
        for c in self.candidates:
            # The many columns of springs over two joints would pass for the memory of noise.
            if c.family.flexible and not c.family.pairs:
                found[c.group].append(c)
        out = []
        for own in sorted(
            found.values(), key=lambda x: (not x[0].family.unnamed, x[0].family.rank)
        ):
            family = own[0].family
            finest = own if family.separate else [max(own, key=lambda c: len(c.columns))]
            out.append((family.against == "session", [k for c in finest for k in c.columns]))
        return out

    def between_reversals(self) -> Missing:
        """Return the same where no joint turns: its friction does when no record can tell.

        A joint keeps all rows if those between reversals are too few for its model and its noise.
        """
        if self.apart:
            return self
        seen = self.seen
        first = {c.columns[0] for c in self.candidates if c.family is REVERSALS}
        data = seen.data.copy()
        for (j, k), x in self.entries.items():
            if k in first:
                data[:, j] &= np.abs(x) <= TURNS * np.abs(x).max()
        runs = [split_runs(own, data[:, [j]])[0] for j, own in enumerate(seen.runs)]
        for j, own in enumerate(runs):
            if not self._has_room(j, own):
                data[:, j] = seen.data[:, j]
                runs[j] = seen.runs[j]
        out = replace(self, seen=replace(seen, data=data, runs=tuple(runs)), apart=True)
        # Columns are large: they are handed over, and computed again if this one is asked for them.
        entries = vars(self).pop("entries")
        vars(out)["entries"] = {at: entries.pop(at) * data[:, at[0]] for at in [*entries]}
        return out

    def _has_room(self, joint: int, runs: Runs) -> bool:
        """Whether stretches of a joint have enough rows for the model's columns and noise."""
        rows = sum(b - a for a, b in runs if b - a >= HIGHEST_ORDER)
        columns = np.count_nonzero(self.seen.X[:, joint].any(0))
        return bool(columns <= RULES.columns_most * rows)

    def under(self, noise: Sequence[JointNoise]) -> Missing:
        """Return a copy that uses another noise model."""
        other = replace(self, given=tuple(noise))
        same = ("entries", "scale", "sets", "groups")
        vars(other).update({name: vars(self)[name] for name in same if name in vars(self)})
        return other

    @cached_property
    def _squares(self) -> Array:
        """Sum of squares of each column in each joint over the torque's, (n, c)."""
        torque = self.seen.torque_norm**2
        width = max((c.columns[-1] + 1 for c in self.candidates), default=0)
        square = np.zeros((len(torque), width))
        for (j, k), x in self.entries.items():
            if torque[j] > 0:
                square[j, k] = x @ x / torque[j]
        return square

    def products(
        self,
        of: Excerpt | None = None,
        edges: Sequence[int] | None = None,
        noise: ARNoise | None = None,
        *,
        among: Terms | None = None,
        together: bool = False,
    ) -> Information:
        """Return the information of whitened rows: fitted ones, or others with the same columns.

        Parameters
        ----------
        of : Excerpt, optional
        edges : sequence of int, optional
            Rows at which blocks begin and end.
        noise : ARNoise, optional
            Other than theirs.
        among : tuple of Term, optional
            Terms whose columns are computed for other rows, with those of every hypothesis.
        together : bool
            Whether products of all joints are added up.
        """
        rows = of or self.seen
        entries = self.entries
        if of is not None:
            some = {k - self.fixed for t in among or () for k in t.columns.tolist()}
            some |= {k for c in self.candidates if c.family is REVERSALS for k in c.columns}
            own = [c for c in self.candidates if among is None or some & {*c.columns}]
            if of is self.seen:
                used = {k for c in own for k in c.columns}
                entries = {at: x for at, x in self.entries.items() if at[1] in used}
            else:
                entries = rows.entries(own)
        p = self.fixed
        width = len(self.scale)
        of_joints = self.seen.X.swapaxes(0, 1)
        model = [np.flatnonzero(x.any(0)) for x in of_joints]
        acting = [sorted(k for i, k in entries if i == j) for j in range(len(model))]
        pairs = zip(model, acting, strict=True)
        columns = [np.concatenate([own, np.array(at, int) + p, [p + width]]) for own, at in pairs]

        def of_joint(j: int) -> Array:
            Z = [entries[j, k] for k in acting[j]]
            fixed_columns = rows.X[:, j, model[j]]
            return np.column_stack([fixed_columns, *Z, torque[:, j]])

        # One joint after the other: in rows of a base that floats every column acts.
        blocks = map(of_joint, range(len(columns)))
        torque = rows.residual(self.seen.centre)
        known = noise or self.noise
        edges = edges or [0, len(rows.y)]
        return whitened_information(columns, blocks, known, rows.runs, edges, together=together)

    @cached_property
    def sets(self) -> dict[tuple[str, str], list[list[Candidate]]]:
        """Candidates of each shape, by family and place, and of a family everywhere."""
        found: dict[str, dict[str, list[Candidate]]] = defaultdict(lambda: defaultdict(list))
        seen = {k for _, k in self.entries}
        for c in self.candidates:
            if seen.intersection(c.columns):
                name, place = c.group
                found[name][place].append(c)
        out: dict[tuple[str, str], list[list[Candidate]]] = {}
        for name, places in found.items():
            every = list(places.values())
            out |= {(name, place): [[c] for c in own] for place, own in places.items()}
            family = every[0][0].family
            # The same share of each joint's range is no common period.
            if len(every) > 1 and family.local and not family.refined:
                shapes = range(len(every[0]))
                out[name, EVERYWHERE] = [[x[k] for x in every if k < len(x)] for k in shapes]
        return out

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Groups of the candidates, each with its price."""
        may = self.families
        possible = [key for key in self.sets if key not in self.refuted]
        asked = [key for key in possible if may is None or key[0] in may]
        places = Counter(name for name, _ in asked)
        families = {k[0]: self.sets[k][0][0].family for k in asked}
        likely = {name: np.exp(-RULES.rival * f.unnamed) for name, f in families.items()}
        out = []
        for name, place in asked:
            sets = self.sets[name, place]
            rarity = sum(likely.values()) / likely[name]
            price = float(np.log(rarity) + np.log(places[name]))
            positive = all(c.positive for some in sets for c in some)
            members = list_members(sets, self.fixed)
            unnamed = families[name].unnamed
            out.append(Group(name, place, members, price, positive, unnamed))
        return tuple(out)

    def model(self) -> MixedModel:
        """Return the mixed model of the fitted rows.

        Friction at reversals belongs to every hypothesis. It is a part of the fixed columns, with
        the variance that it has given the model.
        """
        own = self.products(together=True).added_up()
        p = self.fixed
        diagonal = own.between(np.arange(p), np.arange(p))
        acts = diagonal > ROUNDOFF**2 * diagonal.max(initial=0.0)  # else rounding is left of it
        scale = np.concatenate([np.sqrt(np.where(acts, diagonal, 1.0)), self.scale])
        groups = tuple(g for g in self.groups if g.family != REVERSALS.name)
        prior = self.root.T @ self.root
        # Products are of the torque about the centre.
        plain = MixedModel(own, p, groups, scale, prior, -self.seen.centre)
        always = (REVERSALS.name, EVERYWHERE)
        if always not in self.sets:
            return plain
        columns = np.concatenate([c.columns for c in self.sets[always][0]]) + p
        with_columns = (Group(*always, (columns,), 0.0),)
        (term,) = replace(plain, groups=with_columns).gains()
        precision = np.diag(scale[columns] ** 2 / term.variance)
        known_prior = block_diag(prior if prior.size else np.zeros((p, p)), precision)
        zeros = np.zeros(len(columns))
        mean = np.append(plain.mean, zeros)
        return replace(
            plain,
            fixed=p + len(columns),
            prior=known_prior,
            mean=mean,
        )


def with_reversals(
    robot: Robot, candidates: Sequence[Candidate], present: Present
) -> tuple[Candidate, ...]:
    """Return friction at reversals where there is dry friction, then candidates that fit a model.

    Effects that refine another effect fit only a model with that effect.
    """
    kinds = tuple(kind for kind, *_ in ReversalFriction.units)
    columns = tuple(range(len(kinds)))
    always = [
        Candidate(REVERSALS, axis.name, np.nan, kinds, REVERSALS.effect, columns)
        for axis in robot.axes
        if ("coulomb_friction", axis.name) in present
    ]
    fits = [c for c in candidates if not c.family.needs or (c.family.needs, c.place) in present]
    return tuple(number([*always, *fits]))


def list_members(sets: Sequence[Sequence[Candidate]], first: int) -> tuple[np.ndarray, ...]:
    """Return the columns of each shape, and of all of them where they form a curve."""
    members = [np.concatenate([c.columns for c in some]).astype(int) + first for some in sets]
    family = sets[0][0].family
    if (family.continuous or family.separate) and len(members) > 1:
        members.append(np.concatenate(members))
    return tuple(members)


# `MissingEffects`: effects that a model may lack, and their effect on its labels.
#
# An effect that nobody named leaves its trace in the parameters that resemble it, and no interval
# of the residual holds that. So every group that a model may lack counts by its probability: the
# shift by named groups is subtracted from the labels, and one more of the others may be present.


def place_of(term: Term) -> str:
    """Return where a group is, in words."""
    if term.group.place != EVERYWHERE:
        return term.group.place
    if EVERYWHERE in term.places:
        return "all joints"
    return join(term.places, most=len(term.places)) if term.places else "some joints"


def describe_term(term: Term) -> str:
    """Return the title and place of a group, such as "Stribeck friction in joint_2"."""
    return name_place(term.group.family, place_of(term))


def shorten_places(effect: str) -> str:
    """Return an effect without its joints if they are more than three.

    Examples
    --------
    >>> shorten_places("Stribeck friction in a, b, c and d"), shorten_places("a spring in a and b")
    ('Stribeck friction in several joints', 'a spring in a and b')
    """
    name, _, places = effect.rpartition(" in ")
    return f"{name} in several joints" if places.count(", ") > 1 else effect


def _name_term(term: Term) -> str:
    """Return a group in words, with its rival or the number of its rivals."""
    names = [shorten_places(describe_term(one)) for one in (term, *term.rivals)]
    names[1:] = names[1:] if len(names) < 3 else [f"one of {len(names) - 1} others"]
    return " or ".join(names)


@frozen
class Share:
    """Contribution of a group to the torque, if the group is present.

    Attributes
    ----------
    term : Term
    weight : float
        Its probability; 1 of what is named.
    own : float
        The same for friction of its joint, which may be nonlinear without a name.
    columns : (k,) int
        Among the u columns of all.
    value : (k,)
        Of its columns.
    root : (q, k)
        Of the covariance ``rootᵀ root`` of its error.
    """

    term: Term
    weight: float
    own: float
    columns: np.ndarray
    value: Array
    root: Array

    def weigh(self, names: Sequence[str]) -> list[float]:
        """Return its probability for each of some parameters."""
        place = self.term.group.place
        friction = {f"{place}.Fc", f"{place}.Fv"}
        return [self.own if name in friction else self.weight for name in names]


@frozen
class JointRows:
    """Columns that act in one joint.

    Attributes
    ----------
    columns : (c,) int
        Of the model.
    X : (m, c)
        A factor of their rows, with the same products.
    random : (r,) int
        Of the groups, among the u columns of all.
    Z : (m, r)
        The same of these.
    """

    columns: np.ndarray
    X: Array
    random: np.ndarray
    Z: Array


@frozen
class MissingEffects:
    """Groups that a model may lack, and their effect on its values.

    Attributes
    ----------
    named : tuple of Term
        That gain what names them.
    shares : tuple of Share
        Of these, and of all others.
    rows : tuple of JointRows
        Columns of model and groups at each joint, neither weighed nor whitened.
    noise : ARNoise
        Noise of each joint, measured in the presence of all groups; empty where there are none.
    alone : tuple of float
        Log odds of each named term where the model has no other.
    """

    named: Terms
    shares: tuple[Share, ...]
    rows: tuple[JointRows, ...] = ()
    noise: ARNoise = ()
    alone: tuple[float, ...] = ()

    @property
    def functions(self) -> Strings:
        """Titles and places of the named effects."""
        return tuple(describe_term(t) for t in self.ordered)

    @property
    def ordered(self) -> Terms:
        """The named groups, that which explains most first."""
        return tuple(sorted(self.named, key=lambda term: -term.odds))

    @property
    def statement(self) -> str:
        """The effect that explains most, and that the model lacks, as the start of a sentence.

        It is reported from odds of 20 to 1 on, by fitted and unseen rows together. Its probability
        is by the fitted rows, and unseen rows may only lower it: the errors of a model are alike in
        both, and would count twice.
        """
        sure = [t for t in self.ordered if t.odds + t.unseen >= RULES.name + RULES.keep]
        if not sure:
            return ""
        first = sure[0]
        probability = state_probability(first.odds + min(first.unseen, 0.0))
        most = f"{_name_term(first)}{first.peak} ({probability})"
        if len(sure) == 1:
            return f"the model lacks {most}"
        return f"the model lacks {len(sure)} effects, above all {most}"

    def of_labels(
        self, submodel: Submodel, fit: Estimate, prior: Array | None = None
    ) -> LabelAlternatives | None:
        """Return the effect of the groups on the values of a model; None where there is none.

        The prior (d, k + 1) of the fit holds values that rows hardly determine, here as there.
        """
        if not self.shares:
            return None
        kept = list(fit.kept)
        M = submodel.M[:, kept]
        w = fit.weights
        used = max(s.columns.max() for s in self.shares) + 1
        XX = np.zeros((M.shape[1], M.shape[1]))
        if prior is not None:
            XX += prior[:, kept].T @ prior[:, kept]
        XB = np.zeros((M.shape[1], used))
        for weight, joint in zip(w, self.rows, strict=True):
            X = joint.X @ M[joint.columns]
            XX += weight * (X.T @ X)
            XB[:, joint.random] += weight * (X.T @ joint.Z)
        size = np.sqrt(np.maximum(np.diag(XX), 1e-300))
        sizes = np.outer(size, size)
        scaled = XB / size[:, None]
        T = np.linalg.lstsq(XX / sizes, scaled, rcond=ROUNDOFF)[0]
        T /= size[:, None]
        own = [(T[:, s.columns], s) for s in self.shares]
        moved = np.array([A @ s.value for A, s in own])
        error = np.array([((A @ s.root.T) ** 2).sum(1) for A, s in own])
        weight = np.array([s.weigh([submodel.columns[k] for k in kept]) for s in self.shares])
        sure = np.arange(len(own)) < len(self.named)
        each = weight * (moved**2 + error)
        open_ = weight * (error + moved**2 * ~sure[:, None])
        shift = np.zeros(len(submodel))
        sigma = np.zeros(len(submodel))
        shift[kept] = moved[sure].sum(0)
        sigma[kept] = np.sqrt(open_.sum(0))
        names = [""] * len(submodel)
        chance, change = np.zeros((2, len(submodel)))
        most = each.argmax(0)
        for at, (column, share) in enumerate(zip(kept, most.tolist(), strict=True)):
            names[column] = describe_term(self.shares[share].term)
            chance[column] = weight[share, at]
            change[column] = moved[share, at]
        return LabelAlternatives(shift, sigma, tuple(names), chance, change)


@frozen
class LabelAlternatives:
    """Effect of groups that may be missing on the k values of a model.

    Attributes
    ----------
    shift : (k,)
        Value less what the model with the named groups finds.
    sigma : (k,)
        Standard deviation of that, by what is named and by one group more.
    names : tuple of str
        The group that matters most to each,
    chance : (k,)
        its probability, 1 if it is named, NaN if it is unknown,
    change : (k,)
        and by how much the value is larger if it is present.
    """

    shift: Array
    sigma: Array
    names: Strings
    chance: Array
    change: Array

    @property
    def rare(self) -> np.ndarray:
        """Whether that group is rarer than the values above a 95 % interval, (k,) bool."""
        return self.chance < ENDS[0]

    @staticmethod
    def none(k: int) -> LabelAlternatives:
        """Return that no group may be missing, for k values."""
        return LabelAlternatives(np.zeros(k), np.zeros(k), ("",) * k, *np.zeros((2, k)))


NO_MISSING_EFFECTS = MissingEffects((), ())
