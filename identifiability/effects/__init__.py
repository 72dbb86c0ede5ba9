"""Effects: the parts that models are made of.

Every name here is public vocabulary: it stands in reports, JSON, ladders and on the command line.
"""

from identifiability.effects import families as _families  # noqa: F401 - registers them
from identifiability.effects.actuator import ActuatorInertia, TorqueOffset
from identifiability.effects.delay import TimeDelay
from identifiability.effects.effect import Effect
from identifiability.effects.family import (
    FAMILIES,
    Family,
    Span,
    find_families,
    forget_family,
    joint_places,
    register_family,
)
from identifiability.effects.friction import (
    CoulombAsymmetry,
    CoulombFriction,
    PassiveJointFriction,
    ViscousFriction,
)
from identifiability.effects.gravity import GravityTilt, Payload
from identifiability.effects.nonlinear_friction import (
    LoadDependentFriction,
    QuadraticFriction,
    StribeckFriction,
)
from identifiability.effects.placed import Part, Placed
from identifiability.effects.position import JointStiffness, PositionRipple
from identifiability.effects.rigid_body import RigidBody
from identifiability.foundation.errors import ModelError, near_match
from identifiability.robot import Robot

EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        RigidBody(),
        ViscousFriction(),
        CoulombFriction(),
        CoulombAsymmetry(),
        ActuatorInertia(),
        TorqueOffset(),
        PassiveJointFriction(),
        StribeckFriction(),
        LoadDependentFriction(),
        QuadraticFriction(),
        JointStiffness(),
        Payload(),
        GravityTilt(),
        PositionRipple(),
        TimeDelay(),
    )
}


def find_effect(name: str) -> Effect:
    """Return the effect of a public name.

    Raises
    ------
    ModelError
        If there is none, with the near match.
    """
    try:
        return EFFECTS[name]
    except KeyError:
        raise ModelError(
            f"There is no effect '{name}'{near_match(name, EFFECTS)} "
            f"The effects are {', '.join(EFFECTS)}."
        ) from None


def stated_effects(robot: Robot) -> tuple[str, ...]:
    """Return what default models have beyond their own effects: springs that the file states."""
    springs = any(name.endswith(".K") and value for name, value in robot.nominal.items())
    return ("joint_stiffness",) if springs else ()


__all__ = [
    "EFFECTS",
    "FAMILIES",
    "Effect",
    "Family",
    "Part",
    "Placed",
    "Span",
    "find_effect",
    "find_families",
    "forget_family",
    "joint_places",
    "register_family",
    "stated_effects",
]
