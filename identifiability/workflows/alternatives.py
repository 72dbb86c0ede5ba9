"""Alternatives of the model itself: under a wrong one everything else seems to be missing.

Columns may be exchanged, turned, late or in another unit, an encoder's zero be elsewhere, offsets
differ between logs, a driver may have taken gravity out of torque, a base may stand otherwise than
its file says. Each is the model of the same base
parameters along other rows, or under other gravity. What fits to all rows leave proposes; what
decides is by how much it falls beside the same smooth functions, so that what is missing anyway
cannot vote, of as many rows as tell something new. Held-out logs choose none,
and masses of the file neither: one unit of all columns is none of these, since a linear model
cannot tell it from other masses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, replace
from functools import cache, cached_property, lru_cache, partial
from itertools import combinations, product

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from identifiability.effects import find_families
from identifiability.effects.base import GravityTilt, horizontal_axes
from identifiability.effects.functions import has_session
from identifiability.effects.inertia import ActuatorInertia
from identifiability.effects.transmission import Hysteresis
from identifiability.estimation.groups import Excerpt, Missing, with_reversals
from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.commands import of_commands
from identifiability.logs.prepare.dataset import move_samples
from identifiability.logs.spectrum import autocorrelation_time
from identifiability.physical.cad_prior import combine_with_file
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.quality import MeasuredLogs
from identifiability.quality.hints import find_torque_scale, measure_factors
from identifiability.regression.columns import list_candidates
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.workflows.rules import RULES

#: Rows that are looked at, of more so many windows of so many; numbers that columns may be.
ROWS, NUMBERS = (2000, 8, 250), 8_000_000
#: Alternatives that are judged.
JUDGED = 3
#: Units of one joint's torque beside the others', delays [s], and what lies between two of them.
UNITS: tuple[Tolerance, ...] = (1e-3, 1e-2, 0.1, 10.0, 1e2, 1e3)
DELAYS: tuple[Tolerance, ...] = (0.02, 0.05, 0.1, 0.2)
BETWEEN = np.geomspace(1 / 3, 3.0, 101)
#: Logs of what is left by which one alternative is as good as another.
EVEN: Tolerance = 0.02
#: Joints beyond which positions are not tried as exchanged.
MOST = 8
#: What is left, by its logarithm, where loops do not close.
OPEN = 1000
#: Of what may be missing at a joint directions count that are so strong, beside the strongest.
STRONG: Tolerance = 0.03


@frozen
class Alternative:
    """Another reading of the torque columns, or another gravity.

    Attributes
    ----------
    says, remedy : str
        What is otherwise, and what to do.
    order : (n,) int
        Column of the log that is the torque of each joint.
    factor : (n,)
        By which this is multiplied.
    late : (n,) [s]
        By how much it is late.
    lacks : (n,) bool
        Whether weight was taken out of it; read otherwise it has that of the fitted robot.
    gravity : (3,) [m/s²]
        In the file's world.
    motion : (n, n + 1)
        What positions are of those of the log, and [rad or m] by how much these are too large.
    values : (p,)
        Standard parameters of the robot that was fitted, where one has to be weighed.
    apart : bool
        Whether each log has torque offsets of its own;
    offsets : mapping of str to (n,) [N·m or N]
        these, less their mean, by the names of logs.
    free : int
        How many numbers of it were fitted.
    nats, error : float
        By how much the log evidence of the rows rises, less ½ ln N for each number [Schwarz 1978],
        and to which share the error falls.
    """

    says: str
    remedy: str
    order: np.ndarray
    factor: Array
    late: Array
    lacks: np.ndarray
    gravity: Array
    motion: Array
    values: Array = field(default_factory=lambda: np.empty(0))
    apart: bool = False
    offsets: Mapping[str, Array] = field(default_factory=dict)
    free: int = 0
    nats: float = 0.0
    error: float = 1.0

    @property
    def statement(self) -> str:
        """What is otherwise, what speaks for it, and the remedy."""
        less = percent(1.0 - self.error, 2)
        return (
            f"{self.says}: read so, the model errs by {less} less ({self.nats:.3g} nats). "
            f"{self.remedy}."
        )

    @property
    def keeps_columns(self) -> bool:
        """Whether the columns are read as they are given, and gravity alone is another."""
        n = len(self.order)
        same = (self.order == np.arange(n)) & (self.factor == 1.0) & (self.late == 0.0)
        moved = not np.array_equal(self.motion, np.eye(n, n + 1))
        return bool(same.all() and not (self.lacks.any() or self.apart or moved))

    @property
    def scaled(self) -> np.ndarray:
        """Columns of another unit, (n,) bool."""
        return np.asarray(np.abs(self.factor) != 1.0)

    def structure(self, given: Structure) -> Structure:
        """Return the model under its gravity: a direction is a tilt about it, which is fitted."""
        robot, g = given.robot, self.gravity
        if np.allclose(g, robot.gravity):
            return given
        if not g.any():
            model = robot.model.copy()
            model.gravity.linear = g
            return Structure.of(replace(robot, model=model), given.model)
        return Structure.of(robot, given.model + GravityTilt(g))

    def read(self, log: Log, given: Structure) -> Log:
        """Return a log with columns as they are meant."""
        columns = zip(self.order.tolist(), self.late.tolist(), strict=True)
        tau = [np.interp(log.t + by, log.t, log.tau[:, k]) for k, by in columns]
        weight, still = np.zeros(log.tau.shape), np.zeros(log.q.shape)
        if self.lacks.any():
            motion = complete_motion(given.robot, log.t, log.q, still, still)
            ways = (given.robot.turned(way * given.robot.gravity) for way in (1, -1))
            down, up = (given.model.regressor(robot, motion) @ self.values for robot in ways)
            # Samples whose loops do not close are left out anyway.
            weight[motion.kept] = 0.5 * self.lacks * (down - up)
        read = np.column_stack(tau) * self.factor + weight - self.offsets.get(log.name, 0.0)
        A, zero = self.motion[:, :-1], self.motion[:, -1]
        every = {name: getattr(log, name) for name in ("q", "q_ref", "dq", "ddq", "dq_ref")}
        moved = {name: x @ A.T for name, x in every.items() if x is not None}
        moved |= {name: moved[name] - zero for name in ("q", "q_ref") if name in moved}
        return replace(log, tau=read, **moved)


def find_alternative(logs: MeasuredLogs) -> Alternative | None:
    """Return the alternative of the model that fitted rows surely prefer, if there is one."""
    if logs.robot.base is not None or any(map(of_commands, logs.recordings)):
        return None
    rows = _Rows(logs)
    if rows.data.sum() < 2 * rows.parts.shape[2] or not (rows.variation > 0).all():
        return None  # they cannot tell anything
    plain = rows.fit(rows.plain)
    squares = np.exp(2 * plain)
    found: list[tuple[float, Alternative]] = []
    for a in rows.propose():
        other = (a.order != rows.plain.order) | (a.factor != 1) | (a.late != 0) | a.lacks
        # Of many columns those that leave little are not tried, one by one and pair by pair.
        small = squares[other].sum() < (1 - RULES.alternative_error**2) * squares.sum()
        if len(other) > MOST and other.any() and small:
            continue
        left = rows.fit(a)
        error = float(np.sqrt(np.exp(2 * left).sum() / squares.sum()))
        gain = round(float((plain - left).sum()) / EVEN)
        if gain > 0 and error <= RULES.alternative_error:
            found.append((gain, replace(a, error=error)))
    # Of what is as good the first is taken.
    judged = [rows.refine(a) for _, a in sorted(found, key=lambda x: -x[0])[:JUDGED]]
    if not judged:
        return None
    new, given = rows.count(judged[0]), rows.fit(rows.plain, beside=True)
    price = 0.5 * float(np.log(rows.data.sum()))
    odds = [float(new @ (given - rows.fit(a, beside=True))) - price * a.free for a in judged]
    best = int(np.argmax(np.array(odds) > max(odds) - 1.0))
    return replace(judged[best], nats=odds[best]) if odds[best] >= RULES.alternative_nats else None


class _Rows:
    """Rows of the fitted logs, of which columns are known under any gravity."""

    def __init__(
        self, logs: MeasuredLogs, motion: Array | None = None, *, apart: bool = False
    ) -> None:
        self.structure, self.robot, self.weighs = logs.structure, logs.robot, logs.weighs
        n, b = len(logs.joints), len(self.structure.base.kept)
        most = max(min(ROWS[0], NUMBERS // (4 * n * max(b, 1))), ROWS[1])
        self._most = most, ROWS[1], most // ROWS[1]
        self.logs = logs
        few = tuple(s.thin(max(1, len(s.tau) * len(logs.samples) // most)) for s in logs.samples)
        self.thinned = replace(logs, samples=few)
        self.samples = logs.samples
        if motion is not None and not apart:
            self.samples = tuple(move_samples(self.robot, s, motion) for s in logs.samples)
        self.seen = self._look(self.robot)
        self.data = self.seen.data
        #: What makes columns (N, n, b) of these parts: 1, and gravity where there is any.
        self.parts = self.seen.X[..., None]
        g, size = self.robot.gravity, float(np.linalg.norm(self.robot.gravity))
        if motion is None and size and "rigid_body" in self.structure.model.names:
            # Columns are linear in gravity, without which a tilt would have no parameters.
            bare = 0.5 * (self.seen.X + self._look(self.robot.turned(-g)).X)
            axes = [self._look(self.robot.turned(a)).X - bare for a in size * np.eye(3)]
            self.parts = np.stack([bare, *(x / size for x in axes)], 3)
        #: Which columns act in each joint: in a tree few do.
        self.acts = [np.flatnonzero(self.parts[:, j].any((0, 2))) for j in range(n)]
        same = np.arange(n), np.ones(n), np.zeros(n), np.zeros(n, bool)
        self.plain = Alternative("", "", *same, g, np.eye(n, n + 1))
        self.apart = apart
        #: The same by positions that are read otherwise, and whether offsets are of each log.
        self.at = lru_cache(JUDGED)(
            lambda by, own: _Rows(logs, np.frombuffer(by).reshape(n, n + 1), apart=own)
        )
        self.products, self.torque = cache(self._products), cache(self._torque)
        self.crosses, self.grams = cache(self._crosses), lru_cache(2)(self._grams)
        #: Of the log [s].
        self.step = float(np.median(np.diff(self.seen.pieces[0].motion.t)))

    def under(self, a: Alternative) -> _Rows:
        """Return the rows of an alternative's motion and offsets."""
        if a.apart or not np.array_equal(a.motion, self.plain.motion):
            return self.at(a.motion.tobytes(), a.apart)
        return self

    def _look(self, robot: Robot) -> Excerpt:
        structure = replace(self.structure, robot=robot)
        return Excerpt.of(structure.regression(self.samples), self._most)

    @cached_property
    def variation(self) -> Array:
        """Mean square of each column of torque about its mean, (n,)."""
        own = [y[data] for y, data in zip(self.seen.y.T, self.data.T, strict=True)]
        return np.array([y.var() if len(y) else 0.0 for y in own])

    def propose(self) -> Iterator[Alternative]:
        """Yield all alternatives but for what the sidecar says of torque."""
        names, n, said = self.robot.joints, len(self.robot.joints), self.robot.torque
        one, plain = np.eye(n, dtype=bool), self.plain
        if self.parts.shape[3] > 1 and said.compensated is None:
            what = "The effort{} seems to be compensated for gravity"
            do = "Say compensated = {} under [torque] in the sidecar"
            bare = replace(plain, says=what.format(""), remedy=do.format("true"))
            yield replace(bare, gravity=np.zeros(3))
            for name, own in zip(names, one, strict=True) if self.weighs else ():
                says, remedy = what.format(f" of {name}"), do.format(f'["{name}"]')
                yield replace(plain, says=says, remedy=remedy, lacks=own)
        do = "Correct the log or the map of its columns"
        for i, j in combinations(range(n), 2):
            order = plain.order.copy()
            order[[i, j]] = j, i
            what = f"The torque columns of {names[i]} and {names[j]} seem to be exchanged"
            yield replace(plain, says=what, remedy=do, order=order)
        some = [(f"The torque of {name}", own) for name, own in zip(names, one, strict=True)]
        every = [*some, ("The torque of all joints", np.ones(n, bool))]
        for who, own in () if said.sign else every:
            do = "Correct its sign in the log, or say sign = -1 under [torque] in the sidecar"
            what, factor = f"{who} seems to have the wrong sign", np.where(own, -1.0, 1.0)
            yield replace(plain, says=what, remedy=do, factor=factor)
        do = "Correct its unit in the log"
        for unit, (who, own) in product(() if said.gain or n < 2 else UNITS, some):
            yield replace(plain, says=who, remedy=do, factor=np.where(own, 1 / unit, 1.0), free=1)
        if not said.gain and find_torque_scale(self.logs):  # each before a gear of its own
            shares = measure_factors(self.logs)
            shows = np.isfinite(shares)
            apart = np.where(shows, np.exp(np.log(shares[shows]).mean()) / shares, 1.0)
            told = (f"{j} {x:.2g}" for j, x in zip(names, shares, strict=True) if np.isfinite(x))
            what = f"Torque is so many times what the robot file asks for: {', '.join(told)}"
            do = 'Correct units in the log, or say side = "motor" and each ratio under [torque]'
            yield replace(plain, says=what, remedy=do, factor=apart, free=n - 1)
        # Over the time of a session they are a curve, which goes on to the next log.
        clock = has_session([s.motion for s in self.samples])
        if len(self.samples) > 1 and not (self.apart or clock):
            what = "Torque offsets differ between logs"
            do = "Those of another log cannot be known; compare gives these with their intervals"
            free = n * (len(self.samples) - 1)
            yield replace(plain, says=what, remedy=do, apart=True, free=free)
        do = "Shift the column in the log"
        for by, way, (who, own) in product(DELAYS, (-1, 1), every):
            yield replace(plain, says=who, remedy=do, late=np.where(own, way * by, 0.0), free=1)
        if self.parts.shape[3] > 1:
            yield from self._directions()
        worst = float(np.exp(self.fit(self.plain)).max())
        long = any(s.long for s in self.samples)  # all of which would be moved in memory
        if worst > RULES.grades[self.robot.closed] and not long:  # loops take their time
            few = _Rows(self.thinned)
            yield from self._zeros(few)
            if worst > RULES.grades[1] and not self.robot.closed:
                yield from sorted(self._positions(), key=few.misfit)[:JUDGED]

    def misfit(self, a: Alternative) -> float:
        """Return the sum of the logs of what is left of all columns; far more if loops are open."""
        try:
            return float(self.fit(a).sum())
        except ClosureError:
            return OPEN

    def _positions(self) -> Iterator[Alternative]:
        """Yield positions that are exchanged, of another sign or in degrees."""
        names, plain = self.robot.joints, self.plain
        n, do = len(names), "Correct the log, the map of its columns or their unit"
        for i, j in combinations(range(n if n <= MOST else 0), 2):
            order, pair = plain.order.copy(), f"{names[i]} and {names[j]}"
            order[[i, j]] = j, i
            swap = replace(plain, remedy=do, motion=plain.motion[order])
            yield replace(swap, says=f"The positions of {pair} seem to be exchanged")
            yield replace(swap, says=f"The joints {pair} seem to be exchanged", order=order)
        for j, name in enumerate(names):
            own = np.arange(n) == j
            turned, small = (
                plain.motion * np.where(own, x, 1.0)[:, None] for x in (-1, np.pi / 180)
            )
            turn = replace(plain, remedy=do, motion=turned)
            yield replace(turn, says=f"The positions of {name} seem to have the wrong sign")
            factor = np.where(own, -1.0, 1.0)
            yield replace(turn, says=f"The joint {name} seems to turn the other way", factor=factor)
            if not self.robot.is_prismatic(int(self.robot.actuated[j])):
                says = f"The angles of {name} seem to be degrees"
                yield replace(plain, says=says, remedy=do, motion=small)

    def _zeros(self, few: _Rows) -> Iterator[Alternative]:
        """Yield the zeros of encoders that fit best, at the two joints where most is gained."""
        n = len(self.plain.order)
        reach = np.ptp(np.concatenate([s.motion.actuated_q for s in few.samples]), axis=0)

        def at(by: float, joint: int) -> Array:
            return np.column_stack([np.eye(n), by * reach * (np.arange(n) == joint)])

        def left(by: float, joint: int) -> float:
            return few.misfit(replace(self.plain, motion=at(by, joint)))

        tried = [(left(by, j), j, by) for j in range(n) for by in (-0.2, 0.2)]
        for _, j, by in sorted(tried)[:2]:
            ends = sorted((0.0, 4 * by))
            how = {"xatol": 1e-3, "maxiter": 14}
            x = minimize_scalar(left, ends, args=(j,), bounds=ends, method="bounded", options=how).x
            zero, who = x * reach[j], self.robot.joints[j]
            unit = "m" if self.robot.is_prismatic(int(self.robot.actuated[j])) else "rad"
            says = f"The position of {who} seems to be read {zero:.3g} {unit} too large"
            do = f"Correct its zero, or say {who} = {{offset = {-zero:.3g}}} under [columns]"
            found = replace(self.plain, says=says, remedy=do, motion=at(x, j), free=1)
            if self.misfit(found) < OPEN:
                yield found

    def refine(self, a: Alternative) -> Alternative:
        """Return an alternative with the delay, unit or robot that fits best."""
        if a.lacks.any():
            return replace(a, values=self._with_file(a))
        if a.apart:
            return self._with_offsets(a)
        if a.late.any():
            some = (np.round(x * a.late / self.step) * self.step for x in BETWEEN[::5])
            a = min((replace(a, late=late) for late in some), key=self.misfit)
        for own in np.eye(len(a.order), dtype=bool)[a.scaled]:
            near = BETWEEN[:: 5 if a.scaled.sum() == 1 else 1]  # a unit rather than beside it
            some = (np.where(own, x * a.factor, a.factor) for x in near)
            a = min((replace(a, factor=factor) for factor in some), key=self.misfit)
        late, scale, says = a.late[np.argmax(np.abs(a.late))], a.factor[a.scaled], a.says
        if late:
            says += f" seems to be {1e3 * abs(late):.3g} ms {'late' if late > 0 else 'early'}"
        elif scale.size == 1:
            says += f" is {1.0 / scale[0]:.2g} times as large as its model's"
        return replace(a, says=says)

    def _directions(self) -> Iterator[Alternative]:
        """Yield the direction of gravity that fits lead to: a tilt lets other bodies act."""

        def squares(left: Array) -> float:  # wide where logs of them are narrow
            return float(np.log(np.exp(2.0 * left).sum()))

        def along(direction: Array) -> Alternative:
            unit = direction / np.linalg.norm(direction)
            return replace(self.plain, gravity=size * unit, free=2)

        def left(aim: Callable[[Array], float], axes: Array, best: Array, x: Array) -> float:
            return aim(self.fit(along(best + axes @ x)))

        size = float(np.linalg.norm(self.robot.gravity))
        up = self.robot.gravity / size
        world = np.column_stack([*horizontal_axes(up), up])
        every: list[Array] = [world @ d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)]
        best: Array = every[int(np.argmin([squares(self.fit(along(d))) for d in every]))]
        for width, aim in ((0.3, squares), (0.03, np.sum)):
            axes = np.column_stack(horizontal_axes(best / np.linalg.norm(best)))
            simplex = width * np.vstack([np.zeros(2), np.eye(2)])
            cost, how = partial(left, aim, axes, best), {"maxfev": 40, "initial_simplex": simplex}
            found = minimize(cost, simplex[0], method="Nelder-Mead", options=how)
            best = along(best + axes @ found.x).gravity / size
            # Where weight acts along a slide alone, negative masses would fall upwards as well.
            down = best - 2.0 * min(float(best @ up), 0.0) * up
            if squares(self.fit(along(down))) <= squares(self.fit(along(best))) + EVEN:
                best = down
        tilt = self.robot.turned(along(best).gravity).tilt
        if tilt is not None:
            do = "Write it into the robot file, or export it"
            yield replace(along(best), says=f"Gravity {tilt.text}", remedy=do)

    def _with_file(self, a: Alternative) -> Array:
        """Return standard parameters (p,) that fit, the file's where the rows tell nothing."""
        (x, left), rows, w = self._solve(a, beside=False), [], self._weights(a)
        sd = np.sqrt(left * self.variation * self.data.sum(0) / self.count(a))
        for j, acting in enumerate(self.acts):
            rows.append(np.zeros((len(self.data), len(x))))
            rows[j][:, acting] = self.products(j, beside=False) @ w[j] / sd[j]
        R = np.linalg.qr(np.concatenate(rows), mode="r")
        phi, share = np.eye(len(self.structure.columns)), PHYSICAL_RULES.body_within
        both = combine_with_file(self.structure, R @ self.structure.G, R @ x, phi, share)
        return np.asarray(both.mean)

    def _with_offsets(self, a: Alternative) -> Alternative:
        """Return an alternative with the offset of each log, and where they differ most."""
        n, _, logs = self._constant.shape
        # Noise of derivatives says little of levels: rows are whitened.
        each = np.einsum("jk,jNl->Njkl", np.eye(n), self._constant)
        X = np.append(self.seen.X, each.reshape(*self.seen.X.shape[:2], -1), 2)
        none = with_reversals(self.robot, (), self.structure.present)
        model = Missing(none, replace(self.seen, X=X)).model()
        found = (model.solve().value / model.scale)[self.seen.X.shape[2] :][: n * logs]
        apart = found.reshape(n, logs).T
        apart = apart - apart.mean(0)
        each = apart.std(0, ddof=1)
        j = int(np.argmax(each**2 / self.variation))
        says = f"{a.says} by ±{each[j]:.2g} {self.robot.torque_units[j]} in {self.robot.joints[j]}"
        names = (s.name for s in self.samples)
        return replace(a, says=says, offsets=dict(zip(names, apart, strict=True)))

    # What fits to all rows leave of each column of the log.

    def _seen_at(self, j: int, rows: Array, beside: bool) -> Array:
        """Return rows (N, m) of a joint, or what smooth functions, or offsets, leave of them."""
        own = self._beside(j, self.data[:, [j]] * rows, beside)
        if self.apart:
            U = self._beside(j, self._constant[j], beside)
            own -= U @ (np.linalg.pinv(U) @ own)
        return own

    def _beside(self, j: int, own: Array, beside: bool) -> Array:
        if beside:
            U, gone = self._smooth[j]
            own = own - U @ (gone[:, None] * (U.T @ own))
        return own

    @cached_property
    def _constant(self) -> Array:
        """A constant torque of each joint in each log, (n, N, L)."""
        ones = [replace(p, tau=np.ones_like(p.tau)).torque for p in self.seen.pieces]
        each = self.seen.log[:, None] == np.unique(self.seen.log)
        return np.asarray(np.concatenate(ones)[self.seen.seen].T[..., None] * each)

    @cached_property
    def _smooth(self) -> list[tuple[Array, Array]]:
        """Most of what may be missing at each joint: functions, inertia, friction of two kinds."""
        some = Hysteresis.name, ActuatorInertia.name, "passive_joint_friction"
        families = [f for f in find_families(None) if f.unnamed or f.name in some]
        motions, present = [piece.motion for piece in self.seen.pieces], self.structure.present
        listed, _ = list_candidates(self.robot, families, present, motions, fixed=False)
        missing, out = Missing(with_reversals(self.robot, listed, present), self.seen), []
        for j in range(len(self.robot.joints)):
            acting = sorted(k for i, k in missing.entries if i == j)
            Z = np.stack([missing.entries[j, k] / missing.scale[k] for k in acting], 1)
            U, size, _ = np.linalg.svd(Z, full_matrices=False)
            weak = max(STRONG * float(size[0]), 1e-300)  # where nothing moves all is
            out.append((U, 1.0 - 1.0 / np.hypot(1.0, size / weak)))
        return out

    def _products(self, j: int, beside: bool) -> Array:
        """Return the parts of a joint (N, c, k), of the c columns that act in it."""
        own = self.parts[:, j, self.acts[j]]
        return self._seen_at(j, own.reshape(len(own), -1), beside).reshape(own.shape)

    def _grams(self, beside: bool, weights: bytes) -> list[Array]:
        """Return the products of the columns of each joint, (c, c)."""
        pairs = enumerate(np.frombuffer(weights).reshape(-1, self.parts.shape[3]))
        return [Z.T @ Z for Z in (self.products(j, beside) @ own for j, own in pairs)]

    def _torque(self, j: int, by: float, beside: bool) -> Array:
        """Return all torque (N, n) as data of a joint, some time later, before any low-pass."""
        parts = []
        for piece in self.seen.pieces:
            t = piece.motion.t
            tau = np.column_stack([np.interp(t + by, t, x) for x in piece.tau.T])
            # Whose column ever it is, it is none where this joint stands.
            weight = np.tile(piece.weight[:, [j]], len(self.acts))
            parts.append(replace(piece, tau=tau, weight=weight).torque)
        return self._seen_at(j, np.concatenate(parts)[self.seen.seen], beside)

    def _weights(self, a: Alternative) -> Array:
        """Return by what parts of each joint are multiplied, (n, 1 or 4)."""
        weight = np.column_stack([np.ones(len(a.lacks)), np.outer(~a.lacks, a.gravity)])
        return np.ascontiguousarray(weight[:, : self.parts.shape[3]])

    def _crosses(self, j: int, by: float, beside: bool) -> Array:
        """Return the products of the parts of a joint with all torque, (n, c, k)."""
        return np.tensordot(self.torque(j, by, beside), self.products(j, beside), (0, 0))

    def _solve(self, a: Alternative, beside: bool) -> tuple[Array, Array]:
        """Return values (b,), and the squares that they leave of each joint's torque (n,).

        Friction and rotor inertia are not negative; joints are weighed by what is left of them.
        """
        if (rows := self.under(a)) is not self:
            return rows._solve(replace(a, motion=self.plain.motion, apart=False), beside)
        w, b = self._weights(a), self.parts.shape[2]
        grams, each = self.grams(beside, w.tobytes()), []
        for j, (own, factor) in enumerate(zip(w, a.factor, strict=True)):
            when = j, float(a.late[j]), beside
            y, cross = self.torque(*when)[:, a.order[j]], self.crosses(*when)[a.order[j]]
            each.append((self.acts[j], grams[j] / factor**2, cross @ own / factor, y @ y))
        scale = self.variation[a.order] * np.maximum(self.data.sum(0), 1)
        weight = 1.0 / scale
        for _ in range(3):
            G, g = np.zeros((b, b)), np.zeros(b)
            for by, (at, A, h, _) in zip(weight, each, strict=True):
                G[np.ix_(at, at)] += by * A
                g[at] += by * h
            x = _solve(G, g, self.structure.base.nonnegative)
            left = np.array([y + x[at] @ (A @ x[at] - 2.0 * h) for at, A, h, y in each])
            left = np.maximum(left, 1e-9 * scale)
            weight = 1.0 / left
        return x, left / scale

    def fit(self, a: Alternative, beside: bool = False) -> Array:
        """Return logs of what is left of each column of the log over its own scale, (n,)."""
        return np.asarray(0.5 * np.log(self._solve(a, beside)[1])[np.argsort(a.order)])

    def count(self, a: Alternative) -> Array:
        """Return how many rows of each column of the log tell something new, (n,)."""
        if (rows := self.under(a)) is not self:
            return rows.count(replace(a, motion=self.plain.motion, apart=False))
        w, (x, _) = self._weights(a), self._solve(a, beside=True)
        left = [
            self.torque(j, float(a.late[j]), beside=True)[:, a.order[j]]
            - self.products(j, beside=True) @ own @ x[self.acts[j]] / a.factor[j]
            for j, own in enumerate(w)
        ]
        new = self.data.sum(0) / autocorrelation_time(np.column_stack(left))
        return np.asarray(new[np.argsort(a.order)])


def _solve(G: Array, g: Array, nonnegative: np.ndarray) -> Array:
    """Return the solution (b,) of normal equations, without columns that would be negative."""
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
    G, g = G / np.outer(size, size), g / size
    # Columns that are as good as none beside the model.
    kept = np.diag(G) > 1e-9
    while True:
        at, x = np.flatnonzero(kept), np.zeros(len(g))
        x[at] = np.linalg.solve(G[np.ix_(at, at)] + 1e-9 * np.eye(len(at)), g[at])
        if not ((x < 0) & nonnegative).any():
            found: Array = x / size
            return found
        kept &= ~((x < 0) & nonnegative)
