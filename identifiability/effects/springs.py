"""Springs and torque over position: of joints, of constant force, against gravity, any shape."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from identifiability.foundation.errors import ModelError
from identifiability.foundation.names import OVER_BOTH, Array, Parameter, Strings, name_pair
from identifiability.robot import Axis, Motion, Robot
from identifiability.robot.closure import rest_along

from .effect import POSTURES, RESTS, Along, AlongAxes, Effect, Shaped, Span, counted, every_axis
from .registry import declare

# Springs along joints.


def _springs(robot: Robot) -> bool:
    return any(name.endswith(".K") and value for name, value in robot.nominal.items())


@declare("joint stiffness", against="position", stated=_springs, native=True, told_by=POSTURES)
class JointStiffness(AlongAxes):
    """``τ = K (q − q_rest)``: a spring, a cable or a hose along the joint.

    Its rest position is stated by the robot file, or is the home position; another neutral position
    adds a torque offset. Passive joints have one where the file states it. Over small angles it
    looks like gravity.
    """

    name = "joint_stiffness"
    equation = "τ = K (q − q_rest)"
    source = "[Khalil 2002, Sec. 9.4]"
    units = (("K", "N·m/rad", "N/m"),)
    nonnegative = True
    stated_as = ("stiffness",)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return actuated joints and coupled motors, and the passive joints with a spring."""
        return [*robot.axes, *(a for a in robot.passive_axes if a.name in robot.rest)]

    def curves(self, at: Along) -> list[Array]:
        """Return the distance of the axis from the rest position of its spring."""
        return [at.position - rest_along(at.robot, at.axis)]


# Constant-force springs.


class AlongEveryAxis(AlongAxes):
    """An effect of passive joints, too."""

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return actuated joints and coupled motors, then passive joints."""
        return [*robot.axes, *robot.passive_axes]


@declare(
    "constant force",
    every_axis,
    refuse=lambda robot, place: "there it is a torque offset" if place in robot.joints else "",
    told_by=RESTS,
)
class ConstantForce(AlongEveryAxis):
    """``τ = F₀`` along a joint or a tendon: a constant-force spring, a weight on a rope.

    Along an actuated joint it is a torque offset; along a passive joint, or a motor that mixes
    joints (a tendon), it is a separate force. The mechanism turns it into torques that change with
    its pose.
    """

    name = "constant_force"
    equation = "τ = F₀"
    source = "[Herder 2001, Sec. 2.3]"
    units = (("F0", "N·m", "N"),)

    def curves(self, at: Along) -> list[Array]:
        """Return one everywhere."""
        return [at.ones]


# Springs of either sign, relaxed nobody knows where.


@declare(
    "spring with an unknown rest",
    every_axis,
    against="position",
    told_by=POSTURES,
)
class FreeSpring(AlongEveryAxis):
    """``τ = k (q − q₀) = k q − k q₀``: one spring by two parameters, linear in both.

    Its rest q₀ is the second parameter over the first. An extension spring that passes a dead
    centre pushes on: k may be negative. It is `joint_stiffness` with `torque_offset`, as one.
    """

    name = "free_spring"
    equation = "τ = k q − k q₀"
    source = "[Khalil 2002, Sec. 9.4]"
    units = (("k", "N·m/rad", "N/m"), ("kq0", "N·m", "N"))
    supersedes = ("joint_stiffness", "torque_offset")

    def curves(self, at: Along) -> list[Array]:
        """Return the position as the robot file counts it, and a constant."""
        return [at.position, -at.ones]


# Springs and counterweights whose torque goes with the sine of an angle.


def _hinges(robot: Robot) -> Strings:
    return tuple(a.name for a in (*robot.axes, *robot.passive_axes) if not a.prismatic)


@declare(
    "gravity spring or counterweight",
    _hinges,
    against="position",
    told_by=POSTURES,
)
class GravitySpring(AlongEveryAxis):
    """``τ = k sin(q − q₀) = ks sin q + kc cos q``: a spring that balances gravity about a joint.

    Of a zero-free-length spring between a lever and the frame k is its stiffness times both arms;
    of a counterweight it is m g r. ``k² = ks² + kc²`` and ``tan q₀ = −kc / ks``. It looks like
    gravity where the gravity torque of the joint depends on its angle alone.

    A counterweight that is fixed to a link needs no effect: it is part of that body's mass and
    first moments. One behind a gear, a belt or a rod that turns with a joint is this, and its
    inertia m r² is in the joint's `actuator_inertia`; a weight on a rope is a `constant_force`
    along the tendon or axis that the rope is.
    """

    name = "gravity_spring"
    equation = "τ = k sin(q − q₀) = ks sin q + kc cos q"
    source = "[Herder 2001, Sec. 3.2]"
    units = (("ks", "N·m", "N"), ("kc", "N·m", "N"))

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return the axes that turn: of actuated joints and coupled motors, then passive joints."""
        return [a for a in super().axes(robot) if not a.prismatic]

    def curves(self, at: Along) -> list[Array]:
        """Return sine and cosine of the angle as the robot file counts it."""
        return [np.sin(at.position), np.cos(at.position)]


# Springs and cables over two joints of a chain: between bodies that are no neighbours.


#: Functions of two positions in a potential: of 1, q, q²/2, sin q and cos q the numbers of both.
PRODUCTS = np.array([
    *((0, b) for b in range(1, 5)),
    *((a, 0) for a in range(1, 5)),
    (1, 1), (3, 3), (3, 4), (4, 3), (4, 4),
])  # fmt: skip


def _pairs(robot: Robot) -> dict[str, Strings]:
    """Return pairs of motor joints by name: neighbours in a chain, and those with one between.

    Joints whose name begins or ends with the sign between two names are in no pair.
    """
    names = ((k, j.dofs[0]) for k, j in enumerate(robot.tree.joints))
    usable = [name for name in robot.motor_joints if name == name.strip(OVER_BOTH)]
    driven = {k: name for k, name in names if name in usable}
    out = dict[str, Strings]()
    for k, last in driven.items():
        chain = [driven[at] for at in robot.tree.chain(k) if at in driven]
        out |= {name_pair(first, last): (first, last) for first in chain[-3:-1]}
    return out


@declare(
    "spring over two joints",
    lambda robot: tuple(_pairs(robot)),
    against="position",
    told_by=POSTURES,
    flexible=True,
    pairs=True,
)
class SpringOverTwo(Effect):
    """``τᵢ = ∂U/∂qᵢ, τⱼ = ∂U/∂qⱼ``: a spring, cable or hose that passes over two joints.

    Both torques are slopes of one potential, ``U(qᵢ, qⱼ) = Σ cₖ fₖ(qᵢ) gₖ(qⱼ)``, so they share its
    parameters. It contains a linear spring along a sum of both positions, and a spring without free
    length between two points, ``U = ½ k L²``; it follows others closely. The joints are neighbours
    in a chain, or have one joint between them, and names that do not begin or end with ``~``. Where
    the sum is known, state it as a fixed tendon or as ``[[axes]]``, along which there is
    `joint_stiffness`.
    """

    name = "spring_over_two"
    equation = "τᵢ = ∂U/∂qᵢ, τⱼ = ∂U/∂qⱼ, U = Σ cₖ fₖ(qᵢ) gₖ(qⱼ), f, g ∈ {1, q, q²/2, sin q, cos q}"
    source = "[Herder 2001, Sec. 3.2]"

    kinds = counted("U", len(PRODUCTS))

    def drawn_over(self, robot: Robot, joint: int) -> int:
        """Return the joint itself: the curve is seen along the positions of both."""
        del robot
        return joint

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the factors of a potential for each pair."""
        every = product(_pairs(robot), self.kinds)
        return tuple(Parameter(pair, kind, "N·m", self.name) for pair, kind in every)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the slopes of the potentials along both joints."""
        first, second = PRODUCTS.T
        for k, pair in enumerate(_pairs(robot).values()):
            i, j = map(robot.joints.index, pair)
            q = motion.actuated_q[:, [i, j]].T
            one, sine, cosine = np.ones_like(q), np.sin(q), np.cos(q)
            values = np.array([one, q, 0.5 * q * q, sine, cosine])
            slopes = np.array([0.0 * q, one, q, cosine, -sine])
            columns = slice(k * len(PRODUCTS), (k + 1) * len(PRODUCTS))
            out[:, i, columns] = (slopes[first, 0] * values[second, 1]).T
            out[:, j, columns] = (values[first, 0] * slopes[second, 1]).T


# Torque along a joint of which nothing is known but that it depends on the position.


#: Degree of the pieces.
DEGREE = 3
#: Pieces that are tried over the range that was moved through.
PIECES = (2, 3, 4, 6, 8, 12)
#: Pieces over a joint's whole range where nothing else is said, and at most.
TYPICAL, MOST = 8, 300


def _spacings(span: Span) -> tuple[float, ...]:
    return tuple(span.position_range / k for k in PIECES)


def cubic_piece(away: Array) -> Array:
    """Return a cubic B-spline of even knots so far from its middle, in their distance."""
    wide = np.maximum(2 - away, 0)
    narrow = np.maximum(1 - away, 0)
    return (wide * wide * wide - 4 * narrow * narrow * narrow) / 6


@declare(
    "torque that depends on position",
    shapes=_spacings,
    against="position",
    told_by=POSTURES,
    flexible=True,
)
class PositionTorque(Shaped):
    """``τ = Σ cₖ Bₖ(q)``: cubic B-splines on an even grid along the joint, from home on.

    Cables, hoses, springs over levers, cams: forces without an equation of their own in this
    package. Its shape is the distance of the knots [rad or m], by default an eighth of the joint's
    limits (a circle or two metres about home where there are none). Beyond the limits it keeps the
    value at the end. A diagnosis chooses the distance of knots that best predicts unseen motion. It
    holds neighbours to a straight line as closely as the motion says. Springs and the gravity of a
    joint are among its curves: the model keeps those that it has already.
    """

    name = "position_torque"
    equation = "τ = Σ cₖ Bₖ(q)"
    source = "[de Boor 1978; Eilers & Marx 1996]"
    units = (("B", "N·m", "N"),)

    def kinds(self, robot: Robot, axis: Axis) -> Strings:
        """Return one for every spline, counted from the lower end."""
        first, last = self.grid(robot, axis)
        return counted(self.units[0][0], last - first + DEGREE)

    def reached(self, robot: Robot, span: Span) -> Strings:
        """Return the pieces that a motion gets to; of the others it says nothing."""
        axis = next(a for a in robot.axes if a.name == span.joint)
        ends = np.array([span.low, span.high]) - self.home(robot, axis)
        first = self.grid(robot, axis)[0]
        step = self.shape(robot, axis)
        borders = np.floor(ends / step + [1e-9, -1e-9])
        cells = np.clip(borders.astype(int) - first, 0, None)
        return self.kinds(robot, axis)[cells[0] : cells[1] + DEGREE + 1]

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
        # Range about home of joints without limits [rad, m].
        wide = (np.pi, 1.0)[axis.prismatic]
        if axis.row is None:  # it has passive joints, whose limits are not known
            return -wide, wide
        used = axis.row != 0
        ends = np.sort(robot.limits[used] * axis.row[used, None], axis=1).sum(0)
        travel = ends - self.home(robot, axis)
        low, high = np.where(np.isfinite(travel), travel, [-wide, wide]).tolist()
        return low, high

    def curves(self, at: Along) -> list[Array]:
        """Return the splines."""
        first, last = self.grid(at.robot, at.axis)
        turns = at.travel / self.shape(at.robot, at.axis)
        bounded = np.maximum(turns, first)
        x = np.minimum(bounded, last)
        middles = range(first - DEGREE // 2, last + DEGREE // 2 + 1)
        return [cubic_piece(np.abs(x - middle)) for middle in middles]

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return an eighth of the range of an axis [rad or m]."""
        low, high = self._range(robot, axis)
        return (high - low) / TYPICAL


# Dry friction that is not the same everywhere along a joint.


@declare(
    "friction that depends on the position",
    shapes=_spacings,
    against="position",
    needs="coulomb_friction",
    flexible=True,
    told_by="pass each position in both directions",
)
class PositionFriction(PositionTorque):
    """``τ = Σ cₖ Bₖ(q) sign(q̇)``: misaligned bearings, bent screws, worn teeth.

    The levels are cubic B-splines along the joint, as those of `position_torque`: they add to the
    Coulomb friction of the model, with either sign. Its shape is the distance of the knots [rad or
    m].
    """

    name = "position_friction"
    equation = "τ = Σ cₖ Bₖ(q) sign(q̇)"
    source = "[Bittencourt 2012; de Boor 1978]"
    of_drive = True
    units = (("P", "N·m", "N"),)

    def curves(self, at: Along) -> list[Array]:
        """Return the splines, against the motion."""
        way = at.sign
        return [column * way for column in super().curves(at)]
