"""`integrate`: the deflections of springs behind which links move.

A motor is at q, its link at q − δ. Linearised about the measured motion, the links obey

    M δ̈ + (D + C) δ̇ + (P + K) δ = τ,

where τ(q, q̇, q̈) is the torque of the rigid links, and P, D, M are its derivatives by position,
velocity and acceleration [Spong 1987]. K and C are stiffness and damping of the springs. The
equation is integrated along the measured motion. So the deflection is not differentiated, and it
does not drift.
"""

import numpy as np
from scipy.interpolate import CubicSpline

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: Rate of the integration at least [Hz]: the period of a resonance of 40 Hz has 20 steps.
RATE = 800


@frozen
class LinkEquation:
    """Derivatives of the torque of links by the motion of the m joints that bend.

    Attributes
    ----------
    step : float [s]
        Between two of the N samples.
    by_position, by_velocity, by_acceleration : (N, m, m)
        P, D and M.
    """

    step: float
    by_position: Array
    by_velocity: Array
    by_acceleration: Array


@frozen
class Deflection:
    """Deflections of m joints, for S sets of springs or of torques.

    Attributes
    ----------
    position, velocity, acceleration : (N, S, m)
    """

    position: Array
    velocity: Array
    acceleration: Array


def integrate(links: LinkEquation, torque: Array, stiffness: Array, damping: Array) -> Deflection:
    """Return the deflections of springs, by the rule of average acceleration [Newmark 1959].

    It begins at the deflection that the first torques give slowly. Each step is linear, so that
    stretches of steps are computed side by side: first from rest, then from the state in which the
    stretch before it ends.

    Parameters
    ----------
    links : LinkEquation
    torque : (N, S, m) or (N, 1, m) [N·m or N]
    stiffness, damping : (S, m) or (1, m) [N·m/rad or N/m, and per s]
    """
    samples, _, m = torque.shape
    parts = max(1, int(np.ceil(RATE * links.step)))
    h = links.step / parts
    at = np.arange((samples - 1) * parts + 1) / parts

    def refine(x: Array) -> Array:
        if parts > 1:
            return CubicSpline(np.arange(samples), x)(at)
        return x

    P, D, M = map(refine, (links.by_position, links.by_velocity, links.by_acceleration))
    force = refine(torque)
    diagonal = np.eye(m)
    K = stiffness[:, :, None] * diagonal
    C = damping[:, :, None] * diagonal
    steps = Steps(h, P, D, M, K, C, force)
    sets = max(force.shape[1], len(K))

    def balanced(k: int) -> Array:
        loads = np.broadcast_to(force[k], (sets, m))[..., None]
        stiffened = np.broadcast_to(P[k] + K, (sets, m, m))
        return np.linalg.solve(stiffened, loads)[..., 0]

    position, moved = balanced(0), balanced(1)
    begin = [position, (moved - position) / h, np.zeros((sets, m))]
    states = steps.follow(np.concatenate(begin, axis=1))[::parts]
    return Deflection(*(states[..., k * m : (k + 1) * m] for k in range(3)))


@frozen
class Steps:
    """Steps of the rule of average acceleration, for states of position, velocity, acceleration.

    Attributes
    ----------
    h : float [s]
    P, D, M : (T, m, m)
    K, C : (S, m, m) or (1, m, m)
    force : (T, S, m) or (T, 1, m)
    """

    h: float
    P: Array
    D: Array
    M: Array
    K: Array
    C: Array
    force: Array

    def of(self, at: np.ndarray) -> tuple[Array, Array]:
        """Return transitions (B, S, 3m, 3m) to some states, and the parts of force, (B, S, 3m)."""
        h = self.h
        M = self.M[at][:, None]
        damped = self.D[at][:, None] + self.C
        stiffness = self.P[at][:, None] + self.K
        accelerated = (4.0 / h**2) * M
        inverse = np.linalg.inv(stiffness + (2.0 / h) * damped + accelerated)
        of_position = (4.0 / h**2) * M + (2.0 / h) * damped
        of_velocity = (4.0 / h) * M + damped
        own = np.concatenate(
            [of_position, of_velocity, M + 0.0 * damped],
            axis=3,
        )
        position = inverse @ own
        one = np.eye(position.shape[2])
        none = np.zeros_like(one)
        recalled = np.concatenate([(2.0 / h) * one, one, none], axis=1)
        velocity = (2.0 / h) * position - recalled
        weights = [(4.0 / h**2) * one, (4.0 / h) * one, one]
        change = np.concatenate(weights, axis=1)
        acceleration = (4.0 / h**2) * position - change
        added = (inverse @ self.force[at][..., None])[..., 0]
        shares = [added, (2.0 / h) * added, (4.0 / h**2) * added]
        pushed = np.concatenate(shares, axis=2)
        return np.concatenate([position, velocity, acceleration], axis=2), pushed

    def follow(self, first: Array) -> Array:
        """Return the states (T, S, 3m) that follow a first one, (S, 3m)."""
        count = len(self.P) - 1
        length = max(1, int(np.sqrt(count)))
        starts = np.arange(1, count + 1, length)
        # The last stretch may end with repeated steps.
        every = np.minimum(starts[:, None] + np.arange(length), count)
        transitions, pushed = (x[every - 1] for x in self.of(np.arange(1, count + 1)))
        one = transitions.shape[2] == 1
        state = np.zeros((len(starts), *first.shape))
        passed = np.broadcast_to(np.eye(first.shape[1]), transitions[:, 0].shape)
        for k in range(length):
            state = advance(transitions[:, k], state, one) + pushed[:, k]
            passed = transitions[:, k] @ passed
        begins = [first]
        for own, way in zip(state[:-1], passed[:-1], strict=True):
            begins.append(advance(way, begins[-1], one) + own)
        state = np.array(begins)
        out = np.empty((len(starts), length, *first.shape))
        for k in range(length):
            state = advance(transitions[:, k], state, one) + pushed[:, k]
            out[:, k] = state
        rows = out.reshape(-1, *first.shape)[:count]
        return np.concatenate([first[None], rows])


def advance(transition: Array, state: Array, one: bool) -> Array:
    """Return states (…, S, q) after transitions (…, S, q, q), or one that all sets share."""
    if one:
        return state @ transition[..., 0, :, :].swapaxes(-1, -2)
    return (transition @ state[..., None])[..., 0]
