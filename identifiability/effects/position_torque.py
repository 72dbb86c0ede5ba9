"""Torque along a joint of which nothing is known but that it depends on the position."""

import numpy as np

from identifiability.effects.effect import Along, Effect, Shaped
from identifiability.effects.family import POSTURES, Span
from identifiability.effects.registry import declare
from identifiability.foundation.errors import ModelError
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot

#: Degree of the pieces.
DEGREE = 3
#: Pieces that are tried over the range that was moved through.
PIECES = (2, 3, 4, 6, 8, 12)
#: Pieces over a joint's whole range where nothing else is said, and at most.
TYPICAL, MOST = 8, 300
#: Range about home of joints without limits [rad, m].
UNLIMITED = (np.pi, 1.0)


def _spacings(span: Span) -> tuple[float, ...]:
    return tuple(span.position_range / k for k in PIECES)


def reached_pieces(effect: Effect, robot: Robot, span: Span) -> tuple[str, ...]:
    """Return the pieces that a motion gets to; of the others it says nothing."""
    assert isinstance(effect, PositionTorque)
    axis = next(a for a in robot.axes if a.name == span.joint)
    ends = np.array([span.low, span.high]) - effect.home(robot, axis)
    first, step = effect.grid(robot, axis)[0], effect.shape(robot, axis)
    cells = np.clip(np.floor(ends / step + [1e-9, -1e-9]).astype(int) - first, 0, None)
    return effect.kinds(robot, axis)[cells[0] : cells[1] + DEGREE + 1]


def cubic_piece(away: Array) -> Array:
    """Return a cubic B-spline of even knots so far from its middle, in their distance."""
    wide, narrow = np.maximum(2 - away, 0), np.maximum(1 - away, 0)
    piece: Array = (wide * wide * wide - 4 * narrow * narrow * narrow) / 6
    return piece


@declare(
    "torque along the position",
    shapes=_spacings,
    reached=reached_pieces,
    against="position",
    told_by=POSTURES,
    rank=23,
    late=True,
    flexible=True,
)
class PositionTorque(Shaped):
    """``τ = Σ cₖ Bₖ(q)``: cubic B-splines on an even grid along the joint, from home on.

    Cables, hoses, springs over levers, cams: what has no equation of its own here. Its shape is the
    distance of the knots [rad or m], by default an eighth of the joint's limits (a circle or two
    metres about home where there are none). Beyond the limits it goes on as at the end. A
    diagnosis chooses the distance that predicts motion best that was not fitted, and holds
    neighbours to a straight line as closely as the motion says. Springs and the gravity of a joint
    are among its curves: what the model has already stays with the model.
    """

    name = "position_torque"
    equation = "τ = Σ cₖ Bₖ(q)"
    source = "[de Boor 1978; Eilers & Marx 1996]"
    units = (("B", "N·m", "N"),)

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every spline, counted from the lower end."""
        first, last = self.grid(robot, axis)
        letter = self.units[0][0]
        return tuple(f"{letter}{k + 1}" for k in range(last - first + DEGREE))

    def home(self, robot: Robot, axis: Axis) -> float:
        """Return the position of an axis at home, from which knots are counted [rad or m]."""
        return float(robot.travel(axis, robot.home[None])[0])

    def grid(self, robot: Robot, axis: Axis) -> tuple[int, int]:
        """Return the first and the last knot of the range, in distances from home.

        Raises
        ------
        ModelError
            If there were too many.
        """
        low, high = self._range(robot, axis)
        step = self.shape(robot, axis)
        if (high - low) / step > MOST:
            raise ModelError(
                f"{self.name} at '{axis.name}' would have {(high - low) / step:.0f} pieces of "
                f"{step:.3g}; give knots further apart, {MOST} pieces are the most."
            )
        return int(np.floor(low / step + 1e-9)), int(np.ceil(high / step - 1e-9))

    def _range(self, robot: Robot, axis: Axis) -> tuple[float, float]:
        """Return the range of an axis about its home [rad or m]."""
        wide = UNLIMITED[axis.prismatic]
        if axis.row is None:  # it has passive joints, whose limits are not known
            return -wide, wide
        used = axis.row != 0
        ends = np.sort(robot.limits[used] * axis.row[used, None], axis=1).sum(0)
        low, high = ends - self.home(robot, axis)
        return (
            float(low) if np.isfinite(low) else -wide,
            float(high) if np.isfinite(high) else wide,
        )

    def curves(self, at: Along) -> list[Array]:
        """Return the splines."""
        first, last = self.grid(at.robot, at.axis)
        x = np.minimum(np.maximum(at.travel / self.shape(at.robot, at.axis), first), last)
        middles = range(first - DEGREE // 2, last + DEGREE // 2 + 1)
        return [cubic_piece(np.abs(x - middle)) for middle in middles]

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return an eighth of the range of an axis [rad or m]."""
        low, high = self._range(robot, axis)
        return (high - low) / TYPICAL
