"""`Model`: effects that add up."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated

import numpy as np

from identifiability.effects import Effect, Part, Placed, find_effect, find_family
from identifiability.foundation.errors import ModelError
from identifiability.foundation.names import Array, Parameter
from identifiability.foundation.options import Expected, checked
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot

EffectName = Annotated[str, Expected("the name of an effect, such as 'rigid_body'")]


@frozen
class Model:
    """A sum of effects; ``model + effect`` adds one.

    Example
    -------
    >>> model = Model.of("rigid_body", "viscous_friction")
    >>> [e.name for e in (model + find_effect("coulomb_friction")).effects]
    ['rigid_body', 'viscous_friction', 'coulomb_friction']
    """

    effects: tuple[Effect, ...]

    @staticmethod
    @checked
    def of(*names: EffectName) -> Model:
        """Return the model of some effects by name.

        ``NAME@PLACE+PLACE`` is an effect at some joints, motors or bodies only, and
        ``NAME@PLACE:SHAPE`` has a shape of its own there, such as the Stribeck velocity [SI].
        A place may be a pattern: ``NAME@wrist_*`` is at all whose names fit, ``*`` being any
        letters and ``?`` one.

        Raises
        ------
        ModelError
            If there is no such effect, or none with a shape.
        """
        return Model(()).with_effects(_read_effects(names))

    def with_effects(self, effects: Iterable[Effect]) -> Model:
        """Return the model with more effects; what they supersede is left out."""
        chosen = list(self.effects)
        for effect in effects:
            if any(e.name == effect.name for e in chosen):
                continue
            if any(effect.name in e.supersedes for e in chosen):
                continue
            chosen = [e for e in chosen if e.name not in effect.supersedes] + [effect]
        return Model(tuple(chosen))

    def __add__(self, effect: Effect) -> Model:
        """Return the model with one more effect."""
        return self.with_effects([effect])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(e.name for e in self.effects)

    def turn(self, robot: Robot) -> Robot:
        """Return the robot that the model is about: a tilted base has gravity elsewhere."""
        for effect in self.effects:
            robot = effect.turn(robot)
        return robot

    @property
    def texts(self) -> tuple[str, ...]:
        """The effects as a ladder file writes them, and `of` reads them."""
        return tuple(text for e in self.effects for text in e.texts)

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
        """Return how many columns each effect has."""
        return [len(e.parameters(robot)) for e in self.effects]

    def regressor(
        self,
        robot: Robot,
        motion: Motion,
        out: Array | None = None,
        widths: Sequence[int] | None = None,
        again: int = 0,
    ) -> Array:
        """Return the regressor W (N, n, p): ``W[k] @ phi`` is the torque at sample k.

        Parameters
        ----------
        robot : Robot
        motion : Motion
        out : (at least N, n, p), optional
            Where to.
        widths : sequence of int, optional
            What `widths` returned, which takes as long as some hundred samples do.
        again : int
            Samples at the beginning whose rows `out` has already.
        """
        widths = self.widths(robot) if widths is None else widths
        if not sum(widths):
            raise ModelError("The model has no effects; name at least one, such as rigid_body.")
        shape = (len(motion), len(robot.actuated), sum(widths))
        W = np.zeros(shape) if out is None else out[: len(motion)]
        start = 0
        for effect, width in zip(self.effects, widths, strict=True):
            first = again if effect.pointwise else 0
            own = W[first:, :, start : start + width]
            own[:] = 0.0
            effect.fill(robot, motion[first:] if first else motion, own)
            start += width
        return W


def _read_effects(texts: Iterable[str]) -> list[Effect]:
    """Return effects as a ladder file writes them; all places of one are one effect."""
    by_name: dict[str, list[str]] = {}
    for text in texts:
        by_name.setdefault(text.partition("@")[0], []).append(text)
    return [_read_effect(name, dict.fromkeys(written)) for name, written in by_name.items()]


def _read_effect(name: str, written: Iterable[str]) -> Effect:
    effect = find_effect(name)
    parts: list[Part] = []
    for text in written:
        if "@" not in text:
            return effect
        places, shape = _split_shape(text.partition("@")[2])
        family = find_family(name)
        if shape is not None and not effect.shape_size:
            raise ModelError(f"'{text}': {name} has no shape; leave out the number behind the ':'.")
        given = 0 if shape is None else len(shape) if isinstance(shape, tuple) else 1
        if given not in (0, effect.shape_size):
            raise ModelError(
                f"'{text}': the shape of {name} is {effect.shape_size} numbers, and {given} stand "
                "behind the ':'."
            )
        parts += [Part(family.at(shape, place), place) for place in places.split("+")]
    return Placed(parts, tuple(written))


def _split_shape(text: str) -> tuple[str, float | tuple[float, ...] | None]:
    """Return the places and the shape of ``PLACE+PLACE:SHAPE``; names may have colons too."""
    places, colon, number = text.rpartition(":")
    try:
        numbers = tuple(map(float, number.split(",")))
    except ValueError:
        return text, None
    if not colon:
        return text, None
    return places, numbers if len(numbers) > 1 else numbers[0]
