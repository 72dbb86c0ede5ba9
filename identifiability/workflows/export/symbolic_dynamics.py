"""Torque of a robot in CasADi's symbols, from which code is generated.

A tree of joints by a recursion of Newton and Euler, forces along joints, motors and stated axes,
and the loops of a closed chain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NoReturn

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from identifiability.effects.effect import AlongAxes
from identifiability.effects.nominal import reference_values
from identifiability.effects.registry import FAMILIES
from identifiability.effects.transmission import SMALLEST, LoadDependentFriction
from identifiability.effects.vocabulary import every_parameter
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.robot import Axis, Robot
from identifiability.robot.kinematics import WORLD, Joint, Point, Tree

# Forces along joints, motors and stated axes, in symbols: what effects say of numbers.


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


# A tree of joints in symbols: its frames, torques by a recursion of Newton and Euler, its speeds.
#
# Positions are Pinocchio's, as everywhere else: a ball has a quaternion (x y z w) and turns about
# the axes of its own frame.


#: Entries of constant frames below this are rounding.
ROUNDING: Tolerance = 1e-15


def tree_torque(
    ca: Any, tree: Tree, theta: Mapping[int, Array], gravity: Array, motion: tuple[Any, Any, Any]
) -> Any:
    """Return the torque of every degree of freedom, (nv,), without friction and the like.

    Parameters
    ----------
    ca : module
        CasADi.
    tree : Tree
    theta : mapping
        Index of a joint to the ten inertial parameters of the body behind it.
    gravity : (3,) [m/s²]
    motion : (nq,), (nv,), (nv,) of casadi.SX
        Positions, velocities and accelerations.
    """
    cross, joints = ca.cross, tree.joints
    x, v, a = motion
    still = ca.SX.zeros(3)
    moving: dict[int, tuple[Any, Any, Any]] = {WORLD: (still, still, ca.SX(-gravity))}
    frames: list[tuple[Any, Any]] = []
    for k, joint in enumerate(joints):
        R, p = joint_frame(ca, joint, x)
        frames.append((R, p))
        w, dw, lift = moving[joint.parent]
        lift = R.T @ (lift + cross(dw, p) + cross(w, cross(w, p)))
        w, dw = R.T @ w, R.T @ dw
        (speed, spin), (rate, twist) = (_along(ca, joint, y) for y in (v, a))
        lift = lift + rate + 2 * cross(w, speed) + cross(spin, speed)
        dw = dw + twist + cross(w, spin)
        moving[k] = (w + spin, dw, lift)
    forces, moments = {}, {}
    for k in range(len(joints)):
        w, dw, lift = moving[k]
        ten = theta.get(k, np.zeros(10))
        h, inertia = ca.SX(ten[1:4]), ca.SX(_matrix(ten[4:]))
        forces[k] = float(ten[0]) * lift + cross(dw, h) + cross(w, cross(w, h))
        moments[k] = inertia @ dw + cross(w, inertia @ w) + cross(h, lift)
    torque = ca.SX.zeros(tree.nv)
    for k in reversed(range(len(joints))):
        joint, (R, p) = joints[k], frames[k]
        _collect(ca, joint, forces[k], moments[k], torque)
        if joint.parent != WORLD:
            force = R @ forces[k]
            forces[joint.parent] += force
            moments[joint.parent] += R @ moments[k] + cross(p, force)
    return torque


def _along(ca: Any, joint: Joint, rate: Any) -> tuple[Any, Any]:
    """Return the part of a joint in a velocity or acceleration, linear and angular, (3,) each."""
    still, own = ca.SX.zeros(3), rate[joint.iv : joint.iv + joint.nv]
    if joint.kind == "free":
        return own[:3], own[3:]
    if joint.kind == "ball":
        return still, own
    along = ca.SX(clean(joint.axis)) * own
    return (along, still) if joint.kind == "prismatic" else (still, along)


def _collect(ca: Any, joint: Joint, force: Any, moment: Any, torque: Any) -> None:
    """Write what acts along a joint."""
    at = slice(joint.iv, joint.iv + joint.nv)
    if joint.kind == "free":
        torque[at] = ca.vertcat(force, moment)
    elif joint.kind == "ball":
        torque[at] = moment
    else:
        acts = force if joint.kind == "prismatic" else moment
        torque[at] = ca.dot(ca.SX(clean(joint.axis)), acts)


def joint_frame(ca: Any, joint: Joint, x: Any) -> tuple[Any, Any]:
    """Return rotation and origin of a joint's frame in that of the joint before it."""
    fixed, start = ca.SX(clean(joint.rotation)), ca.SX(clean(joint.translation))
    own = x[joint.iq : joint.iq + joint.nq]
    if joint.kind == "prismatic":
        return fixed, start + fixed @ ca.SX(clean(joint.axis)) * own
    if joint.kind == "revolute":
        axis = clean(joint.axis)
        along = np.outer(axis, axis)
        turn = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        R = ca.SX(along) + ca.cos(own) * ca.SX(np.eye(3) - along) + ca.sin(own) * ca.SX(turn)
        return fixed @ R, start
    if joint.kind == "free":
        start = start + fixed @ own[:3]
    return fixed @ _turned(ca, own[joint.nq - 4 :]), start


def _turned(ca: Any, quat: Any) -> Any:
    """Return the rotation of a unit quaternion (x y z w)."""
    x, y, z, w = (quat[k] for k in range(4))
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def position_rates(ca: Any, tree: Tree, x: Any, v: Any) -> Any:
    """Return how positions change at velocities, (nq,)."""
    parts = []
    for joint in sorted(tree.joints, key=lambda j: j.iq):
        rate = v[joint.iv : joint.iv + joint.nv]
        if joint.nv == 1:
            parts.append(rate)
            continue
        quat, spin = x[joint.iq + joint.nq - 4 : joint.iq + joint.nq], rate[joint.nv - 3 :]
        if joint.kind == "free":
            parts.append(_turned(ca, quat) @ rate[:3])
        parts.append(0.5 * (quat[3] * spin + ca.cross(quat[:3], spin)))
        parts.append(-0.5 * ca.dot(quat[:3], spin))
    return ca.vertcat(*parts)


def world_points(ca: Any, tree: Tree, x: Any, points: list[Point]) -> list[Any]:
    """Return where points are in the world, (3,) each."""
    placed: dict[int, tuple[Any, Any]] = {WORLD: (ca.SX.eye(3), ca.SX.zeros(3))}
    for k in tree.ancestors(p.joint for p in points):
        joint = tree.joints[k]
        R, p = placed[joint.parent]
        turn, shift = joint_frame(ca, joint, x)
        placed[k] = (R @ turn, p + R @ shift)
    return [placed[p.joint][1] + placed[p.joint][0] @ ca.SX(clean(p.position)) for p in points]


def clean(x: Array) -> Array:
    """Return constants without what is but rounding."""
    cleaned: Array = np.where(np.abs(x) < ROUNDING, 0.0, x)
    return cleaned


def _matrix(six: Array) -> Array:
    xx, xy, yy, xz, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


# What code is generated from, in CasADi's symbols: torque, and the loops of a closed chain.
#
# The values of the parameters are numbers in it, so that what is zero costs nothing.


#: What is said without CasADi.
INSTALL = (
    "Code is generated by CasADi, which is not installed: "
    "pip install 'robot-identifiability[codegen]'."
)


def import_casadi() -> Any:
    """Return the package that holds symbols.

    Raises
    ------
    IdentifiabilityError
        If it is not installed, with the line that installs it.
    """
    try:
        import casadi  # noqa: PLC0415 - an extra
    except ImportError:
        raise IdentifiabilityError(INSTALL) from None
    return casadi


def torque_symbols(robot: Robot, values: Mapping[str, float], shapes: Mapping[str, float]) -> Any:
    """Return a CasADi function that gives the torque of the n actuated joints.

    Of a tree it takes their motion, (q, v, a). Of a closed chain it takes the motion of all joints
    of its tree, and the slope (n_dependent, n) of the dependent ones over the actuated ones.

    Parameters
    ----------
    robot : Robot
    values : mapping
        Standard parameters by name.
    shapes : mapping
        Shapes of effects by ``<joint>.<effect>``.

    Raises
    ------
    IdentifiabilityError
        If an effect cannot be generated, or there is no CasADi.
    """
    ca = import_casadi()
    inputs, motion = _motion(ca, robot)

    @cache
    def forces(axis: Axis, effect: str) -> dict[str, Any]:
        shape = shapes.get(f"{axis.name}.{effect}")
        try:
            return forces_along(ca, robot, axis, motion, effect, shape)
        except NoSymbolError:
            return {}

    known = _sort(robot, values, shapes, forces)
    slope = inputs[3] if robot.closed else None
    tree = tree_torque(ca, robot.tree, known.theta, robot.gravity, motion)
    for axis, level in known.levels:
        for dof, share in enumerate(axis_row(robot, axis)):
            tree[dof] += share * level if share else 0.0
    tau = _project(ca, robot, tree, slope)
    if known.loads:
        reference = _bodies(robot, reference_values(robot))
        carried = tree_torque(ca, robot.tree, reference, robot.gravity, motion)
        load = _project(ca, robot, carried, slope)
        for axis, value in known.loads:
            own = ca.SX(axis_row(robot, axis))
            row = _project(ca, robot, own, slope)
            carried = ca.fabs(ca.dot(row, load)) / ca.fmax(ca.dot(row, row), SMALLEST)
            tau += row * (value * carried * ca.sign(ca.dot(own, motion[1])))
    return ca.Function("torque", inputs, [ca.cse(tau)])


def loop_symbols(robot: Robot) -> tuple[Any, Any, Any]:
    """Return CasADi functions of the loops of a closed chain.

    Returns
    -------
    loops : (q) -> errors (m,), Jacobian (m, nv)
    bias : (q, v) -> ``J̇ v`` (m,)
    rates : (q, v) -> how positions change (nq,)
    """
    ca = import_casadi()
    _, (q, v, _) = _motion(ca, robot)
    errors = ca.vertcat(*_loop_errors(ca, robot, q))
    rates = position_rates(ca, robot.tree, q, v)
    J = ca.jacobian(errors, q) @ ca.jacobian(rates, v)
    bias = ca.jtimes(J @ v, q, rates)
    return (
        ca.Function("loops", [q], ca.cse([errors, J])),
        ca.Function("bias", [q, v], [ca.cse(bias)]),
        ca.Function("rates", [q, v], [rates]),
    )


def _motion(ca: Any, robot: Robot) -> tuple[list[Any], tuple[Any, Any, Any]]:
    """Return the inputs of a function, and the motion of all joints by them."""
    if robot.closed:
        sizes = (len(robot.home), robot.nv, robot.nv)
        q, v, a = (ca.SX.sym(name, n) for name, n in zip("qva", sizes, strict=True))
        slope = ca.SX.sym("S", len(robot.dependent), len(robot.actuated))
        return [q, v, a, slope], (q, v, a)
    n = len(robot.joints)
    own = [ca.SX.sym(name, n) for name in "qva"]
    at = np.argsort(robot.actuated).tolist()  # a tree without passive joints has no quaternions
    return own, (own[0][at], own[1][at], own[2][at])


def _project(ca: Any, robot: Robot, tree: Any, slope: Any) -> Any:
    """Return the torque of actuated joints from that of all, by virtual work."""
    tau = tree[robot.actuated.tolist()]
    return tau if slope is None else tau + slope.T @ tree[robot.dependent.tolist()]


def _loop_errors(ca: Any, robot: Robot, q: Any) -> list[Any]:
    """Return the errors of all loop equations."""
    at = {name: q[joint.iq] for name, joint in robot.tree.single.items()}
    ends = [p for loop in robot.loops for p in (loop.first, loop.second)]
    ends += [p for t in robot.cables for s in t.segments for p in (s.first, s.second)]
    points = iter(world_points(ca, robot.tree, q, ends))
    errors: list[Any] = []
    for loop in robot.loops:
        apart = next(points) - next(points)
        if loop.frame is not None:
            frame = loop.frame
            tips = [Point(frame.joint, x) for x in (np.zeros(3), *frame.rotation.T)]
            start, *tips = world_points(ca, robot.tree, q, tips)
            apart = ca.vertcat(*(ca.dot(tip - start, apart) for tip in tips))
        errors += [apart[axis] for axis in loop.axes]
    for coupling in robot.couplings:
        error = at[coupling.joint]
        for term in coupling.terms:
            x = sum((w * at[joint] for joint, w in term.weights.items()), ca.SX(0.0))
            value = ca.SX(0.0)
            for coefficient in reversed(term.polynomial):
                value = value * x + coefficient
            error = error - value
        errors.append(error)
    for cable in robot.cables:
        spans = (
            segment.part * ca.norm_2(next(points) - next(points)) for segment in cable.segments
        )
        errors.append(at[cable.name] - sum(spans))
    return errors


@frozen
class _Sorted:
    """Parameters by what they are about.

    Attributes
    ----------
    theta : mapping
        Joint of the tree to the ten parameters of the body behind it.
    levels : list of (Axis, casadi.SX)
        What acts along an axis.
    loads : list of (Axis, float)
        Friction in proportion to the load of an axis.
    """

    theta: Mapping[int, Array]
    levels: list[tuple[Axis, Any]]
    loads: list[tuple[Axis, float]]


def _sort(
    robot: Robot,
    values: Mapping[str, float],
    shapes: Mapping[str, float],
    forces: Callable[[Axis, str], dict[str, Any]],
) -> _Sorted:
    """Return values by what they are about.

    `forces` gives what acts along an axis per unit of each kind of an effect that has code.

    Raises
    ------
    IdentifiabilityError
        If there is no code for one.
    """
    known = every_parameter(robot, shapes)
    axes = {axis.name: axis for axis in (*robot.axes, *robot.passive_axes)}
    bodies: dict[str, float] = {}
    levels: list[tuple[Axis, Any]] = []
    loads: list[tuple[Axis, float]] = []
    odd = []
    for name, value in values.items():
        owner, _, kind = name.rpartition(".")
        effect = known[name].group if name in known else "no effect"
        if owner in robot.bodies and kind.removeprefix("payload_") in INERTIAL_KINDS:
            whole = f"{owner}.{kind.removeprefix('payload_')}"
            bodies[whole] = bodies.get(whole, 0.0) + value
        elif not value:
            continue
        elif owner in axes and effect == LoadDependentFriction.name:
            loads.append((axes[owner], value))
        else:
            unit = forces(axes[owner], effect) if owner in axes and name in known else {}
            if kind in unit:
                levels.append((axes[owner], value * unit[kind]))
            else:
                odd.append(f"{effect} ({name})")
    if odd:
        raise IdentifiabilityError(
            f"No code can be generated for {listing(odd, 4)}: leave it out of the model, or "
            "predict from the result."
        )
    return _Sorted(_bodies(robot, bodies), levels, loads)


def _bodies(robot: Robot, values: Mapping[str, float]) -> dict[int, Array]:
    """Return the ten parameters of every body by the joint of the tree that it is behind."""
    ends = {joint.iv + joint.nv: k for k, joint in enumerate(robot.tree.joints)}
    out = {}
    for k, body in enumerate(robot.bodies):
        whole = robot.model.joints[k + 1]
        theta = np.array([values.get(f"{body}.{kind}", 0.0) for kind in INERTIAL_KINDS])
        out[ends[whole.idx_v + whole.nv]] = theta
    return out
