"""`Stated`: what a robot file states, before sidecar and checks make a `Robot` of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot.loops import Coupling, Loop


@frozen
class Stated:
    """What a robot file states.

    Attributes
    ----------
    model : pinocchio.Model
    loops, couplings : list
        Points of loops are in Pinocchio's numbering of joints, less one.
    actuated : list of str or None
        None where the file names no actuator.
    names : mapping
        The file's names of the joints in each Pinocchio joint, where they are not its own.
    home : (nq,) or None
        None is the zero configuration.
    springs : mapping
        Joint to stiffness [N·m/rad or N/m] and position at which it is relaxed.
    undriven : str
        An actuator that drives no single joint, if there is one.
    """

    model: Any
    loops: list[Loop]
    couplings: list[Coupling]
    actuated: list[str] | None
    names: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    home: Array | None = None
    springs: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    undriven: str = ""
