"""`RealRobot`: fits within what a real robot can have [Traversaro 2016]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag

from identifiability.estimation.estimator import Estimate
from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.names import Array
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.fitted_model import LeastSquares, physical_set
from identifiability.physical.project import Projection
from identifiability.regression.information import Information
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.smooth import unit_of


@dataclass
class RealRobot:
    """Fits the base model and some candidates within what a real robot can have.

    Programs are compiled once for each pattern of signs of the candidates' columns.

    Attributes
    ----------
    region : PhysicalSet
        Of the base model.
    nominal : (p,)
        Where the parameters go that the data leave open.
    G : (b, p)
        Base parameters of standard parameters.
    """

    region: PhysicalSet
    nominal: Array
    G: Array
    _compiled: dict[tuple[bool, ...], Projection] = field(default_factory=dict)

    @staticmethod
    def of(structure: Structure) -> RealRobot | None:
        """Return the fits of a structure; None where it has no bodies."""
        region = physical_set(structure)
        if not len(region.bodies):
            return None
        return RealRobot(region, structure.nominal, structure.G)

    def fit(
        self,
        information: Information,
        free: Estimate,
        chosen: Sequence[Candidate],
        straight: Array | None = None,
    ) -> Array | None:
        """Return the values (b + m,) of the real robot nearest to the data.

        None where the solver finds none.

        Parameters
        ----------
        information : Information
        free : Estimate
            From it, without any bound.
        chosen : sequence of Candidate
            Whose m columns follow those of the base parameters.
        straight : (r, b + m), optional
            Observations of zero, in units of the noise.
        """
        m, b = information.size, len(self.G)
        R, G = free.estimator.loss(information, free), block_diag(self.G, np.eye(m - b))
        if straight is not None:
            rows = np.pad(unit_of(free) * straight, ((0, 0), (0, 1)))
            R = triangular_factor(np.concatenate([R, rows]))
        rest = float(information.rows - m)
        data = LeastSquares(R[:m, :m] @ G, R[:m, m], float(R[m, m] ** 2), rest)
        try:
            found = self._program(chosen).solve(data)
        except ValueError:
            return None
        value: Array = G @ found.phi
        return value

    def _program(self, chosen: Sequence[Candidate]) -> Projection:
        signs = tuple(c.positive for c in chosen for _ in c.columns)
        if signs not in self._compiled:
            labels = [f"effect {k + 1}" for k in range(len(signs))]
            region = replace(
                self.region,
                nonnegative=np.concatenate([self.region.nonnegative, np.array(signs, bool)]),
                columns=(*self.region.columns, *labels),
            )
            reference = np.concatenate([self.nominal, np.zeros(len(signs))])
            self._compiled[signs] = Projection(region, reference=reference)
        return self._compiled[signs]
