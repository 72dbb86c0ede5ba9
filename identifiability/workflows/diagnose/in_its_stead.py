"""A name gives way to what has none where one number of that says decisively more.

What the dictionary does not have is named by whatever resembles it: drag by the speed of another
joint as leaking torque, of which that speed is a part; a wrong scale of the torque as what leaks
into the joint before, where the masses that are fitted put it. Only what is left in its own joint
speaks against such a name, and spread over many functions that is little. In its stead a column of
anything that torque may depend on, in whichever joint, is one hypothesis against another, and what
decides between two names decides here. Not where the two are similar: they are one to this motion,
and the torque of the robot file, with values a little wrong, is no worse a name for its leak than
the torque that fits. What every joint has is there whatever else is missing. Nor where the motion
is too short to say what a name leaves in its joint: of a robot of which the model misses much, one
column takes something of all that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.noise import ARNoise
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import log_tail
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.anything import list_kinds
from identifiability.workflows.diagnose.evidence import NEGLIGIBLE
from identifiability.workflows.diagnose.gates import Naming, keep_surviving
from identifiability.workflows.diagnose.leftover import basis_beside, in_units_of_rest
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.diagnose.material import Material
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.spans import orthonormal, project_out, unit_columns


def keep_unbeaten(material: Material, naming: Naming) -> Naming:
    """Return a naming without names in whose stead a column without one says decisively more.

    They are taken out one after the other, the one that loses most first.
    """
    why = "what has no name explains decisively more in its stead"
    while asked := [k for k, c in enumerate(naming.chosen) if _is_asked(material, naming, c)]:
        contest = Contest.of(material, naming.chosen)
        most, at = max((contest.lost(naming.chosen[k]), k) for k in asked)
        if most <= DECISIVE:
            break
        gone = [naming.chosen[at]]
        naming = keep_surviving(naming, gone, material.setting.structure.present, why)
    return naming


def _is_asked(material: Material, naming: Naming, c: Candidate) -> bool:
    """Whether a name has to be the cause, and it can be said what it leaves in its joint."""
    return not c.family.basic and material.remains(naming.chosen).beside(c) is not None


@frozen
class Contest:
    """Names and single columns without one, all in rows whitened by the noise [Aitken 1936].

    Rows are those of one joint below the other, and then what is known of the model's values.

    Attributes
    ----------
    y : (R,)
        Torque, in units of what the model with all names leaves.
    X : (R, b)
        Base model.
    names : mapping of candidate to (R, k)
    others : tuple of (first, (N, m))
        What torque in a joint may depend on, with the row where the joint begins.
    similar : float
        Similarity from which on two names are one.
    """

    y: Array
    X: Array
    names: dict[Candidate, Array]
    others: tuple[tuple[int, Array], ...]
    similar: float

    @staticmethod
    def of(material: Material, chosen: Sequence[Candidate]) -> Contest:
        """Return what some names have to stand against."""
        rows, noise = material.train, material.noise
        model = rows.tau - material.held.fitted_residual(chosen)
        known = np.empty((0, rows.X.shape[2])) if rows.root is None else rows.root

        def whiten(A: Array, below: Array | None = None) -> Array:
            n, joints, k = A.shape
            white = noise.whiten(A, rows.moving).transpose(1, 0, 2).reshape(n * joints, k)
            last = np.zeros((len(known), k)) if below is None else below
            return np.concatenate([white, last])

        y, X = whiten(rows.tau[:, :, None]), whiten(rows.X, known)
        names = {c: whiten(rows.D.take(c.columns)) for c in chosen}
        y = in_units_of_rest(y, [X, *names.values()], len(known) + rows.silent)[0][:, 0]
        others = []
        for j, own in enumerate(noise.joints):
            kinds = np.column_stack(list_kinds(rows, model, j))
            white = ARNoise((own,)).whiten(kinds[:, None], rows.moving.each[j])[:, 0]
            others.append((j * len(rows), unit_columns(white)))
        return Contest(y, X, names, tuple(others), material.setting.rules.confusable)

    def lost(self, c: Candidate) -> float:
        """Return by how much a rival without a name says more than a name, as a log-likelihood.

        A rival leaves the name nothing that decides: what both are needed for are two causes.
        """
        rest = [A for other, A in self.names.items() if other is not c]
        Q = orthonormal(np.column_stack([self.X, *rest]))
        own, y = basis_beside(Q, self.names[c]), project_out(Q, self.y)
        k, w = own.shape[1], own.T @ y
        if not k:
            return -np.inf
        best = 0.0
        for first, A in self.others:
            here = slice(first, first + len(A))
            length = np.sqrt(np.clip(1.0 - np.sum((Q[here].T @ A) ** 2, axis=0), 0.0, None))
            seen = length > NEGLIGIBLE
            u = A[:, seen] / length[seen]
            said, shared = u.T @ y[here], own[here].T @ u
            alike = np.clip(np.sum(shared**2, axis=0), 0.0, 1.0 - NEGLIGIBLE)
            # What the name says beside it: of the inverse of 1 − m m' [Sherman & Morrison 1950].
            after = w[:, None] - shared * said
            beside = np.sum(after**2, axis=0)
            beside += np.sum(shared * after, axis=0) ** 2 / (1.0 - alike)
            rival = (alike < self.similar**2) & (-log_tail(beside, k) < DECISIVE)
            best = max(best, float(np.max(said**2, where=rival, initial=0.0)))
        return float(log_tail(np.array(w @ w), k) - log_tail(np.array(best), 1))
