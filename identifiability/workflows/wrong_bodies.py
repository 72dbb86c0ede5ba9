"""`find_wrong_bodies`: the body of the robot file whose values the logs contradict.

All values of a file err by a share that its fit tells. A wrong body errs by more. Each body is two
hypotheses: any of its ten values is wrong, or only its mass and its inertia about its centre are.
Wrong torque constants compete with them, and springs whose torque is that of a body in any motion.
"""

from collections.abc import Mapping
from functools import partial
from typing import Literal

import numpy as np
from scipy.linalg import null_space, solve_triangular
from scipy.special import logsumexp

from identifiability.effects.measurement import EncoderBias
from identifiability.effects.springs import GravitySpring
from identifiability.estimation.gaussian import Normal
from identifiability.estimation.rules import RULES
from identifiability.foundation.linalg import ROUNDOFF, or_one, root_diagonal
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import ball
from identifiability.physical.pseudo_inertia import entry_scale, natural_scale
from identifiability.regression.reduction import Submodel
from identifiability.regression.structure import Structure, mimic_in_bodies

from .predict import Fit
from .torque_scale import FILE_ERRORS, LOG_PRIOR

#: Where the cause is, and what it is: any value of a body or its mass, a spring, torque constants.
Hypothesis = tuple[str, Literal["other", "mass", "spring", "constants"]]
CONSTANTS: Hypothesis = ("", "constants")


@frozen
class WrongBodies:
    """Hypotheses of which one holds, the likeliest first; none if no body stands out.

    Attributes
    ----------
    hypotheses : tuple of (str, str)
    change, sd : float
        Mass of the first body relative to the file's, minus one, with its standard error; infinite
        if its centre or inertia is wrong as well.
    springs : mapping of str to (b,)
        Change of the base parameters by the likeliest spring at each joint of the hypotheses.
    """

    hypotheses: tuple[Hypothesis, ...] = ()
    change: float = 0.0
    sd: float = np.inf
    springs: Mapping[str, Array] = {}


def find_wrong_bodies(fit: Fit) -> WrongBodies:
    """Return which body of the robot file has wrong values; none if no body surely has."""
    structure = fit.structure
    values, covariance = fit.of_labels
    towards = _find_determined(fit)
    stated = towards @ structure.nominal_base
    off = towards @ values - stated
    shapes = _list_errors(structure, towards @ structure.G)
    if not (len(off) and shapes):
        return WrongBodies()
    noise = towards @ covariance @ towards.T + ROUNDOFF * np.eye(len(off))
    errors = sum(x @ x.T for (_, kind), x in shapes.items() if kind == "other")
    roots = [np.linalg.cholesky(noise + share**2 * errors) for share in FILE_ERRORS]
    far = np.abs(off) > RULES.contradicted * root_diagonal(noise)
    springs = mimic_in_bodies(structure, GravitySpring.name) if far.any() else {}
    for joint, changes in springs.items():
        length = np.linalg.norm(_whiten(roots[-1], towards @ changes), axis=0)
        # The errors of all bodies together change values as much as a spring of size 1.
        springs[joint] = changes / or_one(FILE_ERRORS[-1] * length)
        shapes[joint, "spring"] = towards @ springs[joint]
    evidence = {key: _weigh(off, roots, x, FILE_ERRORS) for key, x in shapes.items()}
    # Wrong constants scale all values; a scale of zero is the file with its usual errors.
    weigh = partial(_weigh, off, roots, stated[:, None])
    evidence[CONSTANTS] = weigh(np.array([RULES.constants_within]))
    right = logsumexp(weigh(np.zeros(1)))
    odds = {key: logsumexp(x) - right for key, x in evidence.items()}
    best, *rest = sorted(odds, key=lambda key: -odds[key])
    if best == CONSTANTS or odds[best] < np.log(len(odds)) + RULES.name + RULES.keep:
        return WrongBodies()
    likely = (best, *(key for key in rest if odds[key] > odds[best] - RULES.rival))

    def sizes_of(key: Hypothesis) -> Normal:
        root = roots[int(evidence[key].argmax())]
        white = _whiten(root, shapes[key])
        prior = np.eye(white.shape[1]) / FILE_ERRORS[-1] ** 2
        return Normal.of(white.T @ white + prior, white.T @ _whiten(root, off))

    changed = {
        at: springs[at] @ sizes_of((at, kind)).value for at, kind in likely if kind == "spring"
    }
    if best[1] == "spring":
        return WrongBodies(likely, springs=changed)
    key: Hypothesis = best[0], "mass"
    mass = sizes_of(key)
    white = _whiten(
        roots[int(evidence[key].argmax())],
        np.column_stack([shapes[best[0], "other"], off - shapes[key] @ mass.value]),
    )
    left = np.linalg.qr(white[:, :-1])[0].T @ white[:, -1]
    # Where nothing is left but noise, the mean square is about one.
    alone = left @ left < 2 * len(left)
    sd = root_diagonal(mass.covariance)[0] if alone else np.inf
    return WrongBodies(likely, float(mass.value[0]), float(sd), changed)


def find_wrong_zero(
    structure: Structure, submodel: Submodel, off: Array, sigma: Array
) -> tuple[str, float]:
    """Return the joint whose wrong zero would explain most differences from the file, if any.

    The size [rad] is that by which its positions are read too large. In any motion such a zero acts
    as the last body turned about the axis.

    Parameters
    ----------
    structure : Structure
    submodel : Submodel
        Its k parameters over the base parameters.
    off, sigma : (k,)
        Values by the logs minus those of the file, and their standard errors; infinite where a
        value is not compared.
    """
    if structure.robot.closed:
        return "", 0.0
    found = ("", 0.0)
    least = 0.5 * np.sum((off / sigma) ** 2)
    for joint, change in mimic_in_bodies(structure, EncoderBias.name).items():
        shape = (submodel.inverse @ change[:, 0]) / sigma
        size = float(shape @ (off / sigma) / or_one(shape @ shape))
        rest = np.sum((off / sigma - size * shape) ** 2)
        if rest < least and abs(size) < 1:
            found, least = (joint, size), rest
    return found


def _whiten(root: Array, x: Array) -> Array:
    """Return values x (n, k) in units of errors whose covariance has a lower factor (n, n)."""
    return solve_triangular(root, x, lower=True)


def _find_determined(fit: Fit) -> Array:
    """Return n combinations (n, b) of base parameters that the logs determine, of bodies alone.

    A torque offset that the model lacks changes none of them.
    """
    structure = fit.structure
    unit = or_one(root_diagonal(fit.of_labels[1]))
    of_joints = np.delete(structure.G, structure.inertial.ravel(), axis=1)
    unknown = np.column_stack([of_joints, fit.base_unknown, fit.offsets]) / unit[:, None]
    directions = unknown / or_one(np.linalg.norm(unknown, axis=0))
    return null_space(directions.T).T / unit


def _list_errors(structure: Structure, A: Array) -> dict[Hypothesis, Array]:
    """Return the changes (n, k) by k errors of each body, from those by all p parameters, (n, p).

    The ten values err by their typical sizes, mass and inertia about the centre by themselves.
    """
    found = dict[Hypothesis, Array]()
    for stem, columns in zip(structure.bodies, structure.inertial, strict=True):
        theta = structure.nominal[columns]
        if theta[9] > 0:
            body = stem.removesuffix(".")
            point = ball(theta, 0.0, 0.0)
            found[body, "other"] = A[:, columns] * entry_scale(*natural_scale(theta[None]))
            found[body, "mass"] = A[:, columns] @ np.column_stack([point, theta - point])
    return found


def _weigh(off: Array, roots: list[Array], shape: Array, sizes: Array) -> Array:
    """Return the log evidence for errors of a shape, by each share of the file's errors.

    Parameters
    ----------
    off : (n,)
        Values by the logs minus those of the file.
    roots : list of (n, n)
        Lower factors of their covariance, one for each share.
    shape : (n, k)
    sizes : (s,)
        That the errors of the shape may have.
    """
    found = []
    for root in roots:
        white = _whiten(root, np.column_stack([shape, off]))
        axes, lengths, _ = np.linalg.svd(white[:, :-1], full_matrices=False)
        grown = 1.0 + np.outer(sizes, lengths) ** 2
        residual = white[:, -1]
        explained = (residual @ axes) ** 2 * (1.0 - 1.0 / grown) - np.log(grown)
        plain = residual @ residual + 2 * np.sum(np.log(np.diag(root)))
        found.append(0.5 * (explained.sum(axis=1) - plain))
    return LOG_PRIOR + logsumexp(found, axis=1) - np.log(len(sizes))
