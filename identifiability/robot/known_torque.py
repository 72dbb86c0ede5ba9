"""`KnownTorque`: torque that is known beforehand as a function of a position.

A cable, a counter-spring or a gravity compensation that was measured by itself: a table or a
polynomial along a joint. It is taken off the measured torque before anything else is done with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Literal

import numpy as np
import scipy

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: How a table is read between its points: straight lines, monotone cubics [Fritsch & Carlson 1980]
#: that never overshoot them, or the cubic spline whose second derivative has no steps.
Interpolation = Literal["linear", "monotone", "cubic"]


@frozen
class KnownTorque:
    """Torque along one axis as a function of its position; the motors supply it beside all else.

    Attributes
    ----------
    along : str
        Actuated or passive joint, or motor that mixes joints (then position is ``coupling · q``).
    positions, torques : (k,) [rad or m], [N·m or N]
        The points of a table; empty for a polynomial.
    interpolation : {"linear", "monotone", "cubic"}
        Between the points of the table.
    polynomial : (d,)
        ``c0 + c1 q + c2 q² + …`` [N·m or N, q in rad or m]; empty for a table.
    span : (float, float) [rad or m]
        Where it is known.
    """

    along: str
    positions: Array
    torques: Array
    interpolation: Interpolation
    polynomial: Array
    span: tuple[float, float] = (-np.inf, np.inf)

    @staticmethod
    def of_table(
        along: str, table: Sequence[Sequence[float]], interpolation: Interpolation = "linear"
    ) -> KnownTorque:
        """Return the torque of a table of (position, torque), which is known between its ends."""
        points = np.array(sorted(map(tuple, table)), float)
        x, y = points[:, 0], points[:, 1]
        ends = float(x[0]), float(x[-1])
        return KnownTorque(along, x, y, interpolation, np.empty(0), ends)

    @staticmethod
    def of_polynomial(
        along: str,
        coefficients: Sequence[float],
        span: tuple[float, float] = (-np.inf, np.inf),
    ) -> KnownTorque:
        """Return ``c0 + c1 q + c2 q² + …``, known within `span` [rad or m]."""
        none = np.empty(0)
        return KnownTorque(along, none, none, "linear", np.array(coefficients, float), span)

    @cached_property
    def _curve(self) -> Callable[[Array], Array]:
        x, y = self.positions, self.torques
        if not len(x):
            c = self.polynomial
            return lambda q: np.polynomial.polynomial.polyval(q, c)
        if self.interpolation == "linear":
            return lambda q: np.interp(q, x, y)
        curve = (
            scipy.interpolate.CubicSpline
            if self.interpolation == "cubic"
            else scipy.interpolate.PchipInterpolator
        )
        through: Callable[[Array], Array] = curve(x, y)
        return through

    def __getstate__(self) -> dict[str, object]:
        """Return what is pickled, without the curve that was made of it meanwhile."""
        return {name: value for name, value in vars(self).items() if name != "_curve"}

    def force(self, position: Array) -> Array:
        """Return the torque at some positions (N,) [rad or m], (N,) [N·m or N].

        Raises
        ------
        RobotError
            If one lies where the torque is not known: nothing is extrapolated.
        """
        low, high = self.span
        outside = np.flatnonzero((position < low) | (position > high))
        if len(outside):
            beyond = np.maximum(low - position[outside], position[outside] - high)
            worst = float(position[outside[int(np.argmax(beyond))]])
            raise RobotError(
                f"'{self.along}' is at {worst:.4g} and [[known_torque]] knows its torque only from "
                f"{low:.4g} to {high:.4g}: {len(outside)} of {len(position)} samples lie outside, "
                "and nothing is extrapolated; measure it there too, or leave these samples out."
            )
        found: Array = self._curve(position)
        return found

    @property
    def text(self) -> str:
        """What it is, in a few words."""
        if len(self.positions):
            words = {"linear": "straight lines", "monotone": "monotone cubics"}
            between = words.get(self.interpolation, "a cubic spline")
            return (
                f"along {self.along} by a table of {len(self.positions)} points from "
                f"{self.span[0]:.4g} to {self.span[1]:.4g}, {between} between them"
            )
        within = ""
        if np.isfinite(self.span).any():
            within = f" from {self.span[0]:.4g} to {self.span[1]:.4g}"
        return f"along {self.along} by a polynomial of degree {len(self.polynomial) - 1}{within}"
