"""How motors drive joints: `Transmission`, and the axes along which friction and rotors act."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen


@frozen
class Transmission:
    """Motors that mix joints: ``motor = ratio ∘ (coupling · (q - offset))``.

    Friction and rotor inertia act on the motor side and are stated referred to the output of the
    gear, i.e. along ``coupling · q``.

    Attributes
    ----------
    motors : tuple of str
    coupling : (n, n)
        Rows are motors, columns the actuated joints.
    ratio : (n,)
        Gear ratios between the coupled coordinate and the motor's.
    offset : (n,) [rad or m]
        Joint position at motor position zero.
    """

    motors: tuple[str, ...]
    coupling: Array
    ratio: Array
    offset: Array

    def joint_side(self, q: Array, tau: Array) -> tuple[Array, Array]:
        """Return joint positions and torques from motor positions and torques (N, n)."""
        R = self.ratio[:, None] * self.coupling
        return np.linalg.solve(R, q.T).T + self.offset, tau @ R


@frozen
class Axis:
    """A line along which friction and rotor inertia act: a joint's, or a coupled motor's.

    Attributes
    ----------
    name, symbol : str
    row : (n,) or None
        Its speed is ``row · q̇_actuated``; None for a passive joint (the row then varies).
    dof : int
        Index in ``v`` of the joint (passive axes only, else -1).
    prismatic : bool
    """

    name: str
    symbol: str
    row: Array | None
    dof: int
    prismatic: bool

    @property
    def mixed(self) -> bool:
        """Whether it is the axis of a motor that drives several joints."""
        return self.row is not None and int(np.count_nonzero(self.row)) > 1
