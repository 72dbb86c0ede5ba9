"""From `Log` to `Samples`: derivatives, closed loops, rests and decimation, whole or in parts."""

from identifiability.logs.prepare.longsamples import prepare_samples
from identifiability.logs.prepare.preparation import Preparation
from identifiability.logs.prepare.samples import Samples

__all__ = ["Preparation", "Samples", "prepare_samples"]
