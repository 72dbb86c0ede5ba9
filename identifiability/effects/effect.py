"""`Effect`: a block of named columns of the regressor as a function of the motion.

To add an effect: one subclass with its name, its parameters and its columns, registered in
`identifiability.effects`; nothing else changes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np

from identifiability.foundation.names import Array, Parameter
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


class Effect(ABC):
    """A part of a model: torque that is linear in its parameters.

    Every effect answers three questions: what it is called, which parameters it has for a robot,
    and what their columns are along a motion. Models are sums of effects.
    """

    #: Public name, used in reports, JSON, TOML and on the command line.
    name: str
    #: The equation in words of the literature, for reports.
    equation: str
    #: Effects whose columns these already contain; a model drops them.
    supersedes: tuple[str, ...] = ()

    @property
    def texts(self) -> tuple[str, ...]:
        """How a ladder file writes the effect."""
        return (self.name,)

    def shapes(self, robot: Robot) -> Mapping[str, float]:
        """Return the shapes behind the columns, by ``<joint>.<effect>``; none for most effects."""
        del robot
        return {}

    @abstractmethod
    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the parameters that the columns multiply."""

    @abstractmethod
    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the columns into `out` (N, n, p), which holds zeros.

        ``out[k] @ phi`` is the torque of the n actuated joints at sample k [N·m or N].
        """


def axis_motion(robot: Robot, motion: Motion, axis: Axis) -> tuple[Array, Array, Array]:
    """Return speed (N,), acceleration (N,) and torque row (N, n) or (n,) of an axis.

    A force f along the axis loads the actuated joints by ``row · f`` (virtual work).
    """
    if axis.row is not None:
        return motion.actuated_v @ axis.row, motion.actuated_a @ axis.row, axis.row
    at = int(np.flatnonzero(robot.dependent == axis.dof)[0])
    assert motion.X is not None
    return motion.v[:, axis.dof], motion.a[:, axis.dof], -motion.X[:, at, :]


def put(out: Array, column: int, row: Array, force: Array) -> None:
    """Write the column of a force (N,) along an axis with torque row (n,) or (N, n)."""
    if row.ndim == 2:
        out[:, :, column] = row * force[:, None]
        return
    for joint in np.flatnonzero(row):
        out[:, joint, column] = row[joint] * force
