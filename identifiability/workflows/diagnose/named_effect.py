"""`NamedEffect`: an effect that was found missing, where it is, and what it was learned to be."""

from __future__ import annotations

from functools import cached_property

from identifiability.effects import title_of
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.confusable import Rival
from identifiability.workflows.diagnose.stress import Survival


@frozen
class Placement:
    """A named effect at one place.

    Attributes
    ----------
    place : str
    shape : float
        nan for families without one.
    p_value : float
        Family-wise, at the step that named it.
    parameters, units : tuple of str
    values, errors : (k,)
        Generalised least squares, with standard errors.
    rms : float [N·m or N]
        Of the torque that it adds at the joint where it is largest.
    rivals : tuple of Rival
    stress : tuple of Survival
    """

    place: str
    shape: float
    p_value: float
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    errors: Array
    rms: float
    rivals: tuple[Rival, ...]
    stress: tuple[Survival, ...]

    @property
    def fragile(self) -> tuple[str, ...]:
        """Variations of the motion that the effect does not survive."""
        return tuple(s.variation for s in self.stress if not s.survived)


@frozen
class Curve:
    """What an effect was learned to be, along the fitted motion.

    Attributes
    ----------
    title : str
    joint : int
        Actuated joint where it is largest.
    against : {"velocity", "position", "load", "time"}
    x, learned, spread, data : (N,)
        Motion, torque of the effect, its standard error, and the residual without the effect.
    """

    title: str
    joint: int
    against: str
    x: Array
    learned: Array
    spread: Array
    data: Array


@frozen
class NamedEffect:
    """An effect that was found missing and added.

    Attributes
    ----------
    name, title : str
    placements : tuple of Placement
    before, after : float
        Held-out ε_RA of the model without and with it.
    interval : (float, float)
        95 % of the change.
    real : (float, float)
        The same errors where every fit is a real robot; nan where the model has no bodies or
        keeps its values.
    """

    name: str
    title: str
    placements: tuple[Placement, ...]
    before: float
    after: float
    interval: tuple[float, float]
    real: tuple[float, float] = (float("nan"), float("nan"))

    @property
    def confirmed(self) -> bool:
        """Whether the motion that verifies surely has less error with it."""
        return self.interval[1] < 0

    @property
    def refuted(self) -> bool:
        """Whether the motion that verifies surely has more error with it."""
        return self.interval[0] > 0

    @property
    def joints(self) -> tuple[str, ...]:
        """Where it is."""
        return tuple(dict.fromkeys(p.place for p in self.placements))

    @property
    def p_value(self) -> float:
        """The largest over its places."""
        return max(p.p_value for p in self.placements)

    @cached_property
    def similar(self) -> dict[str, float]:
        """Largest similarity of each other family at any of its places, most similar first."""
        out: dict[str, float] = {}
        for p in self.placements:
            for r in p.rivals:
                if r.family != self.name:
                    out[r.family] = max(out.get(r.family, 0.0), r.similarity)
        return dict(sorted(out.items(), key=lambda x: -x[1]))

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Families that neither motion nor data tell from this one: the name is "A or B"."""
        found = [r.family for p in self.placements for r in p.rivals
                 if r.undecided and r.family != self.name]  # fmt: skip
        return tuple(dict.fromkeys(found))

    @property
    def names(self) -> str:
        """The name, with its alternatives, in words."""
        return " or ".join([self.title, *map(title_of, self.alternatives)])
