"""`Rules`: limits by which descriptions of robots are read and their loops are closed."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which descriptions of robots are read and their loops are closed.

    Attributes
    ----------
    home_open : float [m or rad], by hand
        A home position further than this from closing the loops is no rounded one.
    assembly_near : float, calibrated
        Another assembly less than so many times as far from the file's configuration is
        near, too, and any is where the nearest is farther than `leap`. Of 990 drawings of
        five mechanisms, off by up to 0.6 rad in every joint, and of 240 of two, off by up
        to 1 rad, none then gave a wrong assembly.
    leap : float [rad], calibrated
        A dependent coordinate that ends this far from its prediction may have changed
        assembly.
    singular : float, calibrated
        Condition number of A_e above which a configuration is called near-singular; within
        their limits the shipped robots stay below 130.
    leg_stretched : float, by hand
        Singular values of a contact's Jacobian below this share of the largest are none:
        there a leg is stretched so far that forces of its joints tell nothing of the force
        at its foot.
    """

    home_open: float = 1e-2
    assembly_near: float = 2.0
    leap: float = 0.7
    singular: float = 1e3
    leg_stretched: float = 1e-2


RULES = Rules()
