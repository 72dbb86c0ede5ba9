"""Bodies to which a prior may draw: those of the robot file, and others where it states none."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import thick_inertia
from identifiability.physical.pseudo_inertia import natural_scale
from identifiability.regression.structure import Structure

#: Mass [kg] and radius of gyration [m] of a body where the robot file states no body at all.
MASS, LENGTH = 1.0, 0.1


@frozen
class NominalBodies:
    """A nominal robot whose every body can exist and has extent.

    Attributes
    ----------
    phi : (p,)
        Standard parameters.
    titles : (nb,) str
        Of all bodies, loads among them.
    replaced : tuple of str
        Those for which the robot file states no body, an impossible one or a point.
    """

    phi: Array
    titles: tuple[str, ...]
    replaced: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """What stands in for bodies that the file does not state; nothing if it states all."""
        if not self.replaced:
            return ""
        like = "a ball as light as the lightest other body"
        if len(self.replaced) == len(self.titles):
            like = f"a ball of {MASS:g} kg"
        each = "it is" if len(self.replaced) == 1 else "each is"
        return (
            f"The robot file states no body with mass and possible moments for "
            f"{listing(self.replaced, 4)}: where the logs are silent {each} drawn to {like}."
        )


@lru_cache(maxsize=4)
def draw_bodies(structure: Structure) -> NominalBodies:
    """Return the bodies to which a structure's prior draws.

    A body that the file does not state is a ball about the origin of its frame, as light as the
    lightest stated body; if its mass alone is stated, it has that mass and is where the file says.
    A load is as the body that carries it.
    """
    phi, bodies = structure.nominal.copy(), structure.bodies
    loads = {stem: stem.removesuffix("payload_") for stem in bodies if stem.endswith(".payload_")}
    at = dict(zip(bodies, structure.inertial, strict=True))
    sound = [stem for stem in bodies if stem not in loads and _exists(phi[at[stem]])]
    mass, length = natural_scale(phi[[at[stem] for stem in sound]].reshape(-1, 10))
    least, size = float(mass.min(initial=np.inf)), float(np.median(length)) if sound else LENGTH
    least = least if sound else MASS
    replaced = [stem for stem in bodies if stem not in loads and stem not in sound]
    for stem in replaced:
        phi[at[stem]] = _ball(phi[at[stem]], least, size)
    for stem, carrier in loads.items():
        phi[at[stem]] = phi[at[carrier]] if carrier in at else _ball(np.zeros(10), least, size)
    titles = tuple(bodies.values())
    return NominalBodies(phi, titles, tuple(bodies[stem] for stem in replaced))


def _exists(theta: Array) -> bool:
    try:
        thick_inertia(theta, "")
    except ValueError:
        return False
    return True


def _ball(theta: Array, mass: float, length: float) -> Array:
    """Return a ball (10,) with the mass and centre of a body if it has a mass."""
    own = float(theta[9]) > 0
    mass, centre = (float(theta[9]), theta[6:9] / theta[9]) if own else (mass, np.zeros(3))
    spread = length**2 * np.eye(3) + np.outer(centre, centre)  # ∫ r rᵀ dm / m
    moments = mass * (np.trace(spread) * np.eye(3) - spread)
    entries = moments[np.triu_indices(3)]
    return np.array([*entries, *(mass * centre), mass])
