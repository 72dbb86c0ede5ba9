"""From `Log` to `Dataset`: derivatives, closed loops, rests and decimation, whole or in parts."""

from identifiability.logs.prepare.dataset import Dataset, prepare_log
from identifiability.logs.prepare.preparation import Preparation

__all__ = ["Dataset", "Preparation", "prepare_log"]
