"""`DEFAULTS`: the default numbers of options, which functions and help read here."""

from .values import frozen


@frozen
class Defaults:
    """Defaults of options; importing them costs nothing, so that help can state them.

    Attributes
    ----------
    refits, refits_quick : int
        Refits of the block bootstrap of an analysis.
    resampled, resampled_quick : int
        Resampled logs of the bootstrap of a pruning.
    repetitions, repetitions_quick : int
        Simulated repetitions of a calibration.
    evaluations : int
        Motions that a search compares after its random ones.
    harmonics : int
        Harmonics of the Fourier series of a motion.
    period : float [s]
        Period of a motion.
    samples : int
        Samples in a period of a motion.
    rate : float [Hz]
        Samples a second of a motion that a controller plays.
    draws, draws_quick : int
        Draws of the noise for every case of a study.
    """

    refits: int = 1000
    refits_quick: int = 200
    resampled: int = 200
    resampled_quick: int = 20
    repetitions: int = 240
    repetitions_quick: int = 28
    evaluations: int = 11_000
    harmonics: int = 5
    period: float = 7.5
    samples: int = 750
    rate: float = 500.0
    draws: int = 40
    draws_quick: int = 4


DEFAULTS = Defaults()
