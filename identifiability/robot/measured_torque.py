"""`MeasuredTorque`: what the numbers in torque columns are: in what, of which side and sign."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Literal

from identifiability.foundation.values import frozen

#: Where torque is measured: at the joint with all that drives it, behind the gears, or before them.
Side = Literal["joint", "link", "motor"]


@frozen
class MeasuredTorque:
    """From what a log holds to torque at the joints: ``τ = sign · gain · ratio · value``.

    Attributes
    ----------
    side : {"joint", "link", "motor"}
        ``joint``: what drives the joint, rotor inertia and gear friction included, however it was
        measured. ``link``: a sensor behind the gear, which no rotor inertia reaches. ``motor``: at
        the rotor; it is multiplied by the ratio of the gear.
    gain : mapping of str to float
        By joint (or motor); what one unit of the log is: K_t [N·m/A] for currents. One under
        ``""`` is for all joints.
    ratio : mapping of str to float
        Of the gear, by joint; turns of the rotor for one of the joint.
    sign : mapping of str to int
        1 or −1, by joint.
    compensated : bool, tuple of str or None
        Whether torque that holds the weight was taken off, or at which joints: the file's is added
        again. None where nobody said.
    """

    side: Side = "joint"
    gain: Mapping[str, float] = field(default_factory=dict)
    ratio: Mapping[str, float] = field(default_factory=dict)
    sign: Mapping[str, float] = field(default_factory=dict)
    compensated: bool | tuple[str, ...] | None = None

    def is_compensated(self, joint: str) -> bool:
        """Return whether the torque of a joint lacks what holds the weight."""
        said = self.compensated
        return said if isinstance(said, bool) else joint in (said or ())

    def has_gain(self, joint: str) -> bool:
        """Return whether it is known what one unit of the log is at a joint."""
        return joint in self.gain or "" in self.gain

    def has_ratio(self, joint: str) -> bool:
        """Return whether the ratio of a joint's gear is known."""
        return joint in self.ratio or "" in self.ratio

    def factor(self, joint: str) -> float:
        """Return what a log's values are multiplied by [N·m or N per unit of the log]."""
        out = 1.0
        for table in (self.gain, self.ratio, self.sign):
            out *= table.get(joint, table.get("", 1.0))
        return out

    @property
    def text(self) -> str:
        """What was said, in one line; nothing if nothing was."""
        said = [f"side = {self.side}"] if self.side != "joint" else []
        for name in ("gain", "ratio", "sign"):
            pairs = (f"{j or 'all'} = {v:g}" for j, v in getattr(self, name).items())
            said += [f"{name}: {', '.join(pairs)}"] if getattr(self, name) else []
        if self.compensated:
            which = "all" if isinstance(self.compensated, bool) else ", ".join(self.compensated)
            said.append(f"compensated for gravity: {which}")
        return "; ".join(said)
