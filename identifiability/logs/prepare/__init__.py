"""From `Log` to `Samples`: derivatives, closed loops, rests and decimation, whole or in parts."""

from identifiability.logs.prepare.preparation import Preparation
from identifiability.logs.prepare.samples import Samples, prepare_samples

__all__ = ["Preparation", "Samples", "prepare_samples"]
