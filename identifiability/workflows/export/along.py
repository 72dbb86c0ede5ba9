"""Forces along joints, motors and stated axes, in symbols: what effects say of numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from identifiability.effects.effect import AlongAxes
from identifiability.effects.registry import FAMILIES
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot

#: NumPy's functions that code can hold, by CasADi's names.
FUNCTIONS = {
    "absolute": "fabs", "add": "plus", "cos": "cos", "divide": "rdivide", "exp": "exp",
    "maximum": "fmax", "minimum": "fmin", "multiply": "times", "sign": "sign", "sin": "sin",
    "sqrt": "sqrt", "square": "sq", "subtract": "minus", "tanh": "tanh",
}  # fmt: skip


class NoSymbolError(Exception):
    """An effect asks for more than functions of the motion along its axis."""


@dataclass(frozen=True, eq=False)
class Symbol(NDArrayOperatorsMixin):
    """An expression of CasADi that NumPy's functions can be taken of, with NumPy's meaning."""

    ca: Any
    of: Any

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Symbol:
        """Return the same function of CasADi."""
        raw = [x.of if isinstance(x, Symbol) else x for x in inputs]
        own: dict[str, Any] = {
            "negative": lambda x: -x,
            "heaviside": self._step,
            "power": self._power,
        }
        name = ufunc.__name__
        if method != "__call__" or options or name not in own | FUNCTIONS:
            raise NoSymbolError(name)
        return Symbol(self.ca, (own.get(name) or getattr(self.ca, FUNCTIONS[name]))(*raw))

    def _step(self, x: Any, at_rest: float) -> Any:
        way = self.ca.sign(x)
        return 0.5 * (way * way + way) + at_rest * (1 - way * way)

    def _power(self, x: Any, exponent: Any) -> Any:
        if not isinstance(exponent, int):
            raise NoSymbolError("power")
        return x**exponent

    def __array__(self, *_: Any, **__: Any) -> NoReturn:
        """Refuse to be a number."""
        raise NoSymbolError("number")


@dataclass(frozen=True)
class Moving:
    """An axis in motion as `effects.Along` has it, in symbols.

    Attributes
    ----------
    robot : Robot
    axis : Axis
    position, speed, acceleration : Symbol
        The position is as the robot file counts it.
    """

    robot: Robot
    axis: Axis
    position: Symbol
    speed: Symbol
    acceleration: Symbol

    @property
    def travel(self) -> Any:
        """Position of the axis from its home."""
        return self.position - float(self.robot.travel(self.axis, self.robot.home[None])[0])

    @property
    def sign(self) -> Any:
        """Sign of its speed."""
        return np.sign(self.speed)

    @property
    def ones(self) -> Any:
        """One at every sample."""
        return Symbol(self.speed.ca, self.speed.ca.SX(1.0))

    @property
    def motion(self) -> NoReturn:
        """Whole motions are no symbols."""
        raise NoSymbolError("motion")


def axis_row(robot: Robot, axis: Axis) -> Array:
    """Return the speed of an axis as a row of those of all joints, (nv,)."""
    row = np.zeros(robot.nv)
    if axis.row is not None:
        row[robot.actuated] = axis.row
    elif axis.weights is None:
        row[axis.dof] = 1.0
    else:
        row[[robot.dof_index(joint) for joint in axis.weights]] = [*axis.weights.values()]
    return row


def forces_along(
    ca: Any,
    robot: Robot,
    axis: Axis,
    motion: tuple[Any, Any, Any],
    name: str,
    shape: float | None,
) -> dict[str, Any]:
    """Return the forces along an axis per unit of each kind of an effect's parameters.

    Parameters
    ----------
    ca : module
    robot : Robot
    axis : Axis
    motion : (nq,), (nv,), (nv,) of casadi.SX
        Positions, velocities and accelerations of all joints.
    name : str
        Of the effect.
    shape : float, optional
        Of the effect, if it has one.

    Raises
    ------
    NoSymbolError
        If the effect is more than a function of the motion along the axis.
    """
    row, (q, v, a) = axis_row(robot, axis), motion
    places = {robot.dof_index(name): joint.iq for name, joint in robot.tree.single.items()}
    position = sum(row[dof] * q[places[dof]] for dof in np.flatnonzero(row).tolist())
    effect = FAMILIES[name].at(shape, axis.name)
    if not isinstance(effect, AlongAxes) or type(effect).fill is not AlongAxes.fill:
        raise NoSymbolError(name)
    speed, acceleration = (ca.dot(ca.SX(row), x) for x in (v, a))
    moving: Any = Moving(robot, axis, *(Symbol(ca, x) for x in (position, speed, acceleration)))
    curves: Any = effect.curves(moving)
    return {k: c.of for k, c in zip(effect.kinds(robot, axis), curves, strict=True)}
