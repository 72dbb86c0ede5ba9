"""`Placed`: an effect at chosen joints or bodies only, each with a shape of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects.effect import Along, AlongAxes, Effect
from identifiability.foundation.errors import ModelError, listing
from identifiability.foundation.names import Array, Parameter, find_named, is_pattern
from identifiability.foundation.values import frozen
from identifiability.robot import Axis, Motion, Robot


@frozen
class Part:
    """An effect at a joint, motor or body, or at all whose names fit a pattern.

    Attributes
    ----------
    effect : Effect
        With its shape, if it has one.
    owner : str
        A name, or a pattern such as ``wrist_*``.
    kinds : tuple of str
        Kinds of parameters that are taken; all if empty.
    """

    effect: Effect
    owner: str
    kinds: tuple[str, ...] = ()

    def takes(self, parameter: Parameter) -> bool:
        """Whether a parameter of the effect belongs to the part."""
        here = bool(find_named(self.owner, [parameter.owner]))
        return here and (not self.kinds or parameter.kind in self.kinds)


class Elsewhere(AlongAxes):
    """An effect along axes at which it is not by itself: an offset of a motor that mixes joints.

    Parameters
    ----------
    effect : AlongAxes
    owner : str
        Name or pattern of joints, passive ones too, motors or stated axes.
    """

    def __init__(self, effect: AlongAxes, owner: str) -> None:
        self.effect, self.owner = effect, owner
        self.name, self.equation, self.source = effect.name, effect.equation, effect.source
        self.units, self.nonnegative = effect.units, effect.nonnegative
        self.stated_as = effect.stated_as

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return the axes that are meant."""
        every = (*robot.axes, *robot.passive_axes)
        named = find_named(self.owner, (axis.name for axis in every))
        return [axis for axis in every if axis.name in named]

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return the kinds of parameters that the effect has there."""
        return self.effect.kinds(robot, axis)

    def curves(self, at: Along) -> Sequence[Array]:
        """Return the forces of the effect there."""
        return self.effect.curves(at)


def _find_place(part: Part, robot: Robot) -> Part:
    """Return a part where its effect is, if it can be there at all."""
    effect = part.effect
    if any(part.takes(p) for p in effect.parameters(robot)):
        return part
    if not isinstance(effect, AlongAxes) or type(effect).fill is not AlongAxes.fill:
        return part
    other = Elsewhere(effect, part.owner)
    return Part(other, part.owner, part.kinds) if other.axes(robot) else part


class Placed(Effect):
    """Parts of one family as one effect, so that a model can have it in some joints.

    Example
    -------
    >>> from identifiability.effects.friction import StribeckFriction
    >>> effect = Placed([Part(StribeckFriction(0.02), "slider1")])
    >>> effect.name
    'stribeck_friction'

    Parameters
    ----------
    parts : sequence of Part
        At least one.
    texts : sequence of str, optional
        How a ladder file writes it.
    """

    def __init__(self, parts: Sequence[Part], texts: Sequence[str] = ()) -> None:
        self.parts = tuple(parts)
        self._texts = tuple(texts)
        self.name = self.parts[0].effect.name
        self.equation = self.parts[0].effect.equation
        self.source = self.parts[0].effect.source
        self.supersedes = ()

    @property
    def texts(self) -> tuple[str, ...]:
        """How a ladder file writes the effect."""
        return self._texts or super().texts

    def turn(self, robot: Robot) -> Robot:
        """Return the robot that the effect of its parts is about."""
        return self.parts[0].effect.turn(robot)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the parameters of all parts, part by part.

        Raises
        ------
        ModelError
            If an effect has no parameter at its place.
        """
        return tuple(p for _, taken in self._taken(robot) for p in taken.values())

    def shapes(self, robot: Robot) -> dict[str, float]:
        """Return the shapes of all parts."""
        return {
            name: shape
            for part, taken in self._taken(robot)
            for name, shape in part.effect.shapes(robot).items()
            if name in {f"{p.owner}.{self.name}" for p in taken.values()}
        }

    def _taken(self, robot: Robot) -> list[tuple[Part, dict[int, Parameter]]]:
        """Return each part with its parameters by their column in its effect.

        What parts name, and the patterns before, go before what fits a pattern.
        """
        parts = [_find_place(part, robot) for part in self.parts]
        found = [{p.name for p in self.part_parameters(robot, part)} for part in parts]
        wide = [is_pattern(part.owner) for part in parts]
        gone = {name for own, w in zip(found, wide, strict=True) if not w for name in own}
        out = []
        for part, own, w in zip(parts, found, wide, strict=True):
            left = own - gone if w else own
            gone |= left
            every = part.effect.parameters(robot)
            out.append(
                (part, {k: p for k, p in enumerate(every) if part.takes(p) and p.name in left})
            )
        return out

    def layout(self, robot: Robot) -> list[tuple[Effect, list[int]]]:
        """Return the effect of each part, and which of its columns the part takes."""
        return [(part.effect, list(taken)) for part, taken in self._taken(robot)]

    @staticmethod
    def part_parameters(robot: Robot, part: Part) -> list[Parameter]:
        """Return the parameters of one part."""
        found = [p for p in _find_place(part, robot).effect.parameters(robot) if part.takes(p)]
        if not found:
            owners = dict.fromkeys(p.owner for p in part.effect.parameters(robot))
            raise ModelError(
                f"{part.effect.name} has no parameter at '{part.owner}' of {robot.name}; it acts "
                f"at {listing(owners) or 'none of its joints'}."
            )
        return found

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the columns of all parts; each effect is computed once."""
        start = 0
        waiting: dict[int, list[tuple[int, list[int]]]] = {}
        effects: dict[int, Effect] = {}
        for effect, columns in self.layout(robot):
            effects[id(effect)] = effect
            waiting.setdefault(id(effect), []).append((start, columns))
            start += len(columns)
        for key, effect in effects.items():
            W = np.zeros((len(motion), out.shape[1], len(effect.parameters(robot))))
            effect.fill(robot, motion, W)
            for at, columns in waiting[key]:
                out[:, :, at : at + len(columns)] = W[:, :, columns]
