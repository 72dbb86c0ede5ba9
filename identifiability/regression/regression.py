"""`Model`, effects that add up, and `Regression`, its named columns along measured motion.

A regression has a `Part` for each log, or each stretch of a long one, computed chunk by chunk.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Annotated, Any
from weakref import WeakKeyDictionary

import numpy as np

from identifiability.effects import Effect, Part, Placed, find_effect, find_family
from identifiability.effects.effect import fill_measured
from identifiability.effects.inertia import RigidBody
from identifiability.effects.registry import split_places
from identifiability.foundation.engines import Engine, Result, Serial, Steps
from identifiability.foundation.errors import ModelError
from identifiability.foundation.names import Array, NumberByName, Parameter, Strings
from identifiability.foundation.options import Expected, checked
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.stages import Stages
from identifiability.foundation.values import Fields, frozen
from identifiability.logs.prepare.dataset import Dataset, Piece
from identifiability.logs.rows import forget
from identifiability.robot import Motion, Robot

# `Model`: effects that add up.


EffectName = Annotated[str, Expected("the name of an effect, such as 'rigid_body'")]


@frozen
class Model:
    """A sum of effects; ``model + effect`` adds one.

    Attributes
    ----------
    effects : tuple of Effect
    random : mapping of str to float
        Standard deviation about zero that values of some parameters are known to have [SI].

    Example
    -------
    >>> model = Model.of("rigid_body", "viscous_friction")
    >>> [e.name for e in (model + find_effect("coulomb_friction")).effects]
    ['rigid_body', 'viscous_friction', 'coulomb_friction']
    """

    effects: tuple[Effect, ...]
    random: NumberByName = field(default_factory=dict)

    @staticmethod
    @checked
    def of(*names: EffectName) -> Model:
        """Return the model of some effects by name.

        ``NAME@PLACE+PLACE`` is an effect at some joints, motors or bodies only, and
        ``NAME@PLACE:SHAPE`` has a shape of its own there, such as the Stribeck velocity [SI].
        A place may be a pattern: ``NAME@wrist_*`` is at all whose names fit, ``*`` being any
        letters and ``?`` one. ``NAME.KIND+KIND@PLACE`` has some of its parameters there.

        Raises
        ------
        ModelError
            If there is no such effect, or none with a shape.
        """
        return Model(()).with_effects(_read_effects(names))

    def with_effects(self, effects: Iterable[Effect]) -> Model:
        """Return the model with more effects; superseded effects are left out."""
        chosen = list(self.effects)
        for effect in effects:
            if any(e.name == effect.name for e in chosen):
                continue
            if any(effect.name in e.supersedes for e in chosen):
                continue
            chosen = [e for e in chosen if e.name not in effect.supersedes] + [effect]
        return Model(tuple(chosen), self.random)

    def __add__(self, effect: Effect) -> Model:
        """Return the model with one more effect."""
        return self.with_effects([effect])

    @property
    def names(self) -> Strings:
        """Names of the effects."""
        return tuple(e.name for e in self.effects)

    def turn(self, robot: Robot) -> Robot:
        """Return the robot that the model is about: a tilted base has gravity elsewhere."""
        for effect in self.effects:
            robot = effect.turn(robot)
        return robot

    @property
    def texts(self) -> Strings:
        """The effects as a ladder file writes them, and `of` reads them."""
        return tuple(text for e in self.effects for text in e.texts)

    @property
    def stage_key(self) -> tuple[Any, ...]:
        """Key that is the same for equal models."""
        effects = (getattr(e, "stage_key", id(e)) for e in self.effects)
        return (*effects, *sorted(self.random.items()))

    def __repr__(self) -> str:
        """Return its effects, in one line."""
        return f"<Model: {' + '.join(self.texts)}>"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the standard parameters of all effects, in column order."""
        return tuple(p for e in self.effects for p in e.parameters(robot))

    def shapes(self, robot: Robot) -> dict[str, float]:
        """Return the shapes behind the columns, by ``<joint>.<effect>``."""
        return {name: at for e in self.effects for name, at in e.shapes(robot).items()}

    def widths(self, robot: Robot) -> list[int]:
        """Return the number of columns of each effect."""
        return [len(e.parameters(robot)) for e in self.effects]

    def regressor(self, robot: Robot, motion: Motion, widths: Sequence[int] | None = None) -> Array:
        """Return the regressor W (N, n, p): ``W[k] @ phi`` is the torque at sample k.

        Parameters
        ----------
        robot : Robot
        motion : Motion
        widths : sequence of int, optional
            What `widths` returned, which takes as long as some hundred samples do.
        """
        widths = self.widths(robot) if widths is None else widths
        if not sum(widths):
            raise ModelError("The model has no effects; name at least one, such as rigid_body.")
        W = np.zeros((len(motion), len(robot.actuated), sum(widths)))
        ends = np.cumsum(widths).tolist()
        for effect, width, end in zip(self.effects, widths, ends, strict=True):
            fill_measured(effect, robot, motion, W[:, :, end - width : end])
        return motion.freed(W)

    def all_sensors(self, robot: Robot, motion: Motion) -> Array:
        """Return the regressor (N, n, p), or of sensors on both sides of gears (N, 2n, p)."""
        W = self.regressor(robot, motion)
        if not robot.torque.has_side("both"):
            return W
        drives = self.regressor(robot, replace(motion, drives_alone=True))
        return np.concatenate([W, drives], axis=1)


def _read_effects(texts: Iterable[str]) -> list[Effect]:
    """Return effects as a ladder file writes them; all places of one are one effect."""
    by_name: dict[str, list[str]] = {}
    for text in texts:
        name = text.partition("@")[0]
        family = name.partition(".")[0] if "@" in text else name
        by_name.setdefault(family, []).append(text)
    return [_read_effect(name, dict.fromkeys(written)) for name, written in by_name.items()]


def _read_effect(name: str, written: Iterable[str]) -> Effect:
    effect = find_effect(name)
    parts: list[Part] = []
    for text in written:
        if "@" not in text:
            return effect
        places, shape = split_places(text)
        family = find_family(name)
        if shape is not None and not effect.shape_size:
            raise ModelError(f"'{text}': {name} has no shape; leave out the number behind the ':'.")
        given = 0 if shape is None else len(shape) if isinstance(shape, tuple) else 1
        most = effect.shape_size + bool(effect.exponents)
        if given not in (0, effect.shape_size, most):
            raise ModelError(
                f"'{text}': the shape of {name} is {effect.shape_size} numbers, and {given} stand "
                "behind the ':'."
            )
        before = text.partition("@")[0]
        kinds = tuple(filter(None, before.partition(".")[2].split("+")))
        parts += [Part(family.at(shape, place), place, kinds) for place in places]
    return Placed(parts, tuple(written))


# Which samples of logs are looked at one by one: all of short logs, windows of long ones.
#
# Sums over samples come from `Information`, over every sample. Other quantities (sizes of errors,
# their memory, pictures) take rows of the regressor, and 50,000 of them give a percent or two.


#: Samples of all logs that are looked at one by one; of more only so many windows of so many
#: samples are, one in each of as many parts of equal length, and one of each log at least.
EXCERPT, WINDOWS, WINDOW = 100_000, 20, 2_500


def choose_windows(
    counts: Sequence[int], sizes: tuple[int, int, int] | None = None
) -> tuple[np.ndarray, ...]:
    """Return the samples [start, stop) of each log that are looked at one by one, (w, 2) each.

    Parameters
    ----------
    counts : sequence of int
        Samples of each log.
    sizes : (excerpt, windows, size) int, optional
        Up to so many samples of all logs all are looked at, of more so many windows of so many
        samples; `EXCERPT`, `WINDOWS` and `WINDOW` by default.
    """
    excerpt, windows, size = sizes or (EXCERPT, WINDOWS, WINDOW)
    total = sum(counts)
    if total <= excerpt:
        return tuple(np.array([[0, c]]) for c in counts)
    out = []
    for count in counts:
        k = np.arange(max(1, round(windows * count / total)))
        own = min(size, count)
        part = count / len(k)
        # Each window lies this share of the rest of its part later than the one before, or as much
        # earlier as it would leave the part: no period of a motion is met at the same phase each
        # time.
        turns = (((5**0.5 - 1) / 2) * k) % 1.0
        starts = (k * part + turns * (part - own)).astype(int)
        out.append(np.stack([starts, starts + own], 1))
    return tuple(out)


# `Part` of a regression: a log, or a stretch of a long one, computed chunk by chunk.


#: Samples a chunk: the regressor of one chunk stays in the processor's cache.
CHUNK = 1024

#: Memory for the regressor of a block of samples [bytes].
BLOCK_BYTES = 32_000_000


def rows_at_once(robot: Robot, widths: Sequence[int]) -> int:
    """Return the number of samples whose regressor is computed at a time."""
    bytes_per_row = 8 * len(robot.actuated) * sum(widths)
    return min(CHUNK, max(1, BLOCK_BYTES // bytes_per_row))


def compute_blocks(
    model: Model, robot: Robot, motion: Motion, widths: Sequence[int]
) -> Iterator[Array]:
    """Yield the regressor of consecutive samples, as many at a time as memory allows."""
    size = rows_at_once(robot, widths)
    for start in range(0, len(motion), size):
        yield model.regressor(robot, motion[start : start + size], widths)


@frozen
class Chunk:
    """Consecutive rows of a regression.

    Attributes
    ----------
    log : int
        Which log they come from.
    start : int
        Output of that log at which they begin.
    W : (m, n, p)
    tau, raw : (m, n) [N·m or N]
        Torque, low-passed if W is, and as measured.
    t : (m,) [s]
    instruments : (m, n, p) or None
        Instruments for W where W itself is noisy.
    data : (m, n) bool
        Where torque of each joint is data; elsewhere rows of W, instruments and torque are zero.
    """

    log: int
    start: int
    W: Array
    tau: Array
    raw: Array
    t: Array
    data: np.ndarray
    instruments: Array | None = None

    @property
    def wide(self) -> Array:
        """Instruments, if there are any, then W, (m, n, 2p) or (m, n, p)."""
        V = self.instruments
        if V is None:
            return self.W
        return np.concatenate([V, self.W], axis=2)

    def rows(self, start: int, stop: int) -> Chunk:
        """Return a copy of some of its rows."""
        arrays = {k: v for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        own: Fields = {k: v[start:stop].copy() for k, v in arrays.items()}
        return replace(self, start=self.start + start, **own)


@frozen
class LogPart:
    """A log of a regression, or a stretch of a long one: small to send, large to compute.

    Attributes
    ----------
    regression : Regression
        Of this log or stretch alone.
    log : int
        Index of the log in the whole regression.
    start : int
        Output of that log at which the part begins.
    windows : (w, 2) int
        Outputs [start, stop) of the log that are looked at one by one.
    kept : list of Chunk or None
        Where all chunks are kept, once they were computed; None if they take too much memory.
    """

    regression: Regression
    log: int
    start: int
    windows: np.ndarray
    kept: list[Chunk] | None

    @property
    def samples(self) -> Dataset:
        """The log, or the stretch."""
        return self.regression.samples[0]

    @property
    def remote(self) -> bool:
        """Whether it is worth sending to another process."""
        return self.samples.own is not None

    def chunks(self) -> Iterator[Chunk]:
        """Yield its chunks, which are kept for the next time where there is room."""
        if self.kept is None:
            yield from self._computed()
            return
        if not self.kept:
            self.kept[:] = self._computed()
        yield from (replace(chunk, log=self.log) for chunk in self.kept)

    def shown(self) -> Iterator[Chunk]:
        """Yield the chunks of its windows alone."""
        if self.kept is None:
            yield from self._computed(self.windows - self.start)
            return
        for chunk in self.chunks():
            windows = (self.windows - chunk.start).clip(0, len(chunk.t))
            yield from (chunk.rows(a, b) for a, b in windows.tolist() if a < b)

    def _computed(self, windows: np.ndarray | None = None) -> Iterator[Chunk]:
        """Yield its chunks, or those of some windows of its outputs."""
        r = self.regression
        both = [*r.samples, *(r.instruments or ())]
        size = rows_at_once(r.robot, r._widths)
        for piece, *others in zip(*(x.pieces(size, windows) for x in both), strict=False):
            t = piece.motion.t[piece.at]
            W, *instruments = (self._regressor(x) for x in (piece, *others))
            if any(V.shape != W.shape for V in instruments):
                raise ValueError("instruments need as many samples as the log that they stand for")
            moves = piece.moves
            if r.dwelling:
                piece = replace(piece, weight=np.ones_like(piece.weight))  # noqa: PLW2901 - it all
            V = piece.weighed(instruments[0]) if instruments else None
            what = piece.weighed(W), piece.torque, piece.raw, t, moves, V
            yield Chunk(self.log, self.start + piece.first, *what)

    def _regressor(self, piece: Piece) -> Array:
        r = self.regression
        count = len(piece.moves)
        stop = piece.first + count
        out = np.zeros((count, len(r.robot.actuated), len(r._chosen)))
        shared = self.kept is not None and r.instruments is None
        for places, share in r._shares:
            if shared and share.model.names == (RigidBody.name,):
                acts, rows = share._all_acting()
                rows = rows[piece.first : stop]
            else:
                acts, rows = share._acting(piece)
            joints, columns = np.nonzero(acts)
            out[:, joints, places[columns]] = rows
        return out


def _join(blocks: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Return which columns are not zero in any block, (n, p) bool, and their values, (N, k)."""
    every = np.any([acts for acts, _ in blocks], axis=0)
    values = [_spread(x, acts[every]) for acts, x in blocks]
    return every, np.concatenate(values)


def _spread(x: Array, places: Array) -> Array:
    """Return columns (N, k) at their places, a mask (m,), among columns of zeros, (N, m)."""
    if places.all():
        return x
    out = np.zeros((len(x), len(places)))
    out[:, places] = x
    return out


# `Regression`: named columns of a `Model` along measured motion, chunk by chunk.


#: Rows are kept up to this size, not computed again [bytes].
KEEP_BYTES: Tolerance = 150e6

#: Columns of bodies by motion and tree: models of one robot have them in common.
_OF_BODIES: WeakKeyDictionary[Motion, WeakKeyDictionary[Any, Stages]] = WeakKeyDictionary()


@frozen
class Regression:
    """Named columns W and torque of one or more logs, computed chunk by chunk on demand.

    Attributes
    ----------
    robot : Robot
    model : Model
    samples : tuple of Dataset
        Prepared logs.
    columns : (b,) int or None
        Which columns of the model are computed (the base parameters'); None for all.
    instruments : tuple of Dataset, or None
        Motion along which instruments are computed, of each log, sample by sample.
    dwelling : bool
        Whether rows are computed where joints dwell, too: their torque can be predicted.
    """

    robot: Robot
    model: Model
    samples: tuple[Dataset, ...]
    columns: np.ndarray | None = None
    instruments: tuple[Dataset, ...] | None = None
    dwelling: bool = False

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Names and units of the columns."""
        every = self.model.parameters(self.robot)
        if self.columns is None:
            return every
        return tuple(every[k] for k in self.columns)

    @cached_property
    def _widths(self) -> list[int]:
        """Number of columns of each effect of the model."""
        return self.model.widths(self.robot)

    @property
    def outputs(self) -> int:
        """Number of samples after decimation, over all logs."""
        return sum(s.outputs for s in self.samples)

    @cached_property
    def _shares(self) -> list[tuple[np.ndarray, Regression]]:
        """Columns of rigid bodies, and all others: their places, and the regression of these."""
        effects = self.model.effects
        widths = np.array(self._widths)
        rigid = np.array([isinstance(e, RigidBody) for e in effects])
        of_bodies = np.repeat(rigid, widths)
        columns = self._chosen
        out = []
        for chosen in (True, False):
            among = of_bodies == chosen
            places = np.flatnonzero(among[columns])
            if not len(places):
                continue
            at = np.flatnonzero(rigid == chosen)
            numbers = np.cumsum(among) - 1
            model = Model(tuple(effects[k] for k in at))
            share = replace(self, model=model, columns=numbers[columns[places]])
            vars(share)["_widths"] = widths[at].tolist()
            out.append((places, share))
        return out

    @property
    def _chosen(self) -> np.ndarray:
        """Columns of the model that are computed, (b,)."""
        if self.columns is None:
            return np.arange(sum(self._widths))
        return self.columns

    def _acting(self, piece: Piece) -> tuple[Array, Array]:
        """Return which columns are not zero, (n, p) bool, and their low-passed values, (m, k)."""
        piece = piece.sparse
        columns = self._chosen
        blocks = []
        for W in compute_blocks(self.model, self.robot, piece.motion, self._widths):
            acts = np.asarray(W.any(0))[:, columns]
            joints, places = np.nonzero(acts)
            flat = W.reshape(len(W), -1)
            at = W.shape[2] * joints + columns[places]
            blocks.append((acts, np.take(flat, at, axis=1)))
        acts, values = _join(blocks)
        if not self.dwelling:
            joints = np.nonzero(acts)[0]
            values = piece.silenced(values, joints)
        return acts, piece.down(values)

    def _all_acting(self) -> tuple[Array, Array]:
        """Return the same for all outputs of the only log, kept for other models of the tree."""
        (samples,) = self.samples
        trees = _OF_BODIES.setdefault(samples.motion, WeakKeyDictionary())
        stages = trees.setdefault(self.robot.model, Stages())
        inputs = samples.weight, samples.decimation, self.robot.torque, self.dwelling
        columns = tuple(self._chosen.tolist())
        return stages.once(_gather_acting, *inputs, columns, regression=self)

    @cached_property
    def windows(self) -> tuple[np.ndarray, ...]:
        """Samples [start, stop) of each log that are looked at one by one, (w, 2) each."""
        return choose_windows([s.outputs for s in self.samples])

    def chunks(self) -> Iterator[Chunk]:
        """Yield its chunks in order of time, log by log."""
        for part in self.parts():
            yield from part.chunks()

    def parts(self) -> list[LogPart]:
        """Return the regression divided into tasks: stretches of long logs, others whole."""
        out = []
        for k, samples in enumerate(self.samples):
            both = [samples, *(self.instruments or ())[k : k + 1]]
            start = 0
            for one, *beside in zip(*(x.divided() for x in both), strict=True):
                own = replace(self, samples=(one,), instruments=tuple(beside) or None)
                out.append(LogPart(own, k, start, self.windows[k], self._kept[k]))
                start += one.outputs
        return out

    def followed_by(self, other: Regression) -> Regression:
        """Return the same columns of these logs, then of others, with the chunks of both."""
        joined = replace(self, samples=(*self.samples, *other.samples), instruments=None)
        vars(joined)["_kept"] = [*self._kept, *other._kept]
        return joined

    def for_robot(self, robot: Robot) -> Regression:
        """Return these columns, with their chunks, for effects along the loads of a robot."""
        other = replace(self, robot=robot)
        vars(other)["_kept"] = self._kept
        return other

    def with_torque(self, samples: Sequence[Dataset]) -> Regression:
        """Return these columns, with their chunks, of logs that differ in torque alone."""
        size = rows_at_once(self.robot, self.model.widths(self.robot))
        kept = list[list[Chunk] | None]()
        for chunks, log in zip(self._kept, samples, strict=True):
            if not chunks:
                kept.append(None if chunks is None else [])
                continue
            pairs = zip(chunks, log.pieces(size), strict=True)
            kept.append([replace(chunk, tau=p.torque, raw=p.raw) for chunk, p in pairs])
        other = replace(self, samples=tuple(samples))
        vars(other)["_kept"] = kept
        return other

    @cached_property
    def _kept(self) -> list[list[Chunk] | None]:
        """Where chunks of each log are kept; None if they take too much memory."""
        width = len(self.parameters) * (1 if self.instruments is None else 2)
        size = 8 * self.outputs * len(self.robot.actuated) * width
        return [None if x.long or size >= KEEP_BYTES else [] for x in self.samples]


def _gather_acting(*_: Any, regression: Regression) -> tuple[Array, Array]:
    """Return the columns that act along the only log of a regression, for `_all_acting`."""
    (samples,) = regression.samples
    size = rows_at_once(regression.robot, regression._widths)
    pieces = samples.pieces(size)
    return _join([regression._acting(piece) for piece in pieces])


def map_parts(
    function: Callable[[LogPart], Result],
    parts: Sequence[LogPart],
    engine: Engine | None,
    progress: Steps | None,
) -> Iterator[Result]:
    """Yield ``function(part)`` for every part of a regression, in order.

    Parameters
    ----------
    function : callable
        As `Engine.map` wants it.
    parts : sequence of Part
    engine : Engine, optional
        Where stretches of long logs are worked on; logs in memory are worked on here.
    progress : callable(int, int), optional
        Called with the number of parts done and to do.
    """
    remote = [p for p in parts if p.remote]
    found = (engine or Serial()).map(function, remote) if remote else iter(())
    for done, part in enumerate(parts, 1):
        yield next(found) if part.remote else function(part)
        forget()  # the rows that were sent to a worker
        if progress is not None:
            progress(done, len(parts))
