"""Restricted likelihood of autoregressive noise beside columns that are fitted with it."""

from __future__ import annotations

import numpy as np
import scipy

from identifiability.estimation.noise.autoregression import Runs, innovation_filter, levinson
from identifiability.foundation.names import Array

#: Highest order that is tried.
HIGHEST_ORDER = 4
#: Partial autocorrelations are held below tanh(this): slower noise cannot be told from a drift.
BOUND = 3.5
#: White noise that is taken to be there beside the residual, as a share of its variance: logs that
#: were filtered before they were stored have empty bands, which whitening would blow up.
FLOOR = 0.05
#: Shares of the trace below which directions are rounding, the next where one does not suffice.
ROUNDING = (1e-14, 1e-12, 1e-10)
#: When the search of one order ends.
STOP = {"maxiter": 30, "ftol": 1e-7}


class RestrictedLikelihood:
    """Restricted likelihood of autoregressive noise from lagged Gram matrices."""

    def __init__(self, y: Array, basis: Array, runs: Runs, floor: float = FLOOR) -> None:
        Z = np.column_stack([basis, y / (np.linalg.norm(y) or 1.0)])
        self.scale = float(np.linalg.norm(y)) or 1.0
        self.rows, self.k = len(y), basis.shape[1]
        self.dof = max(self.rows - self.k, 1)
        self.parts = [Z[a:b] for a, b in runs]
        left = Z[:, -1] - basis @ (basis.T @ Z[:, -1])
        self.floor = floor * float(left @ left) / self.rows
        self.left = float(left @ left) * self.scale**2 / self.dof
        P = HIGHEST_ORDER
        gram = np.zeros((P + 1, P + 1, P + 1, Z.shape[1], Z.shape[1]))
        for p in range(P + 1):
            long = [z for z in self.parts if len(z) > p]
            lagged = [[z[p - i : len(z) - i] for z in long] for i in range(p + 1)]
            for i in range(p + 1):
                for j in range(i + 1):
                    G = sum(a.T @ b for a, b in zip(lagged[i], lagged[j], strict=True))
                    gram[p, i, j] = G
                    gram[p, j, i] = np.transpose(G)
                gram[p, i, i, -1, -1] += self.floor * sum(len(z) - p for z in long)
        self.gram = [
            gram[p, : p + 1, : p + 1].reshape((p + 1) ** 2, -1).copy() for p in range(P + 1)
        ]
        #: The first m + 1 rows of every stretch that has them, the last one first, by m.
        self.heads = [
            np.array([z[m::-1] for z in self.parts if len(z) > m]).reshape(-1, m + 1, Z.shape[1])
            for m in range(P)
        ]

    def _whitened(self, theta: Array) -> tuple[Array, float]:
        """Return the Gram matrix of the whitened columns and the log-determinant."""
        predictors, variances = levinson(np.tanh(theta))
        p = len(theta)
        c = innovation_filter(predictors[-1])
        G = ((c[:, None] * c).ravel() @ self.gram[p]).reshape(self.k + 1, self.k + 1)
        logdet = 0.0
        for m, head in enumerate(self.heads[:p]):
            weights = innovation_filter(predictors[m])
            row = weights @ head  # of every stretch
            G += row.T @ row / variances[m]
            G[-1, -1] += len(head) * self.floor * (weights @ weights) / variances[m]
            logdet += len(head) * float(np.log(variances[m]))
        return G, logdet

    def _factor(self, theta: Array) -> tuple[Array, float]:
        G, logdet = self._whitened(theta)
        for share in ROUNDING:
            G.ravel()[:: len(G) + 1] += share * np.trace(G)
            try:
                return np.linalg.cholesky(G), logdet
            except np.linalg.LinAlgError:  # slow noise leaves nothing of slow columns
                continue
        raise np.linalg.LinAlgError("The whitened columns are not finite.")

    def deviance(self, theta: Array) -> float:
        """Return minus twice the restricted log-likelihood, sigma profiled out."""
        L, logdet = self._factor(theta)
        diagonal = np.diag(L)
        rss = max(diagonal[-1] ** 2, 1e-300)
        return float(self.dof * np.log(rss / self.dof) + logdet + 2 * np.log(diagonal[:-1]).sum())

    def sigma(self, theta: Array) -> float:
        """Return the standard deviation of the innovations."""
        L, _ = self._factor(theta)
        return max(float(L[-1, -1]) * self.scale / float(np.sqrt(self.dof)), 1e-12 * self.scale)

    def spread(self, theta: Array) -> Array:
        """Return the covariance of theta from the curvature of the deviance."""
        p = len(theta)
        h = 0.05
        H = np.zeros((p, p))
        unit = h * np.eye(p)
        for i in range(p):
            for j in range(i + 1):
                signs = ((1, 1), (1, -1), (-1, 1), (-1, -1))
                total = sum(
                    a * b * self.deviance(theta + a * unit[i] + b * unit[j]) for a, b in signs
                )
                H[i, j] = H[j, i] = total / (8 * h * h)
        values, vectors = np.linalg.eigh(H)
        limited = np.maximum(values, self.dof / 6)  # sd of Fisher's z is about 1/√dof
        covariance: Array = (vectors / limited) @ vectors.T
        return covariance

    def maximise(self) -> Array:
        """Return the transformed partial autocorrelations (p,) of the order with the least BIC."""
        best = theta = np.empty(0)
        least = self.deviance(theta)
        for order in range(1, HIGHEST_ORDER + 1):
            start, bounds = np.append(theta, 0.3 if order == 1 else 0.0), [(-BOUND, BOUND)] * order
            found = scipy.optimize.minimize(
                self.deviance, start, method="L-BFGS-B", bounds=bounds, options=STOP
            )
            theta = found.x
            value = found.fun + order * np.log(self.dof)
            if value < least - 1e-9:
                best, least = theta, value
        return best
