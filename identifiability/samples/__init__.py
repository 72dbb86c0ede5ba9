"""From `Log` to `Samples`: derivatives, closed loops, rests and decimation, whole or in parts."""

from identifiability.samples.preparation import Preparation
from identifiability.samples.samples import Samples, prepare_samples

__all__ = ["Preparation", "Samples", "prepare_samples"]
