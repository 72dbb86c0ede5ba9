"""A fitted model, and the problem that it poses in the standard parameters of bodies.

The information about base parameters becomes a problem in the full standard parameters,
``W_base G phi``, for the nearest real robot and for the posterior alike.

What a model leaves out is never free. Of friction, rotors and whatever else belongs to no body it
is exactly zero (or what it is held at, or equal to what it is tied to). Of bodies that may be
impossible: a body whose mass were zero has no first moment. There its torque counts as error in
full, and as no help in explaining the log.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.bounds import stated_bounds
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.held import Held, find_held, left_out
from identifiability.physical.least_squares import LeastSquares
from identifiability.physical.pseudo_inertia import natural_scale
from identifiability.regression.functions import list_functions, tell_with_terms
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure


@lru_cache(maxsize=4)
def physical_set(structure: Structure) -> PhysicalSet:
    """Return the parameter vectors that a real robot of this structure can have."""
    theta = structure.nominal[structure.inertial]
    stated = (theta[:, 9] > 0) & (theta[:, [0, 3, 5]].sum(1) > 0)  # a file may state no mass at all
    mass, length = natural_scale(theta)
    mass = np.where(stated, mass, 1.0)
    return PhysicalSet(
        bodies=structure.inertial,
        nonnegative=structure.nonnegative,
        names=tuple(structure.bodies.values()),
        columns=structure.columns,
        mass=mass,
        length=np.where(stated, length, 0.1),
        bounds=stated_bounds(structure, mass),
        functions=tuple(list_functions(structure)),
    )


@frozen
class FittedModel:
    """A model of a robot that was fitted, and what the fit says of the standard parameters.

    The model says that base parameters are ``held + M x``; the part of ``G phi`` outside the span
    of M is what the model leaves out, and does not enter its prediction.

    Attributes
    ----------
    structure : Structure
        With its b base and p standard parameters.
    rung : Rung
        The model, of m parameters x.
    whole, information : Information
        About all base parameters, and about the rung's columns.
    estimate : Estimate
    """

    structure: Structure
    rung: Rung
    whole: Information
    information: Information
    estimate: Estimate

    @staticmethod
    def of(
        structure: Structure, rung: Rung, whole: Information, estimator: Estimator
    ) -> FittedModel:
        """Fit a model."""
        part = rung.reduce(whole)
        return FittedModel(structure, rung, whole, part, estimator.fit(part))

    @cached_property
    def told(self) -> FittedModel:
        """The model in the parameters that are reported: terms with their shares of functions."""
        R = self.whole.factor(self.estimate.weights)[:-1, :-1]
        rung = tell_with_terms(self.structure, self.rung, R)
        if np.array_equal(rung.M, self.rung.M):
            return self
        return FittedModel.of(self.structure, rung, self.whole, self.estimate.estimator)

    @cached_property
    def to_x(self) -> Array:
        """The model's parameters of standard ones, (m, p); tied columns take the mean."""
        to_x: Array = np.linalg.pinv(self.rung.M) @ self.structure.G
        return to_x

    @property
    def determined(self) -> bool:
        """Whether there are parameters and the motion determines each."""
        return 0 < len(self.rung) == len(self.estimate.kept)

    @cached_property
    def data(self) -> LeastSquares:
        """The estimate's loss in the standard parameters, of what the model does not leave out."""
        return LeastSquares.of_fit(self.information, self.estimate).through(self.to_x)

    @cached_property
    def held(self) -> Held:
        """What the model leaves out, holds or ties outside the bodies.

        Raises
        ------
        ValueError
            If it holds what no real robot has.
        """
        region = physical_set(self.structure)
        return find_held(region, self.structure.G, self.rung.M, self.rung.held)

    @cached_property
    def region(self) -> PhysicalSet:
        """What a real robot can have; what is held by itself needs no sign."""
        region = physical_set(self.structure)
        return replace(region, nonnegative=region.nonnegative & ~self.held.fixed)

    @cached_property
    def left_out(self) -> tuple[Array, Array]:
        """Torque of what the model leaves out, ``rows phi − aim``: (b, p) and (b,)."""
        R = self.whole.factor(self.estimate.weights)[:-1, :-1]
        return left_out(R, self.structure.G, self.rung.M, self.rung.held)
