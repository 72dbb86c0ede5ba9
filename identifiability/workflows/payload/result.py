"""`Load`: mass, centre and inertia of what hangs on a body, in numbers and words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.foundation.errors import listing
from identifiability.foundation.measured import measured
from identifiability.foundation.names import INERTIAL, Array
from identifiability.foundation.result import Result
from identifiability.foundation.shares import REACH
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.workflows.payload.body import Quantity
from identifiability.workflows.payload.estimate import LoadEstimate

#: Level at which friction is said to be another one than without the load [family-wise].
LEVEL = 0.05

#: What masses are stated by.
GAINS = (
    "Mass and moments are proportional to the torque constants and gear ratios by which the torque "
    "was read: as many percent as these are off, so is every number."
)

#: Torque that the load leaves is spoken of where it is so many times what the result left.
LARGER = 1.5


@frozen(kw_only=True)
class Load(Result):
    """What hangs on a body. Make it with `payload`.

    Attributes
    ----------
    robot : Robot
    body : str
        Which carries it; positions and moments are along the axes of its joint's frame.
    model : str
        Name of the fitted model.
    logs, without : tuple of str
        Logs with the load, and without.
    pairs : tuple of (str, str)
        Those that were compared, of the same motion.
    estimate : LoadEstimate
        What the logs say by themselves.
    parameters : (10,)
        Of the nearest real body, in the order of `INERTIAL`, about the origin of the frame.
    quantities : tuple of Quantity
        Mass, centre, and moments of inertia about it.
    usual : (n,) [N·m or N]
        What the result left of the torque.
    hints : tuple of str
    origin : str
        Name of the file of the result without the load.
    """

    schema: ClassVar[str] = "identifiability/payload/1"

    robot: Robot
    body: str
    model: str
    logs: tuple[str, ...]
    without: tuple[str, ...]
    pairs: tuple[tuple[str, str], ...]
    estimate: LoadEstimate
    parameters: Array
    quantities: tuple[Quantity, ...]
    usual: Array
    hints: tuple[str, ...] = ()
    origin: str = "result.json"

    @property
    def of(self) -> Mapping[str, Quantity]:
        """The quantities by name."""
        return {q.name: q for q in self.quantities}

    @property
    def mass(self) -> Quantity:
        """Of the load [kg]."""
        return self.of["mass"]

    @property
    def answer(self) -> str:
        """Mass and where, in one sentence."""
        mass = self.mass
        if not np.isfinite(mass.half):
            return f"These logs do not tell the mass of what hangs on {self.body}."
        if not mass.told:
            return f"Nothing surely hangs on {self.body}: at most {mass.high:.3g} kg."
        text = f"{measured(mass.value, mass.half, 'kg')} at body {self.body}"
        centre = [self.of[f"centre {axis}"] for axis in "xyz"]
        if all(q.told for q in centre):
            at = ", ".join(measured(q.value, q.half) for q in centre)
            text += f", its centre at ({at}) m in the frame of {self.body}"
        return f"{text} (95 %)."

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        texts = [self.answer, self._moments(), self._untold(), self._agreement(), self.friction]
        texts += [*self.caveats, GAINS if self.mass.told else ""]
        return " ".join(t for t in (*texts, *self.hints) if t)

    def _moments(self) -> str:
        told = [q for q in self.quantities if q.name.startswith("I") and q.told]
        texts = [f"{q.name} {measured(q.value, q.half)}" for q in told]
        return f"Moments about its centre: {listing(texts)} kg·m²." if texts else ""

    def _untold(self) -> str:
        if not (self.mass.told and np.isfinite(self.mass.half)):
            return ""
        by: dict[str, list[str]] = {}
        for q in self.quantities:
            if not q.told:
                by.setdefault(q.why, []).append(q.name)
        texts = [f"{listing(names)} ({why})" for why, names in by.items()]
        return f"Not told: {'; '.join(texts)}." if texts else ""

    def _agreement(self) -> str:
        motions = self.estimate.motions
        if motions is None:
            return "" if self.pairs else "One motion cannot show what another would change."
        rows = self.log_frame().to_dict("records")
        each = listing([f"{r['log']} {measured(r['mass'], r['half'], 'kg')}" for r in rows], 4)
        if motions.agree:
            return f"The logs agree ({each})."
        return f"The logs disagree ({each}): intervals are widened to hold all of them."

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Joints whose friction is surely another one than without the load."""
        level = LEVEL / max(len(self.estimate.rubbing), 1)
        return tuple(joint for joint, p in self.estimate.rubbing.items() if p < level)

    @property
    def friction(self) -> str:
        """What became of friction, in a sentence; empty where it did not change for sure."""
        if not self.rubbing:
            return ""
        many = "differ" if len(self.rubbing) > 1 else "differs"
        return (
            f"Friction of {listing(self.rubbing, 6)} {many} from that without the load, which the "
            "intervals hold."
        )

    @property
    def caveats(self) -> tuple[str, ...]:
        """What makes the answer doubtful, and what to do."""
        ratio = self.estimate.rms / np.maximum(self.usual, 1e-300)
        if len(self.pairs) == len(self.logs) or ratio.max() < LARGER:
            return ()
        k = int(np.argmax(ratio))
        return (
            f"But the torque of {self.robot.joints[k]} is left {ratio[k]:.2g} × as far off as by "
            "the result's own logs: the robot changed since (friction does, with temperature), or "
            "the load is not rigid or hangs elsewhere (--body). Add a log of the same motion "
            "without the load (--without); compare says what changed.",
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a quantity: ``name``, value, interval, unit, whether it is told, why."""
        return pd.DataFrame([asdict(q) for q in self.quantities])

    def log_frame(self) -> pd.DataFrame:
        """Return the mass by each log alone, with half of its interval for noise; none of one."""
        motions = self.estimate.motions
        if motions is None:
            return pd.DataFrame(columns=["log", "mass", "half"])
        at = INERTIAL.index("m")
        names = [self.logs[k] for k in self.estimate.logs]
        return pd.DataFrame(
            {"log": names, "mass": motions.values[:, at], "half": REACH * motions.sd[:, at]}
        )

    @property
    def possible(self) -> bool:
        """Whether the estimate is a real body by itself."""
        return bool(np.allclose(self.parameters, self.estimate.theta, rtol=1e-6, atol=1e-12))

    def to_dict(self) -> dict[str, Any]:
        """Return the load in the documented JSON schema."""
        theta = dict(zip(INERTIAL, self.parameters.tolist(), strict=True))
        alone = dict(zip(INERTIAL, self.estimate.theta.tolist(), strict=True))
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "model": self.model,
            "body": self.body,
            "statement": self.statement,
            "quantities": [asdict(q) for q in self.quantities],
            "parameters": theta,
            "estimate": alone,
            "covariance": self.estimate.covariance.tolist(),
            "order": list(INERTIAL),
            "possible": self.possible,
            "logs": list(self.logs),
            "without": list(self.without),
            "pairs": [list(p) for p in self.pairs],
            "by_log": self.log_frame().to_dict("records"),
            "caveats": list(self.caveats),
            "friction_changed": list(self.rubbing),
        }
