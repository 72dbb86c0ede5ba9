"""Noise on simulated logs."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import scipy

from identifiability.foundation.errors import IdentifiabilityError, near_match
from identifiability.foundation.names import Array
from identifiability.foundation.options import Expected, check_fields
from identifiability.foundation.values import frozen

#: A hundred times the signal is no measurement any more.
LOUDEST = 100.0


def _below(most: float) -> Expected:
    words = f"a number of at least 0 and below {most:g}"
    return Expected(words, lambda value: 0 <= value < most)


Level = Annotated[float, _below(LOUDEST)]


@frozen
class Noise:
    """Measurement noise.

    Attributes
    ----------
    motion : float
        Standard deviation of q, dq and ddq, independently, as a share of each sample's value.
    torque : float
        The same of the torque [Díaz 2010, Eq. 17; 0.04 and 0.05 are the paper's].
    additive : float
        Standard deviation of additive torque noise as a share of each joint's torque rms.
    correlation : float
        AR(1) coefficient of the additive noise from sample to sample.
    encoder : float [rad or m]
        Resolution of the positions; 0 for none.
    motion_additive : float
        Standard deviation of additive noise on q, dq and ddq, from sample to sample, as a share of
        that of each channel and joint. Near reversals it turns signs of velocity, which `motion`
        never does.
    """

    motion: Level = 0.0
    torque: Level = 0.0
    additive: Level = 0.0
    correlation: Annotated[float, _below(1.0)] = 0.0
    encoder: Level = 0.0
    motion_additive: Level = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "noise level")

    @staticmethod
    def parse(text: str) -> Noise:
        """Return the noise of ``paper``, ``none`` or ``motion=0.04,torque=0.05``.

        Raises
        ------
        IdentifiabilityError
        """
        named = {"paper": PAPER_NOISE, "none": Noise()}
        if text in named:
            return named[text]
        known = list(Noise.__dataclass_fields__)
        values = {}
        for part in text.split(","):
            name, _, number = part.partition("=")
            try:
                values[name.strip()] = float(number)
            except ValueError:
                raise IdentifiabilityError(
                    f"The noise '{text}' is not understood{near_match(text, named)} Give 'paper', "
                    "'none', or levels such as 'motion=0.04,torque=0.05'."
                ) from None
            if name.strip() not in known:
                raise IdentifiabilityError(
                    f"There is no noise level '{name.strip()}'{near_match(name.strip(), known)} "
                    f"The levels are {', '.join(known)}."
                )
        return Noise(**values)

    def on_motion(self, values: Array, rng: np.random.Generator) -> Array:
        """Return positions, velocities or accelerations (N, n) with relative and additive noise."""
        out = values * (1 + self.motion * rng.standard_normal(values.shape))
        if self.motion_additive:
            size = self.motion_additive * values.std(0)
            out = out + size * rng.standard_normal(values.shape)
        return out

    def on_torque(self, tau: Array, rng: np.random.Generator, level: Array | None = None) -> Array:
        """Return torques (N, n) with relative and with additive, autocorrelated noise.

        `level` (n,) is what the additive noise is a share of, by default the rms of the torque.
        """
        out = tau * (1 + self.torque * rng.standard_normal(tau.shape))
        if self.additive:
            size = np.sqrt(np.mean(tau**2, 0)) if level is None else level
            out = out + self.additive * size * ar1(tau.shape, self.correlation, rng)
        return out

    def on_encoder(self, q: Array) -> Array:
        """Return positions rounded to the encoder's resolution."""
        return np.round(q / self.encoder) * self.encoder if self.encoder else q


#: The paper's noise: δ = 4 % on the motion, η = 5 % on the forces, per sample.
PAPER_NOISE = Noise(motion=0.04, torque=0.05)


def ar1(shape: tuple[int, ...], correlation: float, rng: np.random.Generator) -> Array:
    """Return stationary AR(1) noise of unit variance along the first axis."""
    white = rng.standard_normal(shape)
    white[1:] *= np.sqrt(1 - correlation**2)
    noise: Array = scipy.signal.lfilter([1.0], [1.0, -correlation], white, axis=0)
    return noise
