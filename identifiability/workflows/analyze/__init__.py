"""The main workflow: one verdict for each parameter, and the model to use.

What to use when: `analyze` runs all stages and returns an `Analysis`. `workflow` fits and judges
the models and selects one. `belief` samples the posterior of its values. `result` holds the answer.
"""

from .result import Analysis
from .workflow import analyze

__all__ = ["Analysis", "analyze"]
