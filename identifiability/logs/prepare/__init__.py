"""From `Log` to `Dataset`: derivatives, closed loops, rests and decimation, whole or in parts."""

from .dataset import Dataset, Samples, prepare_log
from .preparation import Preparation

__all__ = ["Dataset", "Preparation", "Samples", "prepare_log"]
