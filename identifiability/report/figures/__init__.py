"""Figures as functions of arrays and labels; each returns a Matplotlib `Figure`.

What to use when: `parameters` for how well parameters are known, `belief` for what posteriors add,
`ladder` to compare models, `torque` for measured against predicted, `residuals` for what is left,
`rank` for what the motion excites.
"""

from identifiability.report.figures.belief import (
    draw_contraction,
    draw_forest,
    draw_margins,
    draw_pair,
)
from identifiability.report.figures.ladder import draw_conditions, draw_errors, draw_sizes
from identifiability.report.figures.parameters import draw_precision, draw_pulls
from identifiability.report.figures.rank import draw_spectrum
from identifiability.report.figures.residuals import (
    draw_autocorrelation,
    draw_histogram,
    draw_residual_velocity,
)
from identifiability.report.figures.torque import draw_torque

__all__ = [
    "draw_autocorrelation",
    "draw_conditions",
    "draw_contraction",
    "draw_errors",
    "draw_forest",
    "draw_histogram",
    "draw_margins",
    "draw_pair",
    "draw_precision",
    "draw_pulls",
    "draw_residual_velocity",
    "draw_sizes",
    "draw_spectrum",
    "draw_torque",
]
