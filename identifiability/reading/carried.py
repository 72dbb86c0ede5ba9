"""`CarriedReading`: the reading of a result, which new logs of its robot get as well.

A result keeps the reading under which its logs were fitted. Logs that are given to the result later
come from the same columns, so they are read the same way. A log with torque can contradict that:
then the model fits it better with its columns as they are named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from pydantic import BaseModel, ConfigDict

from identifiability.effects.base import GravityTilt
from identifiability.foundation.errors import ModelError
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array
from identifiability.foundation.values import Fields, Json, frozen
from identifiability.logs import Log
from identifiability.logs.prepare.dataset import Dataset
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot

from .reading import Reading
from .rules import RULES

#: Fields of a reading that JSON keeps as lists of numbers, one or more a joint.
LISTS = ("order", "factor", "delay", "compensated", "gravity", "motion")
TEXTS = ("description", "remedy")
NUMBERS = ("log_odds", "error_ratio")


class ReadingEntry(BaseModel):
    """A reading in the JSON of a result; arrays as in `Reading`."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)

    description: str
    remedy: str
    order: list[int]
    factor: list[float]
    delay: list[float]
    compensated: list[bool]
    gravity: list[float]
    motion: list[list[float]]
    link_side: list[bool] = []
    parameters: dict[str, float] = {}
    log_odds: float = 0.0
    error_ratio: float = 1.0


@frozen
class CarriedReading:
    """A reading and the literal model, whose parameters describe its fitted robot.

    Attributes
    ----------
    reading : Reading
        The reading without torque offsets: those of another log are not known.
    structure : Structure
        Structure of the model under the literal reading.
    """

    reading: Reading
    structure: Structure

    @staticmethod
    def of(reading: Reading, structure: Structure) -> CarriedReading | None:
        """Return a reading without offsets and delays of single logs; None if nothing differs."""
        others = replace(reading, offsets={}, separate_offsets=False)
        if reading.late:
            others = replace(others, delay=0.0 * reading.delay, late="")
        turns = not np.allclose(reading.gravity, structure.robot.gravity)
        changes = turns or not others.keeps_columns or others.link_side.any()
        if changes:
            return CarriedReading(others, structure)
        return None

    @staticmethod
    def of_entry(entry: ReadingEntry | None, robot: Robot) -> CarriedReading | None:
        """Return the reading in an entry of JSON; None for the literal one.

        Raises
        ------
        ModelError
            If it does not belong to this robot.
        """
        if entry is None:
            return None
        # Gravity torque is that of bodies alone.
        structure = Structure.of(robot, Model.of("rigid_body"))
        values = [entry.parameters.get(name, 0.0) for name in structure.columns]
        arrays = {name: getattr(entry, name) for name in LISTS}
        texts = {name: getattr(entry, name) for name in TEXTS + NUMBERS}
        literal = Reading.literal(robot)
        other = ModelError(Finding("reading.other"))
        try:
            for name, array in arrays.items():
                arrays[name] = np.reshape(array, np.shape(getattr(literal, name)))
        except ValueError:
            raise other from None
        permutes = np.array_equal(np.sort(arrays["order"]), literal.order)
        if not (permutes and arrays["factor"].all()):
            raise other
        sides = np.array(entry.link_side, bool)
        if len(sides) not in (0, len(literal.order)):
            raise other
        reading = Reading(**texts, **arrays, parameters=np.array(values), link_side=sides)
        return CarriedReading(reading, structure)

    def to_dict(self) -> Json:
        """Return the reading as JSON keeps it."""
        values: Fields = {name: getattr(self.reading, name) for name in TEXTS + NUMBERS}
        values |= {name: getattr(self.reading, name).tolist() for name in (*LISTS, "link_side")}
        pairs = zip(self.structure.columns, self.reading.parameters.tolist(), strict=False)
        verification = self.reading.verification
        if verification is not None:
            values["verification"] = verification.to_dict()
        return values | {"parameters": dict(pairs)}

    def turn(self, robot: Robot) -> Robot:
        """Return a robot without gravity if all torque lacks it; the model states a tilt.

        Torque sensors sit where the reading says.
        """
        changes = not self.reading.gravity.any() or self.reading.link_side.any()
        if changes:
            return self.reading.robot(robot)
        return robot

    def lacking(self, log: Log, times: Array) -> Array:
        """Return the gravity torque that the columns of a literal log lack, (N, n) [N·m or N]."""
        first, last = np.searchsorted(log.t, times[[0, -1]])
        near = log.rows(max(first - 1, 0), last + 1)
        torque = self.reading.gravity_torque(near, self.structure)
        return np.column_stack([np.interp(times, near.t, column) for column in torque.T])

    def as_logged(self, times: Array, torque: Array, *, width: bool = False) -> Array:
        """Convert torque of the joints to the columns of a log, (N, n).

        Parameters
        ----------
        times : (N,) [s]
            Times of one log.
        torque : (N, n) [N·m or N]
            Torque without the part that the columns lack; or half widths of its intervals.
        width : bool
            Whether `torque` holds half widths, which have no sign.
        """
        reading = self.reading
        factors = np.abs(reading.factor) if width else reading.factor
        columns = np.empty(torque.shape)
        for j, column in enumerate(reading.order.tolist()):
            later = torque[:, j]
            if reading.delay[j]:
                later = np.interp(times - reading.delay[j], times, later)
            columns[:, column] = later / factors[j]
        return columns

    def known_as_logged(self, times: Array, known: Array) -> Array:
        """Return a mask of known values in the columns of a log, (N, n) bool.

        A delayed column has the torque of earlier samples. Before the start of the log none is
        known.

        Parameters
        ----------
        times : (N,) [s]
            Of one log.
        known : (N, n) bool
            Mask of known torque of the joints.
        """
        columns = np.empty_like(known)
        for j, column in enumerate(self.reading.order.tolist()):
            at = times - self.reading.delay[j]
            unknown = np.interp(at, times, 1.0 - known[:, j], left=1.0, right=1.0)
            columns[:, column] = unknown == 0.0
        return columns

    def find_contradictions(
        self,
        structure: Structure,
        base: Array,
        read: Sequence[Dataset],
        literal: Sequence[Dataset],
    ) -> list[Finding]:
        """Return one finding for each log that the model fits better as its columns are named.

        Values are those of the result. Only the values that another gravity adds to the literal
        model are fitted.

        Parameters
        ----------
        structure : Structure
            The model of the result, under this reading.
        base : (b,)
            Its values.
        read, literal : sequence of Dataset
            Prepared logs with torque, under this reading and with the columns as they are named.
        """
        same_gravity = np.allclose(self.reading.gravity, self.structure.robot.gravity)
        other = structure
        value = base
        none = free = np.zeros((len(base), 0))
        if not same_gravity:
            other, value, free = self._literal_model(structure, base)
        found = []
        for one, named in zip(read, literal, strict=True):
            error = _relative_error(structure, one, base, none)
            literal_error = _relative_error(other, named, value, free)
            if literal_error <= RULES.error_ratio * error:
                errors = {"error": error, "literal": literal_error}
                what = self.reading.description
                found.append(Finding("reading_contradicted", one.name, what=what, **errors))
        return found

    def _literal_model(self, structure: Structure, base: Array) -> tuple[Structure, Array, Array]:
        """Return the model under the file's gravity, its values, and their free directions."""
        texts = [text for text in structure.model.texts if not text.startswith(GravityTilt.name)]
        literal = Structure.of(self.structure.robot, Model.of(*texts))
        common = [name for name in literal.columns if name in structure.columns]
        own = [structure.columns.index(name) for name in common]
        to_literal = literal.G[:, [literal.columns.index(name) for name in common]]
        # Directions of the standard parameters that the fitted model does not identify.
        untold = scipy.linalg.null_space(structure.G[:, own])
        standard = np.linalg.lstsq(structure.G[:, own], base, rcond=None)[0]
        return literal, to_literal @ standard, scipy.linalg.orth(to_literal @ untold)


def _relative_error(structure: Structure, samples: Dataset, base: Array, free: Array) -> float:
    """Return the error of a model along one log, relative to each joint's torque (rms).

    Parameters
    ----------
    structure : Structure
    samples : Dataset
    base : (b,)
        Values of the base parameters.
    free : (b, k)
        Directions in which these are fitted to the log.
    """
    regression = structure.regression((samples,))
    chunks = [*regression.chunks()]
    columns = np.concatenate([chunk.W for chunk in chunks])
    torque = np.concatenate([chunk.tau for chunk in chunks])
    size = np.sqrt(np.mean(torque**2, axis=0))
    weight = 1.0 / np.where(size > 0.0, size, 1.0)
    residual = ((torque - columns @ base) * weight).ravel()
    shifts = ((columns @ free) * weight[:, None]).reshape(len(residual), -1)
    residual = residual - shifts @ np.linalg.lstsq(shifts, residual, rcond=None)[0]
    return float(np.sqrt(np.mean(residual**2)))
