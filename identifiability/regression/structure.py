"""`Structure`: a robot under a model, and all that follows from these two alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identifiability.effects import FAMILIES
from identifiability.foundation.names import INERTIAL, Array, Parameter
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.base_parameters import BaseParameters, find_base_parameters
from identifiability.regression.regression import Memory, Model, Regression
from identifiability.robot import Robot


@dataclass(frozen=True, eq=False, repr=False)
class Structure:
    """A robot under a model; equal only to itself, so that what follows from it can be kept.

    Attributes
    ----------
    robot : Robot
    model : Model
    base : BaseParameters
        Its b base parameters, groupings of the p standard parameters of the model.
    """

    robot: Robot
    model: Model
    base: BaseParameters

    @staticmethod
    def of(robot: Robot, model: Model, rng: np.random.Generator | None = None) -> Structure:
        """Return the structure with what `find_base_parameters` finds.

        Of a model that says where gravity points the robot is one under that gravity.
        """
        robot = model.turn(robot)
        return Structure(robot, model, find_base_parameters(robot, model, rng))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The p standard parameters."""
        return self.base.parameters

    @property
    def G(self) -> Array:
        """Base parameters of standard parameters, (b, p)."""
        return self.base.G

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of the p standard parameters."""
        return tuple(p.name for p in self.parameters)

    @cached_property
    def present(self) -> frozenset[tuple[str, str]]:
        """The model's effects by family and place; where one is, what it supersedes is too."""
        own = {(p.group, p.owner) for p in self.parameters}
        return frozenset(own).union(
            (name, place)
            for family, place in own
            if family in FAMILIES
            for name in FAMILIES[family].effect.supersedes
        )

    @cached_property
    def nonnegative(self) -> np.ndarray:
        """Whether physics forbids a standard parameter below zero, (p,) bool."""
        return _read_only(np.array([p.nonnegative for p in self.parameters], bool))

    @cached_property
    def nominal(self) -> Array:
        """Standard parameters that the robot file states, zero where it states none, (p,)."""
        return _read_only(np.array([self.robot.nominal.get(n, 0.0) for n in self.columns]))

    @cached_property
    def nominal_base(self) -> Array:
        """Base parameters that the robot file states, (b,)."""
        return _read_only(self.G @ self.nominal)

    @cached_property
    def shapes(self) -> dict[str, float]:
        """Shapes behind the columns, by ``<joint>.<effect>``."""
        return self.model.shapes(self.robot)

    @cached_property
    def bodies(self) -> dict[str, str]:
        """Bodies of the model, loads among them: how their parameters' names start, and a title."""
        known = {f"{b}.": b for b in self.robot.bodies}
        known |= {f"{b}.payload_": f"the payload of {b}" for b in self.robot.bodies}
        return {stem: title for stem, title in known.items() if f"{stem}m" in self.columns}

    @cached_property
    def inertial(self) -> np.ndarray:
        """Columns of each body's ten parameters in the order of `INERTIAL`, (nb, 10) int."""
        at = {name: k for k, name in enumerate(self.columns)}
        rows = [[at[f"{stem}{kind}"] for kind in INERTIAL] for stem in self.bodies]
        return _read_only(np.array(rows, int).reshape(-1, 10))

    @cached_property
    def friction(self) -> dict[str, list[tuple[tuple[int, ...], tuple[float, ...]]]]:
        """Friction of each joint, alike in both directions: columns, and what of each is a unit."""
        out: dict[str, list[tuple[tuple[int, ...], tuple[float, ...]]]] = {}
        for k, p in enumerate(self.parameters):
            if p.kind == "Fc+":
                both = (k, self.columns.index(f"{p.owner}.Fc-"))
                out.setdefault(p.owner, []).append((both, (1.0, 1.0)))
            elif p.kind != "Fc-" and "friction" in p.group:
                out.setdefault(p.owner, []).append(((k,), (1.0,)))
        return out

    @cached_property
    def memory(self) -> Memory:
        """Rows of logs that are asked for several times under this structure."""
        return Memory()

    def regression(self, samples: Sequence[Prepared], *, keep: bool = False) -> Regression:
        """Return the columns of the base parameters along measured motion.

        With instruments where every log has a second record of its motion, and an echo where one
        was made of them.

        Parameters
        ----------
        samples : sequence of Samples or LongSamples
        keep : bool
            Whether rows of logs in memory are kept for the next regression of the same logs.
        """
        others = tuple(s.beside for s in samples if isinstance(s, Samples) and s.beside is not None)
        beside = others if others and len(others) == len(samples) else None
        echoes = [e for s in samples if isinstance(s, Samples) for e in s.echoes]
        echo = self.regression(echoes) if echoes else None
        what = self.robot, self.model, tuple(samples), self.base.kept, beside, echo
        return Regression(*what, self.memory if keep else None)


def _read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array


class OfStructure:
    """A result about one `structure`."""

    structure: Structure

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.structure.robot

    @property
    def base(self) -> BaseParameters:
        """What the robot's structure allows to determine."""
        return self.structure.base

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects of the unpruned model, as a ladder file writes them."""
        return self.structure.model.texts

    @property
    def shapes(self) -> Mapping[str, float]:
        """Shapes of the model's effects by ``<joint>.<effect>``."""
        return self.structure.shapes
