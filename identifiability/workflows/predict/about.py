"""The robot that the JSON of a result is about."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.robot import Robot


class Entry(BaseModel):
    """Part of a result's JSON, of which other keys are left alone."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class MissingEntry(Entry):
    """A function that is missing beside the model of a result."""

    joint: str
    of: str

    @property
    def text(self) -> str:
        """What it is and where."""
        return f"{self.of} in {self.joint}"


def state_missing(functions: Sequence[str]) -> str:
    """Return what holds of the values of a fit beside which functions are missing, if any are."""
    if not functions:
        return ""
    beside = "that function" if len(functions) == 1 else "those functions"
    return (
        f"The result says that {listing(functions, 4)} {'is' if len(functions) == 1 else 'are'} "
        f"missing in its model. Its fit is taken as it is; the values of its parameters' table "
        f"stand beside {beside} and differ (diagnose finds what is missing)."
    )


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
