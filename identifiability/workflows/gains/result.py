"""`Gain` and `Gains`: what `identify_gains` returns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from identifiability.foundation.errors import listing
from identifiability.foundation.output import write_json
from identifiability.foundation.result import shown
from identifiability.foundation.values import frozen


@frozen
class Gain:
    """What one unit of a joint's torque column is.

    Attributes
    ----------
    joint : str
    value : float [N·m or N per unit]
        NaN where nothing can be told.
    interval : (float, float)
        95 %; infinite where zero is among what the column may be per N·m.
    sigma_percent : float
        Standard deviation of one over the gain, in percent of it.
    verdict : str
        ``identifiable``, ``weak`` (its sign is certain) or ``not identifiable``.
    load : float [N·m or N]
        Root mean square of the load's torque that nothing else explains.
    """

    joint: str
    value: float
    interval: tuple[float, float]
    sigma_percent: float
    verdict: str
    load: float


@frozen
class Gains:
    """The gains of all joints. Make them with `identify_gains`.

    Attributes
    ----------
    robot : str
    body : str
        Which the load is fixed to.
    mass : float [kg]
    gains : tuple of Gain
    hints : tuple of str
        On how logs were read, and what is odd about them.
    """

    robot: str
    body: str
    mass: float
    gains: tuple[Gain, ...]
    hints: tuple[str, ...] = ()

    @property
    def known(self) -> dict[str, float]:
        """The gains that are identifiable [N·m or N per unit], by joint."""
        return {g.joint: g.value for g in self.gains if g.verdict == "identifiable"}

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        found = [
            f"{g.joint} {g.value:.4g} ({g.interval[0]:.4g} … {g.interval[1]:.4g})"
            for g in self.gains
            if g.joint in self.known
        ]
        others = [g.joint for g in self.gains if g.joint not in self.known]
        text = (
            f"One unit of the torque columns is, in N·m (N for slides), with 95 % intervals: "
            f"{listing(found, 12)}."
            if found
            else "The logs do not tell what one unit of any torque column is."
        )
        if others:
            text += (
                f" Of {listing(others, 12)} they do not tell it: move these joints where the load "
                "is heavy for them, faster, or take a heavier load."
            )
        return text

    @property
    def sidecar(self) -> str:
        """Lines for the robot's sidecar; nothing if no gain is identifiable."""
        pairs = ", ".join(f'"{j}" = {g:.6g}' for j, g in self.known.items())
        return f"[torque]\ngain = {{{pairs}}}\n" if pairs else ""

    def to_frame(self) -> pd.DataFrame:
        """Return one row a joint."""
        columns = {
            "joint": [g.joint for g in self.gains],
            "gain": [g.value for g in self.gains],
            "low": [g.interval[0] for g in self.gains],
            "high": [g.interval[1] for g in self.gains],
            "sigma_percent": [g.sigma_percent for g in self.gains],
            "verdict": [g.verdict for g in self.gains],
            "load": [g.load for g in self.gains],
        }
        return pd.DataFrame(columns)

    def to_dict(self) -> dict[str, Any]:
        """Return the gains in a JSON schema of their own."""
        return {
            "schema": "identifiability/gains/1",
            "robot": self.robot,
            "body": self.body,
            "mass": self.mass,
            "gains": self.to_frame().to_dict("records"),
            "statement": self.statement,
            "hints": list(self.hints),
        }

    def _repr_html_(self) -> str:
        return shown(self.statement, self.to_frame(), "to_frame()")

    def to_json(self, path: str | Path) -> Path:
        """Write them as JSON, whole or not at all."""
        return write_json(path, self.to_dict())
