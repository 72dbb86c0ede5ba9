"""What a robot file says, which columns its logs must have, and what is in logs and odd about them.

What to use when: `inspect` before anything is fitted: it needs no logs; with logs it says how they
are read, prepared, and whether robot file, limits and physics contradict them.
"""

from identifiability.workflows.inspect.workflow import Inspection, inspect

__all__ = ["Inspection", "inspect"]
