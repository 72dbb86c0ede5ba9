"""Find the gap between model and data, name the missing effect, add it, verify.

What to use when: `diagnose` runs all stages. By themselves: `gather` builds rows and candidates,
`find_aliases` says what this motion can never name, `find_discrepancies` where the residual sits,
`name_effects` what is missing, `HeldOut` what adding it does to unseen motion,
`measure_false_names` how often a name is given on this motion when nothing is missing. A study
adds its own effect with `identifiability.effects.register`.
"""

from identifiability.workflows.diagnose.false_names import FalseNames, measure_false_names
from identifiability.workflows.diagnose.findings import NamedEffect, Placement
from identifiability.workflows.diagnose.gates import Naming
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.lookalikes import Alias, find_aliases
from identifiability.workflows.diagnose.material import Material, Rules, Setting, gather
from identifiability.workflows.diagnose.naming import name_effects
from identifiability.workflows.diagnose.next_motion import NextMotion, find_next
from identifiability.workflows.diagnose.residual import Discrepancy, find_discrepancies
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.diagnose.workflow import BASE_EFFECTS, diagnose

__all__ = [
    "BASE_EFFECTS",
    "Alias",
    "Diagnosis",
    "Discrepancy",
    "FalseNames",
    "HeldOut",
    "Material",
    "NamedEffect",
    "Naming",
    "NextMotion",
    "Placement",
    "Rules",
    "Setting",
    "diagnose",
    "find_aliases",
    "find_discrepancies",
    "find_next",
    "gather",
    "measure_false_names",
    "name_effects",
]
