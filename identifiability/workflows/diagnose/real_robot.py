"""`RealRobot`: fits whose bodies, friction and rotors can exist.

A least-squares fit may buy its agreement with bodies of negative mass, and a wrong effect may
repair on other motion what these spoil there. What such an effect gains goes away as soon as
every fit, without it and with it, is the real robot nearest to the data [Traversaro 2016].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.physical.feasibility import physical_set
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.least_squares import LeastSquares
from identifiability.physical.project import Projection
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.rows import Candidate, Rows, joint_weights


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
        self, rows: Rows, chosen: Sequence[Candidate], mask: np.ndarray | None = None
    ) -> Array | None:
        """Return the values (b + m,) of the real robot nearest to the data.

        None where the solver finds none.
        """
        W, tau = rows.columns(chosen), rows.tau
        if mask is not None:
            W, tau = W[mask], tau[mask]
        weight = joint_weights(W, tau)
        m = W.shape[2]
        A = np.column_stack([(W * weight[:, None]).reshape(-1, m), (tau * weight).ravel()])
        R = np.asarray(np.linalg.qr(A, mode="r"), float)
        b, p = self.G.shape
        G = np.zeros((m, p + m - b))
        G[:b, :p], G[b:, p:] = self.G, np.eye(m - b)
        data = LeastSquares(R[:m, :m] @ G, R[:m, m], float(R[m, m] ** 2), float(len(A) - m))
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
