"""`MeasuredTorque`: what torque columns are in; `KnownTorque`: what is known beforehand.

Torque columns are in a unit, of a side and sign; known torque is a function of a position.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from identifiability.foundation.documents import Span, key
from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

# `MeasuredTorque`: what the numbers in torque columns are: in what, of which side and sign.


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

    def with_gains(self) -> MeasuredTorque:
        """Return the same with 1 for each gain and ratio that is not known, in the log's unit."""
        return replace(self, gain={"": 1.0, **self.gain}, ratio={"": 1.0, **self.ratio})

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


# `KnownTorque`: torque that is known beforehand as a function of a position.
#
# A cable, a counter-spring or a gravity compensation that was measured by itself: a table or a
# polynomial along a joint. It is taken off the measured torque before anything else is done with
# it.


#: Coefficients of a polynomial.
DEGREE = 50
Polynomial = Annotated[list[float], Field(max_length=DEGREE)]


class KnownTorque(BaseModel):
    """Torque that is supplied beside the motor's, and taken off the measured one."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    along: str = key("A joint, passive or not, or a coupled motor.")
    table: list[tuple[float, float]] = key(
        "Points (position [rad or m], torque [N·m or N]) with lines between.", [], [[0, 0], [1, -3]]
    )
    polynomial: Polynomial = key("In place of a table: c0 + c1 q + …", [])
    range: Span | None = key("Positions between which the polynomial holds.", None)

    @model_validator(mode="after")
    def _one_of_both(self) -> KnownTorque:
        if bool(self.table) == bool(self.polynomial):
            raise ValueError("give either a table or a polynomial")
        if self.table:
            if len({position for position, _ in self.table}) < max(len(self.table), 2):
                raise ValueError("a table needs two points or more, each at another position")
            if self.range is not None:
                raise ValueError("a table ends where its points end; leave out the range")
        return self

    @property
    def span(self) -> tuple[float, float]:
        """Where it is known [rad or m]."""
        if self.table:
            return min(self.table)[0], max(self.table)[0]
        return self.range or (-np.inf, np.inf)

    def force(self, position: Array) -> Array:
        """Return the torque at some positions (N,) [rad or m], (N,) [N·m or N].

        Raises
        ------
        RobotError
            If one lies where the torque is not known: nothing is extrapolated.
        """
        low, high = self.span
        outside = np.flatnonzero((position < low) | (position > high))
        if len(outside):
            beyond = np.maximum(low - position[outside], position[outside] - high)
            worst = float(position[outside[int(np.argmax(beyond))]])
            raise RobotError(
                f"'{self.along}' is at {worst:.4g} and [[known_torque]] knows its torque only from "
                f"{low:.4g} to {high:.4g}: {len(outside)} of {len(position)} samples lie outside, "
                "and nothing is extrapolated; measure it there too, or leave these samples out."
            )
        if self.table:
            return np.asarray(np.interp(position, *np.array(sorted(self.table)).T))
        found: Array = np.polynomial.polynomial.polyval(position, self.polynomial)
        return found

    @property
    def text(self) -> str:
        """What it is, in a few words."""
        if self.table:
            return (
                f"along {self.along} by a table of {len(self.table)} points from "
                f"{self.span[0]:.4g} to {self.span[1]:.4g}, straight lines between them"
            )
        within = ""
        if np.isfinite(self.span).any():
            within = f" from {self.span[0]:.4g} to {self.span[1]:.4g}"
        return f"along {self.along} by a polynomial of degree {len(self.polynomial) - 1}{within}"
