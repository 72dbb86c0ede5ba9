"""Find the gap between model and data, name the missing effect, add it, verify.

What to use when: `diagnose` runs all stages. By themselves: `look` has rows, candidates, noise and
log odds of a `Problem`, `naming.name_missing` says what is missing and lets unseen motion take it
out, `problem.find_discrepancies` says where the residual sits. A study adds its own effect with
`identifiability.effects.register`.
"""

from .naming import look
from .problem import Problem
from .result import Diagnosis
from .workflow import diagnose

__all__ = ["Diagnosis", "Problem", "diagnose", "look"]
