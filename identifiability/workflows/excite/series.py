"""`Series`: finite Fourier series that keep the joints' limits by construction.

A candidate is a vector x of 2H + 1 numbers a joint: amplitudes of velocity in shares of the speed
limit, and where in the room that is left the motion is centred. Whatever x is, its series is
scaled down into the limits of position, speed and acceleration, so an optimiser needs no
constraints [Swevers 1997].
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.simulation.motion import Trajectory
from identifiability.workflows.excite.limits import Limits

#: Times a harmonic at which peaks are looked for. A trigonometric polynomial of degree H exceeds
#: its values at M even points by at most 1/cos(πH/M) [Ehlich 1964]: 0.3 % here.
FINENESS = 40
OVERSHOOT = float(1 / np.cos(np.pi / FINENESS))


@frozen
class Series:
    """All finite Fourier series of one period within limits.

    Attributes
    ----------
    limits : Limits
    period : float [s]
    harmonics : int
        H.
    """

    limits: Limits
    period: float
    harmonics: int

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.limits.joints)

    @property
    def size(self) -> int:
        """Numbers a candidate has, ``n (2H + 1)``."""
        return self.joints * (2 * self.harmonics + 1)

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Return random candidates (count, size); every second one fills its limits."""
        x = rng.standard_normal((count, self.size))
        amplitudes = self.joints * 2 * self.harmonics
        level = np.exp(rng.uniform(-2.0, 0.5, count))
        level[::2] = 3.0  # beyond any limit, so scaled down to it
        x[:, :amplitudes] *= level[:, None]
        return x

    def series(self, x: Array) -> tuple[Array, Array]:
        """Return offsets (m, n) and velocity amplitudes (m, n, 2H) of candidates (m, size)."""
        m, n, H = len(x), self.joints, self.harmonics
        limits = self.limits
        amplitude = x[:, : 2 * n * H].reshape(m, n, 2 * H) * limits.speed[:, None] / np.sqrt(H)
        q, v, a = self._motion(np.zeros((m, n)), amplitude, FINENESS * H)
        top, bottom = q.max(1), q.min(1)
        half = 0.5 * OVERSHOOT * (top - bottom)
        used = np.max(
            [
                half / limits.half_range,
                OVERSHOOT * np.abs(v).max(1) / limits.speed,
                OVERSHOOT * np.abs(a).max(1) / limits.acceleration,
            ],
            axis=0,
        )
        scale = 1.0 / np.maximum(used, 1.0)
        room = np.maximum(limits.half_range - scale * half, 0.0)
        centre = limits.middle + np.tanh(x[:, 2 * n * H :]) * room
        return centre - 0.5 * scale * (top + bottom), scale[..., None] * amplitude

    def motion(self, x: Array, samples: int) -> tuple[Array, Array, Array]:
        """Return q, dq, ddq (m, samples, n) of candidates over one period."""
        return self._motion(*self.series(np.atleast_2d(x)), samples)

    def trajectory(self, x: Array, samples: int, name: str) -> Trajectory:
        """Return the trajectory of one candidate."""
        offset, amplitude = (part[0] for part in self.series(x[None]))
        H = self.harmonics
        return Trajectory(
            name, self.period, samples, offset, amplitude[:, :H], amplitude[:, H:]
        )  # fmt: skip

    def _motion(self, offset: Array, amplitude: Array, samples: int) -> tuple[Array, Array, Array]:
        m, n, H = len(offset), self.joints, self.harmonics
        flat = amplitude.reshape(m * n, 2 * H)
        many = Trajectory("", self.period, samples, offset.reshape(-1), flat[:, :H], flat[:, H:])
        q, v, a = (x.reshape(samples, m, n).transpose(1, 0, 2) for x in many.motion(many.times()))
        return q, v, a
