"""A simulator that shares nothing with the project: Newton–Euler in link frames, and dry friction.

Recursion in link frames [Luh, Walker & Paul 1980] on many states side by side. Friction sticks: its
torque within a level that falls with speed holds a joint still, by projected Gauss–Seidel on the
velocities behind each step. Torque noise is autoregressive.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from identifiability.foundation.names import Array

#: Step [s], and sweeps over joints in which stick and slip are settled.
STEP, SWEEPS = 1e-3, 8

#: Gravity [m/s²].
GRAVITY = 9.81


@dataclass(frozen=True)
class Arm:
    """A chain of revolute joints.

    Attributes
    ----------
    axes, offsets : (n, 3)
        Axis of each joint, and its origin in the frame before [m].
    inertial : (n, 10)
        m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the origin of the link frame.
    rotor, viscous, dry : (n,)
    static : (n,)
        Level of dry friction at rest over that of sliding.
    stribeck : float [rad/s]
        Speed over which the level falls.
    """

    axes: Array
    offsets: Array
    inertial: Array
    rotor: Array
    viscous: Array
    dry: Array
    static: Array = field(default_factory=lambda: np.ones(0))
    stribeck: float = 0.05

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.axes)

    def torque(self, q: Array, v: Array, a: Array, gravity: float = GRAVITY) -> Array:
        """Return the torque (S, n) of rigid bodies and rotors at S states."""
        turns, rates = [], []
        w, dw = np.zeros((2, len(q), 3))
        acc = np.tile([0.0, 0.0, gravity], (len(q), 1))
        for k in range(self.n):
            R = _rotate(self.axes[k], q[:, k])
            p = self.offsets[k]
            acc = acc + np.cross(dw, p) + np.cross(w, np.cross(w, p))
            acc, w, dw = (np.einsum("sji,sj->si", R, x) for x in (acc, w, dw))
            spin = self.axes[k] * v[:, k, None]
            dw = dw + np.cross(w, spin) + self.axes[k] * a[:, k, None]
            w = w + spin
            turns.append(R)
            rates.append((w, dw, acc))
        tau = self.rotor * a
        force, moment = np.zeros((2, len(q), 3))
        for k in reversed(range(self.n)):
            w, dw, acc = rates[k]
            m, c, tensor = self.inertial[k, 0], self.inertial[k, 1:4], _tensor(self.inertial[k])
            push = m * acc + np.cross(dw, c) + np.cross(w, np.cross(w, c))
            turn = dw @ tensor + np.cross(w, w @ tensor) + np.cross(c, acc)
            force, moment = force + push, moment + turn
            tau[:, k] += moment @ self.axes[k]
            force, moment = (np.einsum("sij,sj->si", turns[k], x) for x in (force, moment))
            moment = moment + np.cross(self.offsets[k], force)
        return tau

    def mass_matrix(self, q: Array) -> tuple[Array, Array]:
        """Return M (S, n, n) and the torque of gravity alone, (S, n)."""
        size, n = len(q), self.n
        states, units = np.repeat(q, n, 0), np.tile(np.eye(n), (size, 1))
        columns = self.torque(states, np.zeros_like(states), units, 0.0)
        return columns.reshape(size, n, n), self.torque(q, 0 * q, 0 * q)

    def level(self, v: Array) -> Array:
        """Return the level of dry friction at velocities."""
        static = self.static if len(self.static) else np.ones(self.n)
        return self.dry * (1 + (static - 1) * np.exp(-((v / self.stribeck) ** 2)))


def _rotate(axis: Array, angle: Array) -> Array:
    """Return rotations (S, 3, 3) about an axis."""
    K = np.cross(np.eye(3), axis)
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)


def _tensor(inertial: Array) -> Array:
    """Return the inertia tensor of a row of `Arm.inertial`."""
    xx, xy, yy, xz, yz, zz = inertial[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def simulate(arm: Arm, wanted: Array, kp: Array, kv: Array, *, drive: bool) -> tuple[Array, Array]:
    """Return positions and motor torque (L, N, n) of L runs under PD control.

    Parameters
    ----------
    wanted : (L, N, n) [rad]
        Commands at each step.
    kp, kv : (n,)
    drive : bool
        Whether the controller also feeds gravity and the wanted speed forward.
    """
    runs, steps, n = wanted.shape
    speed = np.gradient(wanted, STEP, axis=1) if drive else np.zeros_like(wanted)
    q, v = wanted[:, 0].copy(), np.zeros((runs, n))
    held = np.zeros((runs, n))
    path, tau = np.zeros((2, runs, steps, n))
    for k in range(steps):
        M, weight = arm.mass_matrix(q)
        motor = kp * (wanted[:, k] - q) + kv * (speed[:, k] - v) + drive * weight
        path[:, k], tau[:, k] = q, motor
        bias = arm.torque(q, v, np.zeros_like(q))
        A = np.linalg.inv(M)
        free = v + STEP * np.einsum("lij,lj->li", A, motor - bias - arm.viscous * v)
        level = arm.level(v)
        for _ in range(SWEEPS):
            for j in range(n):
                after = free[:, j] + STEP * (A[:, j] * held).sum(1)
                limit = level[:, j]
                held[:, j] = np.clip(held[:, j] - after / (STEP * A[:, j, j]), -limit, limit)
        v = free + STEP * np.einsum("lij,lj->li", A, held)
        q = q + STEP * v
    return path, tau


def slow_noise(rng: np.random.Generator, shape: tuple[int, int], memory: float) -> Array:
    """Return autoregressive noise (N, n) of unit variance."""
    white = rng.standard_normal(shape)
    white[1:] *= np.sqrt(1 - memory**2)
    noise: Array = lfilter([1.0], [1.0, -memory], white, axis=0)
    return noise
