"""`Rules`: limits and scales by which it is judged whether bodies can exist."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits and scales by which it is judged whether bodies can exist.

    Attributes
    ----------
    body_within : float, by hand
        Bodies of the file are within this share where a log has no torque and nobody says
        otherwise.
    body_contradicted : float, level
        Level at which a log contradicts that share.
    mass_far : float, studies/rules.py
        Factor between a mass and that of the robot file, either way, beyond which it is spoken
        of. [÷2 and ×2 change none of 6 answers that reach it]
    left_out : float, studies/rules.py
        Share of the torque from which on what a model leaves out, and bodies need, is spoken
        of. [÷2 and ×2 change none of 7 answers that reach it]
    another_robot : float, by hand
        Times the error of all that was fitted beyond which what a file alone holds is
        another robot, if it is an error that is spoken of.
    """

    body_within: float = 0.2
    body_contradicted: float = 1e-3
    mass_far: float = 3.0
    left_out: float = 1e-3
    another_robot: float = 3.0


RULES = Rules()
