"""The main job: one verdict a parameter, and the model to use.

What to use when: `analyze` does it all and gives an `Analysis`. The method, in the order of the
files: models are fitted and judged, and one is selected (`workflow`); its values are believed
(`belief`); and the answer is told (`result`).
"""

from .result import Analysis
from .workflow import analyze

__all__ = ["Analysis", "analyze"]
