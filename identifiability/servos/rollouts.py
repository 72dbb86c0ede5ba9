"""`Rollouts`: the numbers of a commanded robot with which its rollouts follow logs most closely."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from identifiability.estimation.rules import RULES
from identifiability.foundation.names import Array, NumberByName
from identifiability.foundation.values import frozen

#: Kinds of numbers of each joint: rotor, viscous and dry friction, offset; play of the gear, limit
#: of the torque and integral gain, where errors ask for them; gains, where they are unknown.
KINDS = ("Ia", "Fv", "Fc", "off", "slide", "play", "limit", "ki", "kv", "kp")


@frozen
class Rollouts:
    """Numbers of a robot with which its rollouts follow logs most closely.

    Attributes
    ----------
    numbers : mapping of str to (n,)
        Rotor inertia ``Ia``, viscous ``Fv`` and dry friction ``Fc``, offset ``off``, and gains
        ``ki``, ``kv`` and ``kp``. Where commands have no speeds an unknown kv is 0, and viscous
        friction holds it. Half the logarithm of each body's size relative to the file, ``sizes``
        (nb,). The offset is 0 where ki is not.
    parameters : mapping of str to float
        Standard parameters by name of joints and bodies.
    delays : (L,) [s]
        Of each log, as each has a clock of its own.
    errors : (n,) [rad or m]
        Of positions (rms), by joint.
    missed : (n,)
        Errors as shares of the explicable motion (`positions.explicable`).
    delay_errors : (L,) [s]
        Standard deviations of the delays; zero where they are known.
    covariance : (3 n, 3 n)
        Of ki, kv and log kp.
    unsure : (p,)
        Standard deviations of the vector of the search.
    blocked : tuple of (N, n) bool
        Rows of each log in which something outside the robot holds a joint.
    search : tuple
        The problem, and where its search ended: vector, positions, weighted derivative.
    own_delays : (n + 1, n + 1)
        What they say of a delay of each joint alone (`weigh_delays`).
    file_servo : Servo or None
        The servos as they are stated, before rollouts changed their numbers.
    """

    numbers: Mapping[str, Array]
    parameters: NumberByName
    delays: Array
    errors: Array
    missed: Array
    delay_errors: Array
    covariance: Array
    unsure: Array
    blocked: tuple[np.ndarray, ...] = ()
    search: tuple[Any, ...] = ()
    own_delays: Array = np.zeros((0, 0))
    file_servo: Any = None


def are_contradicted(missed: Array) -> bool:
    """Whether missed shares (n,) say that the gains are wrong.

    Where half of the joints are followed, errors of the others say nothing about these.
    """
    middle = np.sort(missed)[(len(missed) - 1) // 2]
    return bool(middle > RULES.rollout_contradicted)
