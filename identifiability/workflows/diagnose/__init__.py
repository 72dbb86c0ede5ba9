"""Find the gap between model and data, name the missing effect, add it, verify.

What to use when: `diagnose` runs all stages. By themselves: a `Problem` has rows, candidates and
noise of a `Setting`, `find_aliases` says what this motion can never name, `Search` looks for the
hypothesis of the largest evidence, `settle` lets unseen motion refute, `find_discrepancies` says
where the residual sits, `measure_false_names` how often a name is given on this motion when nothing
is missing. A study adds its own effect with `identifiability.effects.register`.
"""

from identifiability.workflows.diagnose.false_names import FalseNames, measure_false_names
from identifiability.workflows.diagnose.findings import NamedEffect, Placement
from identifiability.workflows.diagnose.gap import Discrepancy, find_discrepancies
from identifiability.workflows.diagnose.hypothesis import Hypothesis
from identifiability.workflows.diagnose.next_experiment import NextMotion, find_next
from identifiability.workflows.diagnose.problem import Alias, Problem, Setting, find_aliases
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.diagnose.rules import Rules
from identifiability.workflows.diagnose.search import Search
from identifiability.workflows.diagnose.verdict import settle
from identifiability.workflows.diagnose.workflow import BASE_EFFECTS, diagnose

__all__ = [
    "BASE_EFFECTS",
    "Alias",
    "Diagnosis",
    "Discrepancy",
    "FalseNames",
    "Hypothesis",
    "NamedEffect",
    "NextMotion",
    "Placement",
    "Problem",
    "Rules",
    "Search",
    "Setting",
    "diagnose",
    "find_aliases",
    "find_discrepancies",
    "find_next",
    "measure_false_names",
    "settle",
]
