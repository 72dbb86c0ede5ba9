"""A load at the end of the robot that the robot file does not have.

Where every mass is refitted a payload is part of the last body and cannot be told apart from it;
it matters for the simulation with the file's own values.
"""

from dataclasses import replace

from identifiability.effects.effect import Effect
from identifiability.effects.placed import Part, Placed
from identifiability.effects.registry import declare
from identifiability.effects.rigid_body import RigidBody
from identifiability.foundation.names import Array, Parameter
from identifiability.robot import Motion, Robot
from identifiability.robot.changed import last_bodies


@declare(
    "a payload (or wrong masses of the last body)",
    last_bodies,
    against="position",
    fixed_only=True,
    native=True,
    rank=14,
)
class Payload(Effect):
    """``τ = K_body [m mx my mz Ixx …]``: a load fixed to a last body of the robot.

    In a refit it is the same as that body's own mass and moments, of which it is part in a file.
    """

    name = "payload"
    equation = "τ = K_body [m mx my mz Ixx Ixy Iyy Ixz Iyz Izz]ᵀ"
    source = "[Khalil 2007, Eq. 6]"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the ten inertial parameters of the payload on every last body."""
        return tuple(
            replace(p, kind=f"payload_{p.kind}", group=self.name, nonnegative=False)
            for p in _on_last_bodies(robot).parameters(robot)
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the rigid-body columns of the last bodies."""
        _on_last_bodies(robot).fill(robot, motion, out)


def _on_last_bodies(robot: Robot) -> Placed:
    rigid = RigidBody()
    return Placed([Part(rigid, body) for body in last_bodies(robot)])
