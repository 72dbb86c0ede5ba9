"""Find the gap between model and data, name the missing effect, add it, verify.

What to use when: `diagnose` runs all stages. Stages can be called separately: `look` has rows,
candidates, noise and log odds of a `Problem`. `naming.name_missing` names missing effects, which
unseen motion may refute. `problem.find_discrepancies` describes the residual of each joint. A study
adds an effect with `identifiability.effects.register`.
"""

from .naming import look
from .problem import Problem
from .result import Diagnosis
from .workflow import diagnose

__all__ = ["Diagnosis", "Problem", "diagnose", "look"]
