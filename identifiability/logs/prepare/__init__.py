"""From `Log` to `Dataset`: derivatives, closed loops, rests and decimation, whole or in parts."""

from .dataset import Dataset, prepare_log
from .preparation import Preparation

__all__ = ["Dataset", "Preparation", "prepare_log"]
