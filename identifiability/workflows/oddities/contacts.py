"""Contacts of a robot that floats: do those that are said to be closed stand?"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.logs.prepare import Samples
from identifiability.robot.floating import slip_shares
from identifiability.workflows.oddities.check import Does, check
from identifiability.workflows.oddities.measured_logs import MeasuredLogs

#: A closed contact that moves at this share of how fast it does while open does not stand, and at
#: how many samples that is looked at.
SLIPS, LOOKED = 1 / 3, 5000


@check("closed contacts that move", Does.HINTS, 57, always=True)
def find_slips(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return which contacts move while they are said to be closed; nothing if none does."""
    robot = logs.robot
    if robot.base is None:
        return ()
    shares = np.zeros(len(robot.base.contacts))
    for s in logs.samples:
        if isinstance(s, Samples) and s.motion.touch is not None:
            some = s.motion[:: max(1, len(s.motion) // LOOKED)]
            assert some.touch is not None
            found = slip_shares(robot.tree, robot.base, some.q, some.v, some.touch)
            shares = np.fmax(shares, found)
    moving = [c.name for c, x in zip(robot.base.contacts, shares, strict=True) if x > SLIPS]
    if not moving:
        return ()
    return (
        f"{listing(moving, 4)} {'moves' if len(moving) == 1 else 'move'} against the other closed "
        f"contacts, at up to {100 * shares.max():.2g} % of how fast they do while open: flags, "
        "schedule or frames are wrong, and forces that they hide may be no contact's.",
    )
