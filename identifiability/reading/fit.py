"""`TorqueRows`: fits of the base parameters to the torque rows, under one reading after another.

All readings of the same motion share one regressor. A reading changes the torque columns and the
weights of gravity, so a fit needs only products of columns and torque. Each product is computed
once. Adjusted rows are rows without their projection on smooth functions of the motion: an effect
that the model lacks is such a function, and must not decide between readings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy
from scipy.linalg import solve_triangular

from identifiability.effects import find_families
from identifiability.effects.inertia import WEIGHT, ActuatorInertia
from identifiability.effects.transmission import Hysteresis
from identifiability.estimation.gaussian import Normal
from identifiability.estimation.groups import Excerpt, Missing, with_reversals
from identifiability.foundation.linalg import NEARLY, ROUNDOFF, find_chains
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import copy_afresh, frozen, once_each
from identifiability.logs.prepare.dataset import Dataset
from identifiability.logs.spectrum import autocorrelation_time
from identifiability.regression.columns import list_candidates
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.robot.robot import last_bodies

from .candidates import DELAYS
from .reading import Reading

#: Size of the excerpt: most rows, as a number of windows of a number of rows, and most numbers of
#: its columns.
ROWS, NUMBERS = (2000, 8, 250), 8_000_000
#: Directions of the smooth functions below this share of the largest size are not removed.
STRONG: Tolerance = 0.03
#: Blocks of each log, which belong to two parts by turns.
BLOCKS = 8
#: Families, in addition to the smooth functions, that are removed from the rows.
CONFOUNDERS = (Hysteresis.name, ActuatorInertia.name, "passive_joint_friction")


@frozen
class JointProducts:
    """Products of one joint's columns and torque under a reading.

    Attributes
    ----------
    at : (c,) int
        Base parameters whose columns act in the joint.
    gram : (c, c)
    cross : (c,)
    square : float
    """

    at: Array
    gram: Array
    cross: Array
    square: float

    def residual(self, value: Array) -> float:
        """Return the sum of squared residuals of base parameters (b,)."""
        x = value[self.at]
        return float(self.square + x @ (self.gram @ x - 2.0 * self.cross))


def excerpt_size(structure: Structure) -> tuple[int, int, int]:
    """Return how many rows of the logs are used at most, in how many windows of how many rows."""
    joints = len(structure.robot.joints)
    columns = len(structure.base.kept)
    affordable = NUMBERS // (4 * joints * max(columns, 1))
    rows = max(min(ROWS[0], affordable), ROWS[1])
    return rows, ROWS[1], rows // ROWS[1]


def turn_columns(structure: Structure, samples: tuple[Dataset, ...], gravity: Array) -> Array:
    """Return the columns of the base parameters under another gravity, (N, n, b).

    Parameters
    ----------
    structure : Structure
    samples : tuple of Dataset
    gravity : (3,)
        Direction of gravity, in the world of the robot file.
    """
    robot = structure.robot.turned(gravity)
    turned = replace(structure, robot=robot)
    return Excerpt.of(turned.regression(samples), excerpt_size(structure)).X


def split_gravity(structure: Structure, samples: tuple[Dataset, ...], excerpt: Excerpt) -> Array:
    """Return columns without gravity, and per unit of gravity along each axis, (N, n, b, 4).

    Columns are linear in gravity. Each direction is computed once.
    """
    gravity = structure.robot.gravity
    size = float(np.linalg.norm(gravity))
    columns = {_key(gravity): excerpt.X}

    def along(direction: Array) -> Array:
        if _key(direction) not in columns:
            columns[_key(direction)] = turn_columns(structure, samples, direction)
        return columns[_key(direction)]

    weightless = 0.5 * (along(gravity) + along(-gravity))
    axes = [(along(axis) - weightless) / size for axis in size * np.eye(3)]
    return np.stack([weightless, *axes], 3)


def away_from_ends(excerpt: Excerpt) -> np.ndarray:
    """Return the rows far from the ends of logs, (N,) bool: there a delayed torque is known."""
    inside = np.zeros(len(excerpt.t), bool)
    for k in np.unique(excerpt.log):
        at = excerpt.log == k
        first, last = excerpt.t[at][[0, -1]]
        end = min(DELAYS[-1], (last - first) / (2 * BLOCKS))
        begun = excerpt.t[at] >= first + end
        not_ended = excerpt.t[at] <= last - end
        inside[at] = begun & not_ended
    return inside


def constant_torque(excerpt: Excerpt) -> Array:
    """Return rows of a constant torque of each joint in each log, (n, N, L)."""
    ones = [replace(piece, tau=np.ones_like(piece.tau)).torque for piece in excerpt.pieces]
    member = excerpt.log[:, None] == np.unique(excerpt.log)
    return np.concatenate(ones).T[..., None] * member


def _key(numbers: Array) -> bytes:
    """Return a key of equal numbers; zeros of both signs are equal."""
    return np.asarray(numbers + 0.0).tobytes()


class TorqueRows:
    """Rows of the fitted logs along one motion, to which readings are fitted.

    Parameters
    ----------
    structure : Structure
        The model of the literal reading.
    excerpt : Excerpt
        The rows along the motion of the readings.
    parts : (N, n, b, 1 or 4)
        Parts of the columns of the base parameters, whose sum is weighted by gravity.
    separate_offsets : bool
        Whether each log has its own torque offsets.
    others : tuple of TorqueRows
        Rows of the same samples along other motions, whose smooth functions are removed as well.

    The columns of `parts` after the b base parameters are those of a payload's weight.
    """

    def __init__(
        self,
        structure: Structure,
        excerpt: Excerpt,
        parts: Array,
        *,
        separate_offsets: bool = False,
        others: tuple[TorqueRows, ...] = (),
    ) -> None:
        self.structure = structure
        self.robot = structure.robot
        self.excerpt = excerpt
        #: Where torque of each joint is data, (N, n), whatever its delay.
        self.data = excerpt.data & away_from_ends(excerpt)[:, None]
        self.parts = parts
        self.separate_offsets = separate_offsets
        #: The log whose torque readings delay; None for all.
        self.late: int | None = None
        self.others = others
        self._roots: dict[tuple[int, bytes], Array] = {}

    @once_each
    def of_late_log(self, log: int) -> TorqueRows:
        """Return these rows, of which a delay moves the torque of one log alone.

        They share the smooth functions, if these are computed already.
        """
        rows = copy_afresh(self)
        rows.late = log
        return rows

    @cached_property
    def acts(self) -> list[np.ndarray]:
        """Base parameters whose columns act in each joint: in a tree few do."""
        joints = range(self.parts.shape[1])
        return [np.flatnonzero(self.parts[:, j].any((0, 2))) for j in joints]

    @cached_property
    def chains(self) -> list[np.ndarray]:
        """Base parameters of each chain of joints that have some of them in common."""
        acts = np.zeros(self.parts.shape[1:3], bool)
        for joint, at in enumerate(self.acts):
            acts[joint, at] = True
        return [own for own in find_chains(acts) if acts[:, own].any()]

    def acting_gravity(self, gravity: Array) -> Array:
        """Return gravity (3,) [m/s²] of the same size, without its part that acts in no column.

        A planar arm does not feel gravity across its plane. A tilt in that direction has no value.
        Gravity that acts in no column at all is returned as it is.
        """
        along_axes = self.parts[..., 1:].reshape(-1, 3)
        sizes, directions = np.linalg.eigh(along_axes.T @ along_axes)
        acts = directions[:, sizes > ROUNDOFF * sizes.max()]
        acting = acts @ (acts.T @ gravity)
        size = np.linalg.norm(gravity)
        acting_size = np.linalg.norm(acting)
        if acting_size <= ROUNDOFF * size:
            return gravity
        return acting * size / acting_size

    @staticmethod
    def of(
        structure: Structure,
        samples: tuple[Dataset, ...],
        regression: Regression | None = None,
        *,
        turns_gravity: bool = False,
    ) -> TorqueRows:
        """Return the rows of prepared logs.

        Parameters
        ----------
        structure : Structure
        samples : tuple of Dataset
            The prepared logs, with the motion of the readings.
        regression : Regression, optional
            Columns of the base parameters along them, if they were computed already.
        turns_gravity : bool
            Whether readings may state another gravity, or lack it in some joints.
        """
        columns = regression or structure.regression(samples)
        excerpt = Excerpt.of(columns, excerpt_size(structure))
        has_weight = "rigid_body" in structure.model.names and structure.robot.gravity.any()
        if turns_gravity and has_weight:
            parts = split_gravity(structure, samples, excerpt)
        else:
            parts = excerpt.X[..., None]
        return TorqueRows(structure, excerpt, parts)

    @property
    def turns_gravity(self) -> bool:
        """Return whether the columns are known under any gravity."""
        return bool(self.parts.shape[3] > 1)

    @cached_property
    def variation(self) -> Array:
        """Variance of each torque column where it is data, (n,)."""
        pairs = zip(self.excerpt.y.T, self.data.T, strict=True)
        measured = [y[data] for y, data in pairs]
        return np.array([y.var() if len(y) else 0.0 for y in measured])

    @once_each
    def variations_at(self, joint: int) -> Array:
        """Return the variance of each torque column in the rows of one joint that are data, (n,).

        A joint has no data where it stands still, and other joints may move there. So the torque of
        one joint varies by another amount in the rows of another one.
        """
        measured = self._shifted_torque(joint, 0.0)[self.data[:, joint]]
        return measured.var(0) if len(measured) else np.zeros(len(self.acts))

    @property
    def counts(self) -> Array:
        """Number of rows of each joint whose torque is data, (n,)."""
        return self.data.sum(0)

    @cached_property
    def longest_delay(self) -> float:
        """The longest delay that is sought [s]: half a block of the shortest log."""
        numbers = np.unique(self.excerpt.log)
        logs = [self.excerpt.t[self.excerpt.log == k] for k in numbers]
        return float(min(t[-1] - t[0] for t in logs)) / (2 * BLOCKS)

    # The fit of a reading.

    def fit(self, reading: Reading, *, adjusted: bool = False) -> Array:
        """Return half the log of the residual's share of the variance of each log column, (n,)."""
        share = self.solve(reading, adjusted=adjusted)[1]
        return 0.5 * np.log(share)[np.argsort(reading.order)]

    def solve(
        self, reading: Reading, *, adjusted: bool, fixed: Mapping[int, float] | None = None
    ) -> tuple[Array, Array]:
        """Return base parameters (b,), and residual variance over that of the torque (n,).

        Friction and rotor inertia are not negative. Joints are weighted by their residual. `fixed`
        has values of base parameters that are not fitted, by their place.
        """
        joints = self._products_under(reading, adjusted)
        scale = self._scale(reading)
        weight = 1.0 / scale
        for _ in range(3):
            value = self._solve_weighted(joints, weight, fixed or {})
            residual = np.array([joint.residual(value) for joint in joints])
            residual = np.maximum(residual, ROUNDOFF * scale)
            weight = 1.0 / residual
        return value, residual / scale

    def least_shares(self, reading: Reading, *, any_gravity: bool = False) -> Array:
        """Return the least residual share of `solve` that base parameters may leave, (n,).

        Each joint has base parameters of its own, of any sign; under `any_gravity` its columns
        without gravity and along each axis have their own as well.
        """
        left = []
        for j, weight in enumerate(self.weights(reading)):
            key = j, float(reading.delay[j])
            column = reading.order[j]
            mix = np.eye(len(weight)) if any_gravity else weight[:, None]
            torque = self.torque(*key, adjusted=False)[:, column]
            cross = self.crosses(*key, adjusted=False)[column] @ mix
            explained = self._root(j, mix) @ cross.ravel()
            left.append(torque @ torque - explained @ explained)
        return np.asarray(left) / self._scale(reading)

    def _scale(self, reading: Reading) -> Array:
        """Return the sum of squares of each joint's torque column about its mean, (n,)."""
        variation = self.variation.copy()
        for j in np.flatnonzero(reading.order != np.arange(len(variation))).tolist():
            variation[j] = self.variations_at(j)[reading.order[j]]
        scale = variation * np.maximum(self.counts, 1)
        # Torque of a floating base need not be measured.
        return np.where(scale > 0.0, scale, 1.0)

    def _root(self, joint: int, mix: Array) -> Array:
        """Return the inverse factor of the products of a joint's columns, mixed by (k, m)."""
        key = joint, mix.tobytes()
        if key not in self._roots:
            products = mix.T @ self.squares(joint, adjusted=False) @ mix
            count = len(products) * mix.shape[1]
            gram = products.swapaxes(1, 2).reshape(count, count)
            size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
            fit = Normal.ridged(gram / np.outer(size, size), np.zeros(count))
            self._roots[key] = fit.root / size
        return self._roots[key]

    def count(self, reading: Reading) -> Array:
        """Return the number of independent rows of each log column under a reading, (n,).

        Rows that base parameters and smooth functions use up do not count.
        """
        gravity, (value, _) = self.weights(reading), self.solve(reading, adjusted=True)
        residuals = []
        for j, weight in enumerate(gravity):
            delay = float(reading.delay[j])
            column = reading.order[j]
            torque = self.torque(j, delay, adjusted=True)[:, column]
            columns = self.columns(j, adjusted=True) @ weight
            residuals.append(torque - columns @ value[self.acts[j]] / reading.factor[j])
        functions = [np.linalg.norm(own, axis=0).sum() for own in self._smooth]
        used = np.array(functions) + self.parts.shape[2] / len(gravity)
        free = np.maximum(self.counts - used, 0.0)
        measured = self.counts > 0
        rows = np.column_stack(residuals)[:, measured]
        independent = np.zeros(len(free))
        independent[measured] = free[measured] / autocorrelation_time(rows)
        return independent[np.argsort(reading.order)]

    def sizes_beside_file(self, reading: Reading) -> Array:
        """Return the torque of the fitted bodies over that of the file's, at each joint, (n,).

        It is negative where the two are opposite, and one where the file's bodies have no torque.
        """
        value, _ = self.solve(reading, adjusted=False)
        bodies = np.array([p.group == "rigid_body" for p in self.structure.parameters])
        of_bodies = self.structure.G[:, bodies].any(1)
        stated = self.structure.G @ np.where(bodies, self.structure.nominal, 0.0)
        # A payload is not in the file.
        of_payload = np.zeros(self.parts.shape[2] - len(stated))
        stated, of_bodies = (np.append(x, of_payload) for x in (stated, of_bodies))
        sizes = np.ones(len(self.acts))
        for j, gram in enumerate(self.grams(self.weights(reading), adjusted=False)):
            at = self.acts[j]
            by_file = gram @ (of_bodies * stated)[at]
            square = by_file @ (of_bodies * stated)[at]
            if square > 0:
                sizes[j] = by_file @ (of_bodies * value)[at] / square
        return sizes

    def _products_under(self, reading: Reading, adjusted: bool) -> list[JointProducts]:
        """Return the products of each joint under a reading."""
        gravity = self.weights(reading)
        joints = []
        grams = self.grams(gravity, adjusted=adjusted)
        for j, weight in enumerate(gravity):
            factor = reading.factor[j]
            column = reading.order[j]
            delay = float(reading.delay[j])
            torque = self.torque(j, delay, adjusted=adjusted)[:, column]
            cross = self.crosses(j, delay, adjusted=adjusted)[column] @ weight
            gram = grams[j] / factor**2
            square = float(torque @ torque)
            joints.append(JointProducts(self.acts[j], gram, cross / factor, square))
        return joints

    def _solve_weighted(
        self, joints: list[JointProducts], weight: Array, fixed: Mapping[int, float]
    ) -> Array:
        """Return the base parameters (b,) that fit all joints, each with its weight."""
        size = self.parts.shape[2]
        gram = np.zeros((size, size))
        cross = np.zeros(size)
        for by, joint in zip(weight, joints, strict=True):
            gram[np.ix_(joint.at, joint.at)] += by * joint.gram
            cross[joint.at] += by * joint.cross
        known = np.zeros(size)
        known[[*fixed]] = [*fixed.values()]
        cross = cross - gram @ known
        # Columns of length zero are not fitted.
        gram[[*fixed]] = gram[:, [*fixed]] = 0.0
        of_payload = np.zeros(size - len(self.structure.base.nonnegative), bool)
        nonnegative = np.append(self.structure.base.nonnegative, of_payload)
        for own in self.chains:
            among = gram[np.ix_(own, own)]
            known[own] += solve_nonnegative(among, cross[own], nonnegative[own])
        return known

    # Products of columns and torque, each computed once.

    def weights(self, reading: Reading) -> Array:
        """Return the weights of the parts of each joint's columns under a reading, (n, 1 or 4)."""
        gravity = np.outer(~reading.compensated, reading.gravity)
        weight = np.column_stack([np.ones(len(gravity)), gravity])
        return np.ascontiguousarray(weight[:, : self.parts.shape[3]])

    @once_each
    def columns(self, joint: int, *, adjusted: bool) -> Array:
        """Return the parts of the c columns that act in a joint, (N, c, 1 or 4)."""
        parts = self.parts[:, joint, self.acts[joint]]
        rows = self._rows_of(joint, parts.reshape(len(parts), -1), adjusted)
        return rows.reshape(parts.shape)

    @once_each
    def torque(self, joint: int, delay: float, *, adjusted: bool) -> Array:
        """Return every torque column as data of one joint, earlier by a delay [s], (N, n)."""
        return self._rows_of(joint, self._shifted_torque(joint, delay), adjusted)

    @once_each
    def crosses(self, joint: int, delay: float, *, adjusted: bool) -> Array:
        """Return products of every torque column and a joint's columns, (n, c, 1 or 4)."""
        torque = self.torque(joint, delay, adjusted=adjusted)
        columns = self.columns(joint, adjusted=adjusted)
        return np.tensordot(torque, columns, (0, 0))

    def grams(self, weights: Array, *, adjusted: bool) -> list[Array]:
        """Return the products (c, c) of each joint's columns under weights of gravity."""
        each = [self.squares(j, adjusted=adjusted) for j in range(len(weights))]
        return [parts @ w @ w for w, parts in zip(weights, each, strict=True)]

    @once_each
    def squares(self, joint: int, *, adjusted: bool) -> Array:
        """Return products of the parts of a joint's columns, (c, c, k, k) of k parts."""
        parts = self.columns(joint, adjusted=adjusted)
        _, columns, k = parts.shape
        flat = parts.reshape(len(parts), -1)
        products = (flat.T @ flat).reshape(columns, k, columns, k)
        return products.swapaxes(1, 2)

    def _shifted_torque(self, joint: int, delay: float) -> Array:
        """Return the torque columns (N, n) at a later time, low-passed afterwards.

        A row counts only where the joint's own torque is data.
        """
        outputs = []
        for piece, tau in zip(self.excerpt.pieces, self._late_torque(delay), strict=True):
            weight = np.tile(piece.weight[:, [joint]], len(self.acts))
            outputs.append(replace(piece, tau=tau, weight=weight).torque)
        shifted = np.concatenate(outputs)
        if not delay or self.late is None:
            return shifted
        at = self.excerpt.log[:, None] == self.late
        return np.where(at, shifted, self._shifted_torque(joint, 0.0))

    @once_each
    def _late_torque(self, delay: float) -> list[Array]:
        """Return the torque columns (N, n) of each piece at a later time."""
        every = []
        for piece in self.excerpt.pieces:
            t = piece.motion.t
            late = [np.interp(t + delay, t, x) for x in piece.tau.T] if delay else piece.tau.T
            every.append(np.array(late).T)
        return every

    # Adjusted rows.

    def _rows_of(self, joint: int, rows: Array, adjusted: bool) -> Array:
        """Return rows (N, m) of a joint, minus their projection on offsets and smooth functions."""
        data = self.data[:, [joint]]
        rows = data * rows
        if self.separate_offsets:
            constant = data * constant_torque(self.excerpt)[joint]
            rows -= constant @ (np.linalg.pinv(constant) @ rows)
        if not adjusted:
            return rows
        functions = self._smooth[joint]
        share = np.linalg.norm(functions, axis=0)
        basis = functions / np.maximum(share, 1e-300)
        return rows - basis @ (share[:, None] * (basis.T @ rows))

    @cached_property
    def functions(self) -> list[Array]:
        """Orthonormal smooth functions of the motion at each joint, (N, m) each.

        A direction is as long as the share of it that is projected.
        """
        families = [f for f in find_families(None) if f.unnamed or f.name in CONFOUNDERS]
        motions = [piece.motion for piece in self.excerpt.pieces]
        present = self.structure.present
        listed, _ = list_candidates(self.robot, families, present, motions, fixed=False)
        missing = Missing(with_reversals(self.robot, listed, present), self.excerpt)
        columns: list[list[Array]] = [[] for _ in self.robot.joints]
        for joint, k in sorted(missing.entries):
            data = self.data[:, joint]
            columns[joint].append(data * missing.entries[joint, k] / missing.scale[k])
        # No function acts in a joint without data.
        none = np.zeros((len(self.excerpt.t), 0))
        return [_shorten(np.stack(own, 1)) if own else none for own in columns]

    @cached_property
    def _smooth(self) -> list[Array]:
        """Smooth functions of each joint, of other motions as well."""
        same = [o for o in self.others if len(o.excerpt.t) == len(self.excerpt.t)]
        if not same:
            return self.functions
        each = zip(self.functions, *(rows.functions for rows in same), strict=True)
        return [_shorten(np.concatenate(own, 1)) for own in each]

    # Rows of one part of the logs.

    def beside(self, other: TorqueRows) -> TorqueRows:
        """Return the rows without the smooth functions of another motion as well."""
        if other.excerpt is self.excerpt:
            return self
        return TorqueRows(self.structure, self.excerpt, self.parts, others=(other,))

    def with_payload(self) -> TorqueRows:
        """Return the rows without weight, but for that of a payload on the last bodies.

        The payload adds columns of its own, so it may have other masses than the bodies.
        """
        bodies = last_bodies(self.robot)
        parameters = enumerate(self.structure.parameters)
        places = [
            k
            for k, p in parameters
            if p.group == "rigid_body" and p.owner in bodies and p.kind in WEIGHT
        ]
        weight = self.parts[..., 1:] @ self.robot.gravity @ self.structure.G[:, places]
        parts = np.append(self.parts[..., 0], weight, axis=2)
        return TorqueRows(self.structure, self.excerpt, parts[..., None])

    def with_column(self, columns: Mapping[int, Array]) -> TorqueRows:
        """Return the rows with one column more: the torque (N,) of each joint in which it acts."""
        widths = ((0, 0), (0, 0), (0, 1), (0, 0))
        parts = np.pad(self.parts, widths)
        for joint, torque in columns.items():
            parts[:, joint, -1, 0] = torque
        return TorqueRows(self.structure, self.excerpt, parts)

    def halves(self) -> tuple[TorqueRows, TorqueRows]:
        """Return the rows of two parts: every other block of each log."""
        t, log = self.excerpt.t, self.excerpt.log
        block = np.zeros(len(t), int)
        for k in np.unique(log):
            at = log == k
            since = t[at] - t[at][0]
            block[at] = k + BLOCKS * since / (since[-1] + NEARLY)
        return RowsOfPart(self, block % 2 == 0), RowsOfPart(self, block % 2 == 1)


def _shorten(functions: Array) -> Array:
    """Return orthogonal functions (N, m), each as long as the share of it that is projected."""
    if not functions.size:
        return functions
    basis, size, _ = np.linalg.svd(functions, full_matrices=False)
    weak = max(STRONG * float(size[0]), 1e-300)  # a joint at rest has size zero
    return basis * (1.0 - 1.0 / np.hypot(1.0, size / weak))


class RowsOfPart(TorqueRows):
    """Some rows of the fitted logs. Smooth functions are removed from all rows together.

    A hidden effect repeats in every part, and must not vote.

    Parameters
    ----------
    rows : TorqueRows
    chosen : (N,) bool
    """

    def __init__(self, rows: TorqueRows, chosen: Array) -> None:
        data = rows.excerpt.data & chosen[:, None]
        super().__init__(rows.structure, replace(rows.excerpt, data=data), rows.parts)
        self.acts = rows.acts
        self.rows = rows
        self.chosen = chosen

    @once_each
    def columns(self, joint: int, *, adjusted: bool) -> Array:
        """Return the parts of the c columns that act in a joint, (N, c, 1 or 4)."""
        return self.rows.columns(joint, adjusted=adjusted)[self.chosen]

    def torque(self, joint: int, delay: float, *, adjusted: bool) -> Array:
        """Return every torque column as data of one joint, earlier by a delay [s], (N, n)."""
        return self.rows.torque(joint, delay, adjusted=adjusted)[self.chosen]


def solve_nonnegative(gram: Array, cross: Array, nonnegative: Array) -> Array:
    """Return the solution (b,) of normal equations without forbidden signs [Lawson & Hanson 1974].

    Parameters
    ----------
    gram : (b, b)
    cross : (b,)
    nonnegative : (b,) bool
        Values that must not be negative.
    """
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    gram = gram / np.outer(size, size)
    # Rounding leaves something of a column that is zero.
    acts = np.diag(gram) > ROUNDOFF
    free, signed = np.flatnonzero(acts & ~nonnegative), np.flatnonzero(acts & nonnegative)
    order = np.concatenate([free, signed])
    fit = Normal.ridged(gram[np.ix_(order, order)], (cross / size)[order])
    k = len(free)
    positive = np.zeros(len(signed))
    if len(signed):
        # This block of the factor holds the signed columns after projection on the free columns.
        matrix = np.ascontiguousarray(fit.factor[k:, k:].T)
        positive = scipy.optimize.nnls(matrix, fit.half[k:])[0]
    half = fit.half[:k] - fit.factor[k:, :k].T @ positive
    value = np.zeros(len(cross))
    value[signed] = positive
    value[free] = solve_triangular(fit.factor[:k, :k], half, lower=True, trans="T")
    return value / size
