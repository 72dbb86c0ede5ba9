"""The robot that the JSON of a result is about."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.robot import Robot


class Entry(BaseModel):
    """Part of a result's JSON, of which other keys are left alone."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class RobotEntry(Entry):
    """What the result is about."""

    name: str
    locked: dict[str, float] = {}

    def check_locked(self, robot: Robot, path: str | Path) -> None:
        """Refuse a robot of which other joints are locked than when the result was made.

        Raises
        ------
        IdentifiabilityError
        """
        if self.locked.keys() == robot.locked.keys():
            return
        was = ", ".join(f"{n} = {at:g}" for n, at in self.locked.items()) or "nothing"
        raise IdentifiabilityError(
            f"{path} was made with {was} locked, and now {listing(robot.locked) or 'nothing'} is; "
            "lock the same joints (--lock, or 'locked' in the sidecar)."
        )
