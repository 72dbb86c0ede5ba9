"""`Doubt`: functions that may be missing beside a model, and what they do to its labels.

An effect that nobody named leaves its trace in the parameters that resemble it, and no interval of
the residual holds that. So smooth functions of each joint's motion and load stand beside the model:
each a random walk that is zero somewhere in its range, nobody knows where, whose size is the one
that makes the torque likeliest with all parameters integrated out [Harville 1977; Wahba 1978].
Columns are low-passed and thinned exactly as the regressor. They are not made orthogonal to it:
what both explain is what is in doubt.

A function is taken where its likelihood ratio is larger than chance gives [Self & Liang 1987] under
noise that was measured beside the model *alone*, and where it makes unseen motion likelier. Noise
measured beside all functions would be what they leave of it: too fast and too small, so that slow
noise looks like them (of 20 robots without any, 2 to 5 were doubted). Beside the model alone a
missing function counts as noise until it is taken, which costs little while it is small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from scipy.special import erfc

from identifiability.effects.effect import Along
from identifiability.effects.nominal import has_masses, rigid_torque
from identifiability.effects.transmission import carried_load
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.noise import (
    ARNoise,
    JointNoise,
    JointRuns,
    LaggedProducts,
    RestrictedLikelihood,
)
from identifiability.estimation.rules import RULES
from identifiability.foundation.errors import listing
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import signals
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Regression, choose_within, inside
from identifiability.robot import Motion, Robot

#: Samples of all logs up to which all are looked at; of more so many windows of so many samples.
EXCERPT = (6_000, 6, 1_000)

#: Samples that columns are computed of at a time, and folds that take turns.
PIECE, FOLDS = 8_192, 10

#: Values of a function over its range; of speed they lie closer at rest, where friction bends.
KNOTS = 8
EVEN = np.linspace(0.0, 1.0, KNOTS)
AT_REST = EVEN**2

#: Sizes that are tried, over that at which function and noise are alike in an average direction.
SIZES = np.logspace(-4.0, 6.0, 61)


#: A direction of unit columns that is shorter than the root of this is none.
THIN: Tolerance = 1e-10

#: What a function is of, in words, and how many columns it has.
KINDS = {
    "a function of its velocity": 2 * KNOTS,
    "a function of its position": KNOTS,
    "a straight line over its position": 2,
    "friction that depends on its load": KNOTS,
}
WIDTH = sum(KINDS.values())
_ENDS = np.cumsum([*KINDS.values()]).tolist()
_OWN = tuple(slice(e - w, e) for e, w in zip(_ENDS, KINDS.values(), strict=True))


def pinned_walk(x: Array) -> Array:
    """Return a root (m, m) of the covariance of a random walk at x (m,), zero somewhere in [0, 1].

    It is ``∫₀¹ 1[(x − a)(x' − a) > 0] min(|x − a|, |x' − a|) da``.
    """
    low, high = np.minimum.outer(x, x), np.maximum.outer(x, x)
    values, vectors = np.linalg.eigh(0.5 * (low**2 + (1.0 - high) ** 2))
    root: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return root


def interpolate(x: Array, knots: Array) -> Array:
    """Return what gives a function at x (N,) from its values at knots (m,), (N, m).

    Beyond the ends it is what it is there.
    """
    x = np.clip(x, knots[0], knots[-1])
    ends = np.concatenate([knots[:1], knots, knots[-1:]])
    hats: Array = scipy.interpolate.BSpline.design_matrix(x, ends, 1).toarray()
    return hats


_ROOT, _ROOT_AT_REST = pinned_walk(EVEN), pinned_walk(AT_REST)


@frozen
class Course:
    """Where each actuated joint was, how fast, and what it carried.

    Attributes
    ----------
    q, v : (N, n) [rad or m; rad/s or m/s]
    load : (N, n) [N·m or N]
        By the file's masses, zero where it has none.
    """

    q: Array
    v: Array
    load: Array

    @staticmethod
    def of(robot: Robot, motion: Motion) -> Course:
        """Return what functions are of, and no more: a motion takes several times as much."""
        return Course(motion.actuated_q, motion.actuated_v, _carried(robot, motion))


@frozen
class Ranges:
    """Where the fitted motion went, which functions are over.

    Attributes
    ----------
    speed : (n,) [rad/s or m/s]
        The largest.
    position, load : (2, n) [rad or m; N·m or N]
        The least and the largest. The load is by the file's masses, zero where it has none.
    """

    speed: Array
    position: Array
    load: Array

    @staticmethod
    def of(robot: Robot, courses: Sequence[Course]) -> Ranges:
        """Return the ranges of what was gone through."""
        q, v, load = (np.concatenate([getattr(c, k) for c in courses]) for k in ("q", "v", "load"))
        ends = [np.stack([x.min(0), x.max(0)]) for x in (q, load)]
        speed = np.abs(v).max(0)
        speed[: len(robot.joints) - len(robot.motor_joints)] = 0.0  # nothing rubs at a base
        return Ranges(speed, *ends)

    def columns(self, course: Course) -> Array:
        """Return the torque of each joint by its own functions of unit size, (N, n, `WIDTH`)."""
        n, sign = len(self.speed), np.sign(course.v)
        out = np.zeros((len(sign), n, WIDTH))
        for j in range(n):
            speed, place, line, carried = (out[:, j, own] for own in _OWN)
            if self.speed[j] > 0:
                size = np.abs(course.v[:, j]) / self.speed[j]
                curve = interpolate(size, AT_REST) @ _ROOT_AT_REST
                speed[:, :KNOTS] = curve * (sign[:, j, None] > 0)
                speed[:, KNOTS:] = curve * (sign[:, j, None] < 0)
            x = _share(course.q[:, j], self.position[:, j])
            if x is not None:
                place[:] = interpolate(x, EVEN) @ _ROOT
                line[:, 0], line[:, 1] = 1.0, np.sqrt(3.0) * (2.0 * x - 1.0)
            x = _share(course.load[:, j], self.load[:, j])
            if x is not None:
                carried[:] = (interpolate(x, EVEN) @ _ROOT) * sign[:, j, None]
        return out


def _share(x: Array, ends: Array) -> Array | None:
    """Return how far x (N,) is between two ends, from 0 to 1; None where they are one."""
    low, high = ends
    return (x - low) / (high - low) if high > low else None


def _carried(robot: Robot, motion: Motion) -> Array:
    """Return what each joint carries by the file's masses, (N, n) [N·m or N]."""
    if not has_masses(robot):
        return np.zeros_like(motion.actuated_q)
    load, joints = rigid_torque(robot, motion), robot.axes[: len(robot.motor_joints)]
    out = np.zeros_like(motion.actuated_q)
    for axis in joints:
        at = robot.joints.index(axis.name)
        out[:, at] = carried_load(load, Along(robot, motion, axis))
    return out


@frozen
class Rows:
    """Model, functions and torque after decimation.

    Attributes
    ----------
    X : (N, n, k)
    B : (N, n, c)
        Of the joint's own functions.
    y : (N, n) [N·m or N]
    data : (N, n) bool
        Where torque of each joint is data; elsewhere its rows are zero.
    runs : JointRuns
        Stretches of data without gaps, of each joint.
    log : (N,) int
    """

    X: Array
    B: Array
    y: Array
    data: np.ndarray
    runs: JointRuns
    log: np.ndarray

    @staticmethod
    def of(regression: Regression, ranges: Ranges | None = None) -> tuple[Rows, Ranges]:
        """Return the rows of a regression, and the ranges: its own, or those that are given."""
        windows = choose_within(regression.windows, EXCERPT)
        # Motion is not kept beside the chunks, so stretches of long logs that no window reaches
        # into are not read again.
        parts = [
            part
            for part in regression.parts()
            if inside(windows[part.log], part.start, part.start + part.samples.outputs)
        ]
        robot, pieces = regression.robot, []
        for part in parts:
            start = part.start
            for piece in part.samples.pieces(PIECE):
                stop = start + len(piece.motion.t[piece.at])
                if seen := [rows for _, rows in inside(windows[part.log], start, stop)]:
                    pieces.append((Course.of(robot, piece.motion), piece.coarse, seen))
                start = stop
        ranges = ranges or Ranges.of(robot, [course for course, *_ in pieces])
        B = []
        for course, coarse, several in pieces:
            own = ranges.columns(course)
            own = own if coarse is None else coarse.apply(own)
            B += [own[rows].copy() for rows in several]
        shown = [c for part in parts for c in part.shown()]
        chunks = [own for c in shown for own in c.inside(windows[c.log])]
        t = np.concatenate([c.t for c in chunks])
        log = np.concatenate([np.full(len(c.t), c.log) for c in chunks])
        at = np.concatenate([c.start + np.arange(len(c.t)) for c in chunks])
        apart = (np.diff(log) != 0) | (np.diff(at) != 1)
        edges = [0, *(np.flatnonzero(apart) + 1).tolist(), len(at)]
        cuts = edges[:-1]
        for a, b in pairwise(edges):
            cuts = cuts + (a + 1 + np.flatnonzero(signals.has_gap(t[a:b]))).tolist()
        starts = sorted(set(cuts))
        runs = tuple(zip(starts, [*starts[1:], len(at)], strict=True))
        X, y, data = (np.concatenate([getattr(c, k) for c in chunks]) for k in ("W", "tau", "data"))
        own = np.concatenate(B) * data[:, :, None]
        return Rows(X, own, y, data, JointRuns.of(runs, data), log), ranges

    @cached_property
    def columns(self) -> tuple[np.ndarray, ...]:
        """Columns of the model that act at each joint; rounding of what cancels there does not."""
        size = np.abs(self.X).max(0, initial=0.0)
        return tuple(np.flatnonzero(x) for x in size > ROUNDOFF * size.max(0, initial=0.0))

    @cached_property
    def lagged(self) -> tuple[LaggedProducts, ...]:
        """Products of each joint: of those columns, of its functions and of its torque."""
        Z = (
            np.concatenate([self.X[:, j, at], self.B[:, j], self.y[:, j, None]], axis=1)
            for j, at in enumerate(self.columns)
        )
        return tuple(LaggedProducts.of(z, r) for z, r in zip(Z, self.runs.each, strict=True))

    def noise(self, joint: int, taken: Sequence[int] = ()) -> JointNoise:
        """Return the noise of a joint beside the model and the functions that it took.

        What rounding leaves says nothing: it is infinite there.
        """
        lagged, k = self.lagged[joint], len(self.columns[joint])
        if not lagged.counts:
            return JointNoise(np.empty(0), np.empty((0, 0)), np.inf, 1.0, 0.0)
        own = [_OWN[i % len(KINDS)] for i in taken if i // len(KINDS) == joint]
        blocks = [np.arange(k), *(k + np.arange(WIDTH)[at] for at in own)]
        y, rows = self.y[:, joint], lagged.rows
        T = _orthonormal(lagged.plain, blocks, int(RULES.columns_most * rows))
        Z, left, known = (
            [self.X[:, joint, self.columns[joint]], self.B[:, joint]],
            y,
            np.zeros(len(T)),
        )
        for _ in range(2):  # once more for the digits that products lose
            found = T @ (T[:k].T @ (Z[0].T @ left) + T[k:-1].T @ (Z[1].T @ left))
            left = left - Z[0] @ found[:k] - Z[1] @ found[k:-1]
            known += found
        scale = float(np.linalg.norm(y)) or 1.0
        rest = -known / scale
        rest[-1] = 1.0 / scale
        problem = RestrictedLikelihood(
            lagged.times(np.column_stack([T, rest])), float(left @ left) / scale**2, scale
        )
        best = problem.maximise()
        sigma = np.inf if problem.silent else problem.sigma(best)
        unknown = np.zeros((len(best), len(best)))
        return JointNoise(best, unknown, sigma, float(problem.dof), problem.left)


def _orthonormal(products: Array, blocks: Sequence[np.ndarray], most: int) -> Array:
    """Return combinations of columns that are orthonormal, at most so many, (m, c).

    Block by block; of a block that does not fit whole the directions that stand out most.

    Parameters
    ----------
    products : (m, m)
        Of the columns.
    blocks : sequence of (b,) int
        Columns that are taken.
    most : int
    """
    out = np.zeros((len(products), 0))
    for block in blocks:
        at = block[np.diag(products)[block] > 0]
        length = np.sqrt(np.diag(products)[at])
        K = products[at] @ out
        squares, vectors = np.linalg.eigh(
            (products[np.ix_(at, at)] - K @ K.T) / np.outer(length, length)
        )
        kept = np.flatnonzero(squares > RULES.column_short**2)[::-1][: most - out.shape[1]]
        own = np.zeros((len(products), len(kept)))
        own[at] = vectors[:, kept] / length[:, None]
        own -= out @ (K.T @ own[at])
        out = np.column_stack([out, own / np.sqrt(squares[kept])])
    return out


@frozen
class Products:
    """Products of whitened rows: of the model's k columns, n · c functions and the torque.

    Attributes
    ----------
    all : (k + n c + 1, k + n c + 1)
    model : int
        k.
    """

    all: Array
    model: int

    @staticmethod
    def of(rows: Rows, noise: ARNoise) -> Products:
        """Return those of all rows."""
        n, k, c = len(rows.lagged), rows.X.shape[2], rows.B.shape[2]
        out = np.zeros((k + n * c + 1,) * 2)
        for j, (lagged, own) in enumerate(zip(rows.lagged, noise.joints, strict=True)):
            at = [*rows.columns[j].tolist(), *range(k + j * c, k + (j + 1) * c), k + n * c]
            if lagged.counts and np.isfinite(own.sigma):
                out[np.ix_(at, at)] += lagged.whitened(own.pacf) / own.sigma**2
        return Products(out, k)

    @staticmethod
    def parts(rows: Rows, noise: ARNoise, parts: int) -> list[Products]:
        """Return those of so many parts of the rows, one after the other."""
        X, B, y = (noise.whiten(a, rows.runs) for a in (rows.X, rows.B, rows.y[:, :, None]))
        N, n, k = X.shape
        c = B.shape[2]
        edges = np.ceil(np.arange(parts + 1) * N / parts).astype(int)
        out = np.zeros((parts, *(k + n * c + 1,) * 2))
        for j in range(n):
            at = [*range(k), *range(k + j * c, k + (j + 1) * c), k + n * c]
            Z = np.concatenate([X[:, j], B[:, j], y[:, j]], axis=1)
            for own, (start, stop) in zip(out, pairwise(edges.tolist()), strict=True):
                own[np.ix_(at, at)] += Z[start:stop].T @ Z[start:stop]
        return [Products(own, k) for own in out]

    def __add__(self, other: Products) -> Products:
        """Return those of both."""
        return replace(self, all=self.all + other.all)

    def __sub__(self, other: Products) -> Products:
        """Return those of the rest."""
        return replace(self, all=self.all - other.all)

    @cached_property
    def beside(self) -> tuple[Array, Array]:
        """Products of functions (nc, nc), and with the torque (nc,), beside the model."""
        k = self.model
        size = np.sqrt(np.maximum(np.diag(self.all)[:k], 1e-300))
        values, vectors = np.linalg.eigh(self.all[:k, :k] / np.outer(size, size))
        seen = values > THIN * values[-1]
        A = (vectors[:, seen] / np.sqrt(values[seen])).T @ (self.all[:k, k:] / size[:, None])
        left = self.all[k:, k:] - A.T @ A
        return left[:-1, :-1], left[:-1, -1]

    def solve(self, u: Array) -> Array:
        """Return the values of the model beside functions of some values (nc,), (k,)."""
        k = self.model
        target = self.all[:k, -1] - self.all[:k, k:-1] @ u
        size = np.sqrt(np.maximum(np.diag(self.all)[:k], 1e-300))
        scaled = self.all[:k, :k] / np.outer(size, size)
        found: Array = np.linalg.lstsq(scaled, target / size, rcond=THIN)[0] / size
        return found

    def given(self, S: Array, at: np.ndarray) -> tuple[Array, Array]:
        """Return the same of some functions, beside the model and those of variances S (nc,)."""
        G, g = self.beside
        on = np.flatnonzero(S)
        if not len(on):
            return G[np.ix_(at, at)], g[at]
        K = np.linalg.solve(np.diag(1.0 / S[on]) + G[np.ix_(on, on)], G[np.ix_(on, at)]).T
        return G[np.ix_(at, at)] - K @ G[np.ix_(on, at)], g[at] - K @ g[on]

    def gain(self, S: Array) -> float:
        """Return twice the rise of the log-likelihood by functions of variances S (nc,)."""
        on = np.flatnonzero(S)
        G, g = self.beside
        D = np.sqrt(S[on])
        # A function that is all but in the model leaves less than rounding, of either sign.
        values, vectors = np.linalg.eigh(D[:, None] * G[np.ix_(on, on)] * D)
        values, z = np.maximum(values, 0.0), vectors.T @ (D * g[on])
        return float((z**2 / (1.0 + values) - np.log1p(values)).sum())


def find_size(G: Array, g: Array) -> tuple[float, float]:
    """Return twice the largest rise of the log-likelihood by a function, and its variance."""
    values, vectors = np.linalg.eigh(G)
    values = np.maximum(values, 0.0)
    if not values[-1] > 0:
        return 0.0, 0.0
    S = (SIZES / values.mean())[:, None]
    rise = (S * (vectors.T @ g) ** 2 / (1 + S * values) - np.log1p(S * values)).sum(1)
    best = int(np.argmax(rise))
    return (float(rise[best]), float(S[best, 0])) if rise[best] > 0 else (0.0, 0.0)


@frozen
class MissingFunction:
    """A function that the fitted motion says is missing, and unseen motion confirms.

    Attributes
    ----------
    joint : str
    of : str
        What it is a function of, in words (`KINDS`).
    p_value : float
        Family-wise.
    unseen : float
        Rise of the log-likelihood of unseen motion by it.
    error : float
        Of the joint without any function, over its noise.
    explained : float
        Share of the squares of that error that all functions of the joint explain; zero where they
        make the torque likelier and its squares no less.
    """

    joint: str
    of: str
    p_value: float
    unseen: float
    error: float
    explained: float

    @property
    def text(self) -> str:
        """What it is and where, such as "a function of its velocity in joint_2"."""
        return f"{self.of} in {self.joint}"


#: Joints of which a sentence says what is missing; a table has them all.
TOLD = 2


@frozen
class Doubt:
    """Functions that are missing beside a model, and what they say of its values.

    Attributes
    ----------
    functions : tuple of MissingFunction
        Empty where none is missing.
    columns : tuple of (u,) int
        Of each, among the u columns of all.
    value : (u,)
        Of the columns in the mixed model.
    covariance : (u, u)
        Of its error.
    XX, XB : (n, k, k), (n, k, u)
        Products of model and functions at each joint, neither weighed nor whitened.
    """

    functions: tuple[MissingFunction, ...]
    columns: tuple[np.ndarray, ...]
    value: Array
    covariance: Array
    XX: Array
    XB: Array

    @property
    def statement(self) -> str:
        """What the model errs by where something is missing, for before ": diagnose"."""
        parts = []
        for joint in dict.fromkeys(f.joint for f in self.functions):
            own = [f for f in self.functions if f.joint == joint]
            what, share = listing([f.of for f in own]), own[0].explained
            explains = "explains" if len(own) == 1 else "explain"
            much = f"{explains} {100 * share:.0f} % of that" if share > 0 else "makes it likelier"
            parts.append(f"{joint} errs {own[0].error:.2g} × its noise; {what} {much}")
        more = len(parts) - TOLD
        others = [f"and so for {more} more joint{'s' if more > 1 else ''}"] if more > 0 else []
        return "; ".join([*parts[:TOLD], *others])

    def to_list(self) -> list[dict[str, Any]]:
        """Return the functions as a JSON result has them."""
        return [
            {
                "joint": f.joint,
                "of": f.of,
                "p_value": f.p_value,
                "log_likelihood_unseen": f.unseen,
                "error_over_noise": f.error,
                "explained": f.explained,
            }
            for f in self.functions
        ]

    def of_labels(self, submodel: Submodel, fit: Estimate) -> LabelDoubt | None:
        """Return what the functions do to the values of a model; None where none is missing."""
        if not self.functions:
            return None
        kept = list(fit.kept)
        M, w = submodel.M[:, kept], fit.weights
        XX = M.T @ np.einsum("a,akl->kl", w, self.XX) @ M
        XB = M.T @ np.einsum("a,aku->ku", w, self.XB)
        size = np.sqrt(np.maximum(np.diag(XX), 1e-300))
        T = np.linalg.lstsq(XX / np.outer(size, size), XB / size[:, None], rcond=THIN)[0]
        T /= size[:, None]
        shift, sigma = np.zeros(len(submodel)), np.zeros(len(submodel))
        shift[kept] = T @ self.value
        sigma[kept] = np.sqrt(np.maximum(np.einsum("ku,uv,kv->k", T, self.covariance, T), 0.0))
        each = [
            (T[:, at] @ self.value[at]) ** 2
            + np.einsum("ku,uv,kv->k", T[:, at], self.covariance[np.ix_(at, at)], T[:, at])
            for at in self.columns
        ]
        names = [""] * len(submodel)
        for row, column in enumerate(kept):
            names[column] = self.functions[int(np.argmax([x[row] for x in each]))].text
        return LabelDoubt(shift, sigma, tuple(names))


@frozen
class LabelDoubt:
    """What functions that are missing do to the k values of a model.

    Attributes
    ----------
    shift : (k,)
        Value less what the mixed model finds.
    sigma : (k,)
        Standard deviation of that.
    names : tuple of str
        The function that matters most to each.
    """

    shift: Array
    sigma: Array
    names: tuple[str, ...]


NO_DOUBT = Doubt((), (), np.empty(0), np.empty((0, 0)), np.empty((0, 0, 0)), np.empty((0, 0, 0)))


def find_doubt(regression: Regression, unseen: Regression | None = None) -> Doubt:
    """Return the functions that are missing beside all columns of a regression.

    Noise in the motion leaves its own functions: least squares is pulled towards zero by it, and
    they explain the rest. Where the motion has a second record, whose noise is another, a function
    is missing only if both say that something is missing in its joint.

    Parameters
    ----------
    regression : Regression
        Of the logs that are fitted.
    unseen : Regression, optional
        Of others; without them stretches of the fitted ones take turns.
    """
    joints = regression.robot.joints
    plain = _plain(regression)
    search, other = _search(plain, unseen)
    # Echoes of a log, all of which are along the same smoothed motion.
    smoothed = None if regression.echo is None else regression.echo.samples[::2]
    record = regression.instruments or smoothed
    if search.taken and record is not None:
        second, _ = _search(replace(plain, samples=record), None)
        places = {i // len(KINDS) for i in second.taken}
        search = search.keep([i for i in search.taken if i // len(KINDS) in places])
    return search.conclude(joints, other or search.rows) if search.taken else NO_DOUBT


def _plain(regression: Regression) -> Regression:
    """Return a regression by least squares: itself, with the chunks that it keeps, where it is."""
    if regression.instruments is None and regression.echo is None:
        return regression
    return replace(regression, instruments=None, echo=None)


def _search(regression: Regression, unseen: Regression | None) -> tuple[Search, Rows | None]:
    """Return what is taken and confirmed, and the rows of unseen motion, if they were asked."""
    rows, ranges = Rows.of(regression)
    search = Search.of(rows, len(regression.robot.joints))
    while (found := search.next()) is not None:
        search = found
    if not search.taken:
        return search, None
    other = None
    if unseen is not None:
        other, _ = Rows.of(_plain(unseen), ranges)
    return search.confirm(other), other


@frozen
class Search:
    """Functions that are taken one at a time.

    Attributes
    ----------
    rows : Rows
        That are fitted.
    noise : ARNoise
        Beside model and functions.
    products : Products
        Whitened by it.
    S : (nc,)
        Variance of every column; zero for functions that are not taken.
    taken : tuple of int
        Functions: joint × kinds + kind.
    p_values, unseen : tuple of float
        Of each; what it adds to the log-likelihood of unseen motion, once that was asked.
    """

    rows: Rows
    noise: ARNoise
    products: Products
    S: Array
    taken: tuple[int, ...] = ()
    p_values: tuple[float, ...] = ()
    unseen: tuple[float, ...] = ()

    @staticmethod
    def of(rows: Rows, joints: int) -> Search:
        """Return the search before anything is taken."""
        noise = ARNoise(tuple(rows.noise(j) for j in range(joints)))
        return Search(rows, noise, Products.of(rows, noise), np.zeros(joints * WIDTH))

    def next(self) -> Search | None:
        """Return the search with one function more; None if chance explains the best as well."""
        every = range(len(self.S) // WIDTH * len(KINDS))
        left = [i for i in every if i not in self.taken]
        found = [(*find_size(*self.products.given(self.S, own_columns(i))), i) for i in left]
        rise, size, best = max(found, default=(0.0, 0.0, 0))
        p = 0.5 * float(erfc(np.sqrt(rise / 2.0))) * len(left)
        if not p < RULES.unasked_level or not left:
            return None
        taken, at = (*self.taken, best), best // len(KINDS)
        # What it explains counted as noise until now.
        joints = [
            self.rows.noise(at, taken) if j == at else x for j, x in enumerate(self.noise.joints)
        ]
        S, noise = self.S.copy(), ARNoise(tuple(joints))
        S[own_columns(best)] = size
        products = Products.of(self.rows, noise)
        search = replace(self, noise=noise, products=products, S=S, taken=taken)
        return replace(search, S=search.settle(), p_values=(*self.p_values, p))

    def settle(self) -> Array:
        """Return the variances, each likeliest beside the others, (nc,)."""
        S = self.S.copy()
        for i in (*self.taken, *self.taken):
            S[own_columns(i)] = 0.0
            S[own_columns(i)] = find_size(*self.products.given(S, own_columns(i)))[1]
        return S

    def confirm(self, other: Rows | None) -> Search:
        """Return the search with those functions alone that make unseen motion likelier.

        Parameters
        ----------
        other : Rows or None
            Of unseen motion; None for stretches of the fitted one in turn.
        """
        if other is not None:
            (new,) = Products.parts(other, self.noise, 1)
            pairs = [(self.products, self.products + new)]
        else:
            folds = Products.parts(self.rows, self.noise, FOLDS)
            pairs = [(self.products - fold, self.products) for fold in folds]
        search = self
        while search.taken:
            gains = search._gains(pairs)
            if min(gains) > 0:
                return replace(search, unseen=tuple(gains))
            worst = int(np.argmin(gains))
            search = search.keep([i for k, i in enumerate(search.taken) if k != worst])
        return search

    def keep(self, functions: Sequence[int]) -> Search:
        """Return the search with some of the functions alone."""
        at = [k for k, i in enumerate(self.taken) if i in functions]
        S = np.zeros_like(self.S)
        for k in at:
            S[own_columns(self.taken[k])] = self.S[own_columns(self.taken[k])]
        taken, p_values = tuple(self.taken[k] for k in at), tuple(self.p_values[k] for k in at)
        unseen = tuple(self.unseen[k] for k in at) if self.unseen else ()
        kept = replace(self, S=S, taken=taken, p_values=p_values, unseen=unseen)
        return replace(kept, S=kept.settle())

    def _gains(self, pairs: Sequence[tuple[Products, Products]]) -> list[float]:
        """Return what each function adds to the log-likelihood of what is new in some products."""
        out = []
        for i in self.taken:
            without = self.S.copy()
            without[own_columns(i)] = 0.0
            gained = [p.gain(self.S) - p.gain(without) for pair in pairs for p in pair]
            out.append(0.5 * float(np.sum(gained[1::2]) - np.sum(gained[::2])))
        return out

    def conclude(self, joints: Sequence[str], seen: Rows) -> Doubt:
        """Return what was found; errors are of rows that are seen.

        Parameters
        ----------
        joints : sequence of str
        seen : Rows
        """
        on = np.flatnonzero(self.S)
        if not len(on):
            return NO_DOUBT
        G, g = self.products.beside
        C = np.linalg.inv(np.diag(1.0 / self.S[on]) + G[np.ix_(on, on)])
        value, n = C @ g[on], len(joints)
        whole, (before, after) = np.zeros(len(self.S)), (np.zeros(n), np.zeros(n))
        whole[on] = value
        for u, out in ((np.zeros(len(self.S)), before), (whole, after)):
            beta = self.products.solve(u)
            left = seen.y - seen.X @ beta - np.einsum("njc,jc->nj", seen.B, u.reshape(n, -1))
            out[:] = np.sum(left**2, axis=0) / np.maximum(seen.data.sum(0), 1)
        functions, columns = [], []
        for i, p, gain in zip(self.taken, self.p_values, self.unseen, strict=True):
            j = i // len(KINDS)
            noise = self.noise.joints[j].left
            ratio = float(np.sqrt(before[j] / noise)), max(float(1.0 - after[j] / before[j]), 0.0)
            functions.append(MissingFunction(joints[j], [*KINDS][i % len(KINDS)], p, gain, *ratio))
            columns.append(np.flatnonzero(np.isin(on, own_columns(i))))
        k = self.products.model
        XX, XB = np.zeros((n, k, k)), np.zeros((n, k, len(on)))
        for j, (at, lagged) in enumerate(zip(self.rows.columns, self.rows.lagged, strict=True)):
            if lagged.counts:
                XX[j][np.ix_(at, at)] = lagged.plain[: len(at), : len(at)]
                own = np.flatnonzero(on // WIDTH == j)
                XB[j][np.ix_(at, own)] = lagged.plain[: len(at), len(at) + on[own] % WIDTH]
        return Doubt(tuple(functions), tuple(columns), value, C, XX, XB)


def own_columns(function: int) -> np.ndarray:
    """Return the columns of a function among those of all joints."""
    joint, kind = divmod(function, len(KINDS))
    found: np.ndarray = joint * WIDTH + np.arange(WIDTH)[_OWN[kind]]
    return found
