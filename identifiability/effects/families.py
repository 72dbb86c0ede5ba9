"""The families that a diagnosis may name, declared before any data are seen."""

from __future__ import annotations

import numpy as np

from identifiability.effects.actuator import ActuatorInertia, TorqueOffset
from identifiability.effects.delay import TimeDelay
from identifiability.effects.effect import Effect
from identifiability.effects.family import Family, Span, joint_places, register_family
from identifiability.effects.friction import (
    CoulombAsymmetry,
    CoulombFriction,
    PassiveJointFriction,
    ViscousFriction,
)
from identifiability.effects.gravity import GravityTilt, Payload, last_bodies
from identifiability.effects.nominal import gravity_vector, has_masses
from identifiability.effects.nonlinear_friction import (
    LoadDependentFriction,
    QuadraticFriction,
    StribeckFriction,
)
from identifiability.effects.position import JointStiffness, PositionRipple
from identifiability.effects.rigid_body import RigidBody
from identifiability.foundation.names import BASE
from identifiability.robot import Robot

#: Stribeck velocities that are tried, as shares of the joint's rms speed: neighbours are so close
#: that what falls between them leaves less than 1 % of the curve.
STRIBECK_SHARES = tuple(float(x) for x in np.geomspace(0.04, 1.6, 16))

#: Ripple periods that are tried, as periods in the joint's range. Below two it is a spring or
#: gravity; neighbours are in phase to a quarter of a period over the range.
RIPPLES = tuple(float(x) for x in np.arange(2.0, 16.01, 0.5))


def _stribeck_velocities(span: Span) -> tuple[float, ...]:
    return tuple(s * span.rms_speed for s in STRIBECK_SHARES)


def _ripple_periods(span: Span) -> tuple[float, ...]:
    return tuple(span.position_range / k for k in RIPPLES)


def inner_bodies(robot: Robot) -> tuple[str, ...]:
    """Return the bodies that carry others: a wrong last one is a payload."""
    return tuple(b for b in robot.bodies if b not in last_bodies(robot))


def _passive(robot: Robot) -> tuple[str, ...]:
    return tuple(a.name for a in robot.passive_axes)


def _actuated(robot: Robot) -> tuple[str, ...]:
    return robot.joints


def _speed_unit(prismatic: bool) -> str:
    return "m/s" if prismatic else "rad/s"


def _length_unit(prismatic: bool) -> str:
    return "m" if prismatic else "rad"


def _needs_masses(robot: Robot, _place: str) -> str:
    if has_masses(robot):
        return ""
    return f"{robot.path.name} states no masses, so the load is not known"


def _needs_gravity(robot: Robot, place: str) -> str:
    if not np.any(gravity_vector(robot)):
        return "there is no gravity in the robot file"
    return _needs_masses(robot, place)


def _in_motor(robot: Robot, place: str) -> str:
    if place in robot.passive:
        return "a passive joint has no motor"
    return ""


_SHARED: dict[str, Effect] = {
    e.name: e
    for e in (
        ViscousFriction(), CoulombFriction(), CoulombAsymmetry(), ActuatorInertia(),
        TorqueOffset(), PassiveJointFriction(), Payload(), GravityTilt(), RigidBody(),
        LoadDependentFriction(), QuadraticFriction(), JointStiffness(),
    )
}  # fmt: skip


def _plain(name: str) -> Effect:
    return _SHARED[name]


_DELAY = TimeDelay()

for _family in (
    Family(
        "viscous_friction", "viscous friction",
        lambda shape, joint: _plain("viscous_friction"), joint_places, positive=True,
        basic=True,
    ),
    Family(
        "coulomb_friction", "Coulomb friction",
        lambda shape, joint: _plain("coulomb_friction"), joint_places, positive=True,
        basic=True,
    ),
    Family(
        "coulomb_asymmetry", "asymmetric Coulomb friction",
        lambda shape, joint: _plain("coulomb_asymmetry"), _actuated,
        needs="coulomb_friction",
    ),
    Family(
        "actuator_inertia", "actuator inertia",
        lambda shape, joint: _plain("actuator_inertia"), joint_places, positive=True,
        separate=True, basic=True, refuse=_in_motor,
    ),
    Family(
        "torque_offset", "torque offset",
        lambda shape, joint: _plain("torque_offset"), _actuated, basic=True,
        refuse=_in_motor,
    ),
    Family(
        "stribeck_friction", "Stribeck friction",
        StribeckFriction, joint_places, _stribeck_velocities,
        _speed_unit, positive=True, needs="coulomb_friction",
    ),
    Family(
        "passive_joint_friction", "friction in passive joints",
        lambda shape, joint: _plain("passive_joint_friction"), _passive, positive=True,
        separate=True,
    ),
    Family(
        "load_dependent_friction", "load-dependent friction",
        lambda shape, joint: _plain("load_dependent_friction"), joint_places, positive=True,
        needs="coulomb_friction", refuse=_needs_masses,
    ),
    Family(
        "quadratic_friction", "quadratic friction",
        lambda shape, joint: _plain("quadratic_friction"), joint_places, positive=True,
        needs="viscous_friction",
    ),
    Family(
        "joint_stiffness", "joint stiffness",
        lambda shape, joint: _plain("joint_stiffness"), joint_places, positive=True,
    ),
    Family(
        "position_ripple", "position ripple",
        PositionRipple, joint_places, _ripple_periods,
        _length_unit,
    ),
    Family(
        "time_delay", "a delay of the torque", lambda shape, joint: _DELAY, _actuated,
        refuse=_needs_masses,
    ),
    Family(
        "gravity_tilt", "a tilted base", lambda shape, joint: _plain("gravity_tilt"),
        lambda robot: (BASE,), refuse=_needs_gravity,
    ),
    Family(
        "payload", "a payload (or wrong masses of the last body)",
        lambda shape, joint: _plain("payload"), last_bodies, fixed_only=True,
    ),
    Family(
        "rigid_body", "wrong masses", lambda shape, joint: _plain("rigid_body"),
        inner_bodies, fixed_only=True,
    ),
):  # fmt: skip
    register_family(_family)
