"""The torque that the library finds: its regressor times the file's values, and its simulator's."""

import numpy as np

from identifiability import simulate
from identifiability.robot import complete_motion
from identifiability.simulation import PrescribedMotion

from .. import roads


def nominal_torque(robot, states):
    """Return the torque (N, n) of the file's own values at states, by the states' joints."""
    order = _order(robot.joints, states.joints)
    t = np.arange(len(states.q), dtype=float)
    given = (x[:, order] for x in (states.q, states.dq, states.ddq))
    motion = complete_motion(robot, t, *given)
    assert len(motion) == len(t), "loops were not closed at every state"
    tau = np.empty_like(states.tau)
    tau[:, order] = roads.nominal_torque(robot, motion)
    return tau


def simulated_torque(robot, states):
    """Return the torque (N, n) in the log of the simulated robot at states, by their joints."""
    order = _order(robot.joints, states.joints)
    # A log has twenty samples at least: the same states four times.
    given = (np.tile(x[:, order], (4, 1)) for x in (states.q, states.dq, states.ddq))
    tau = np.empty_like(states.tau)
    tau[:, order] = simulate(robot, PrescribedMotion(np.arange(4.0 * len(tau)), *given)).tau[
        : len(tau)
    ]
    return tau


def _order(ours, theirs):
    """Return where each of our joints is among the others; a joint without a name by its place."""
    known = [theirs.index(name) for name in ours if name in theirs]
    left = [k for k in range(len(theirs)) if k not in known]
    assert len(ours) == len(theirs), f"{ours} are actuated, the file says {theirs}"
    return [theirs.index(name) if name in theirs else left.pop(0) for name in ours]
