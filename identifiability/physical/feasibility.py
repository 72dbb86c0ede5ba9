"""From a fitted model to a real robot: the physical set, and the nearest parameters in it.

The stages before this one speak of base parameters; physics speaks of bodies. Here the information
about base parameters becomes a problem in the full standard parameters, ``W_base G phi``.

What a model leaves out is never free. Of friction, rotors and whatever else belongs to no body it
is exactly zero (or what it is held at, or equal to what it is tied to). Of bodies that may be
impossible: a body whose mass were zero has no first moment. There its torque counts as error in
full, and as no help in explaining the log.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from identifiability.effects import held_by_file
from identifiability.estimation.estimator import Estimate, settle_signs
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import INERTIAL, Array
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import CadPrior, nominal_cones
from identifiability.physical.certify import Certificate, certify
from identifiability.physical.feasible_set import PhysicalSet, scale_from
from identifiability.physical.held import find_held, left_out
from identifiability.physical.least_squares import LeastSquares
from identifiability.physical.project import FeasibleEstimate, build_projection
from identifiability.physical.pseudo_inertia import BodyCheck, check_body
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure
from identifiability.robot import Robot

#: Share of the torque from which on what a model leaves out, and bodies need, is spoken of.
LEFT_OUT = 1e-3


@frozen
class PhysicalResult:
    """What physics says of a fitted model.

    Attributes
    ----------
    region : PhysicalSet
    certificate : Certificate or None
        Whether a real robot has the estimated base parameters; None where the motion leaves some
        of them undetermined.
    nearest : FeasibleEstimate or None
        The real robot nearest to the data under the model; None where the solver found none.
    value : (m,)
        Its values of the model's parameters; NaN where there is none.
    base, in_file : (b,)
        Its base parameters, with what of the model's left-out ones its bodies cannot do without;
        and those of what a robot file holds of it without a sidecar.
    sentence : str
        The certificate in words.
    cad_weight : float
        Of the prior around the robot file that the nearest real robot was sought with.
    """

    region: PhysicalSet
    certificate: Certificate | None
    nearest: FeasibleEstimate | None
    value: Array
    base: Array
    in_file: Array
    sentence: str
    cad_weight: float

    @property
    def feasible(self) -> bool:
        """Whether a real robot has the estimated base parameters."""
        return self.certificate is not None and self.certificate.feasible

    @property
    def margin(self) -> float:
        """Smallest scaled eigenvalue that all bodies can keep; negative when infeasible."""
        return float("nan") if self.certificate is None else self.certificate.margin

    def parameters(self) -> dict[str, float]:
        """Return the standard parameters of the nearest real robot by name."""
        if self.nearest is None:
            return {}
        return {n: float(v) for n, v in zip(self.region.columns, self.nearest.phi, strict=True)}


@lru_cache(maxsize=4)
def physical_set(structure: Structure) -> PhysicalSet:
    """Return the parameter vectors that a real robot of this structure can have."""
    mass, length = _scales(structure.nominal, structure.inertial)
    return PhysicalSet(
        bodies=structure.inertial, nonnegative=structure.nonnegative,
        names=tuple(structure.bodies.values()), columns=structure.columns, mass=mass, length=length,
    )  # fmt: skip


def _scales(nominal: Array, bodies: np.ndarray) -> tuple[Array, Array]:
    """Return the mass [kg] and length [m] in which each body's margin is measured, (nb,)."""
    mass, length = np.ones(len(bodies)), np.full(len(bodies), 0.1)
    for k, columns in enumerate(bodies):
        theta = nominal[columns]
        if theta[9] > 0 and theta[[0, 3, 5]].sum() > 0:  # a file may state no mass at all
            mass[k : k + 1], length[k : k + 1] = scale_from(nominal, columns[None])
    return mass, length


def leave_undecided(structure: Structure, rung: Rung, why: str) -> PhysicalResult:
    """Return what physics says where nothing was fitted."""
    value, found = np.full(len(rung), np.nan), np.full(len(rung.M), np.nan)
    return PhysicalResult(
        physical_set(structure), None, None, value, found, found,
        f"Not decided, because {why}.", 0.0,
    )  # fmt: skip


def find_impossible_bodies(robot: Robot) -> str:
    """Return one sentence on the bodies of the robot file that cannot exist, or nothing."""
    checks = (check_body(_stated(robot, body), body) for body in robot.bodies)
    wrong = [check.reason for check in checks if not check.feasible]
    if not wrong:
        return ""
    more = f" {len(wrong) - 1} more bodies are like that." if len(wrong) > 1 else ""
    return (
        f"The robot file states a body that cannot exist. {wrong[0]}{more} Correct <inertial> "
        "there: the nearest real robot, its prior and every comparison with the file rest on it."
    )


def check_nominal(robot: Robot) -> tuple[BodyCheck, ...]:
    """Check the bodies that the robot file states.

    Raises
    ------
    IdentifiabilityError
        If one of them cannot exist, with its name and what is wrong.
    """
    checks = []
    for body in robot.bodies:
        check = check_body(_stated(robot, body), body)
        if not check.feasible:
            raise IdentifiabilityError(
                f"{robot.path}: {check.reason} Correct the body's <inertial> in the robot file."
            )
        checks.append(check)
    return tuple(checks)


def _stated(robot: Robot, body: str) -> Array:
    return np.array([robot.nominal[f"{body}.{kind}"] for kind in INERTIAL])


def full_problem(
    information: Information, estimate: Estimate, rung: Rung, G: Array
) -> LeastSquares:
    """Return the estimate's loss in the standard parameters under a model.

    The model says that base parameters are ``held + M x``; the part of ``G phi`` outside the span
    of M is what the model leaves out, and does not enter the prediction.

    Parameters
    ----------
    information : Information
        About the rung's columns.
    estimate : Estimate
    rung : Rung
    G : (b, p)
        Base parameters of standard parameters.
    """
    R = estimate.estimator.loss(information, estimate)
    m = len(rung)
    # x of the standard parameters: tied columns take the mean of their members.
    to_x = np.linalg.pinv(rung.M) @ G if m else np.zeros((0, G.shape[1]))
    variance = float(estimate.weights @ estimate.rss) / max(estimate.dof, 1)
    rss = max(float(R[m, m] ** 2), variance * 1e-12)
    return LeastSquares(R[:m, :m] @ to_x, R[:m, m], rss, max(float(estimate.dof), 1.0))


def _cad_prior(structure: Structure, weight: float) -> CadPrior | None:
    """Return the prior of the robot file, whose bodies must be possible and no points."""
    if not weight:
        return None
    robot = structure.robot
    if len(structure.bodies) > len(robot.bodies):
        raise IdentifiabilityError(
            "A prior around the robot file knows no payload; leave the effect payload out of the "
            "model (the last body has it), or the prior."
        )
    check_nominal(robot)
    prior = CadPrior(structure.nominal, weight)
    try:
        nominal_cones(physical_set(structure), prior)
    except ValueError as error:
        raise IdentifiabilityError(f"{robot.path}: {error}") from None
    return prior


def assess_feasibility(
    structure: Structure,
    rung: Rung,
    whole: Information,
    information: Information,
    estimate: Estimate,
    cad_weight: float = 0.0,
) -> PhysicalResult:
    """Say whether a real robot has the estimated parameters, and find the nearest that has.

    Parameters
    ----------
    structure : Structure
    rung : Rung
        The model that was fitted.
    whole, information : Information
        About all base parameters, and about the rung's columns.
    estimate : Estimate
    cad_weight : float
        Weight of a log-det prior around the bodies of the robot file, in σ² of the residual.

    Raises
    ------
    IdentifiabilityError
        If the robot file states a body that cannot be a prior, with its name.
    """
    certificate = None
    sentence = "The motion leaves parameters of the model undetermined."
    try:
        if len(estimate.kept) == len(rung) and len(rung):
            to_x = np.linalg.pinv(rung.M) @ structure.G
            settled = settle_signs(information, estimate, rung.nonnegative)
            certificate = certify(to_x, settled, physical_set(structure))
            sentence = certificate.sentence(rung.columns)
    except ValueError as error:
        sentence = f"Whether a real robot has these values was not decided: {error}"
    found = find_nearest(structure, rung, whole, information, estimate, cad_weight)
    return replace(found, certificate=certificate, sentence=sentence + found.sentence)


def find_nearest(
    structure: Structure,
    rung: Rung,
    whole: Information,
    information: Information,
    estimate: Estimate,
    cad_weight: float = 0.0,
) -> PhysicalResult:
    """Find the nearest real robot, without asking whether it is the estimate itself.

    Cross-validation needs its torque alone. Parameters and errors as in `assess_feasibility`.
    """
    region, G = physical_set(structure), structure.G
    data = full_problem(information, estimate, rung, G)
    to_x = np.linalg.pinv(rung.M) @ G if len(rung) else np.zeros((0, G.shape[1]))
    nearest, sentence = None, ""
    value, found = np.full(len(rung), np.nan), np.full((2, len(G)), np.nan)
    try:
        prior = _cad_prior(structure, cad_weight)
        held = find_held(region, G, rung.M, rung.held)
        R = whole.factor(estimate.weights)
        rows, aim = left_out(R[:-1, :-1], G, rung.M, rung.held)
        program = build_projection(
            replace(region, nonnegative=region.nonnegative & ~held.fixed),
            reference=_possible(structure.nominal, region), prior=prior, held=held,
        )  # fmt: skip
        nearest = program.solve(
            LeastSquares(
                np.vstack([data.R, rows]), np.concatenate([data.z, aim]), data.rss_min, data.dof
            )
        )
        value = to_x @ nearest.phi
        phi = dict(zip(region.columns, nearest.phi, strict=True))
        held_there = held_by_file(structure.robot, phi)
        found = np.array([nearest.phi, [held_there[n] for n in region.columns]]) @ G.T
        if not nearest.accurate:
            sentence += f" The nearest real robot is within {nearest.gap:.2g} σ² of the optimum."
        sentence += _say_left_out(rows @ nearest.phi - aim, R[:, -1])
    except ValueError as error:
        sentence += f" The nearest real robot was not found: {error}"
    return PhysicalResult(region, None, nearest, value, found[0], found[1], sentence, cad_weight)


def _possible(nominal: Array, region: PhysicalSet) -> Array:
    """Return nominal parameters (p,) without the bodies that cannot exist."""
    out = nominal.copy()
    for columns, check in zip(region.bodies, region.check(nominal), strict=True):
        if not check.feasible:
            out[columns] = 0.0
    return out


def _say_left_out(rest: Array, torque: Array) -> str:
    """Return what the nearest real robot has although the model leaves it out, if that matters."""
    share = float(np.linalg.norm(rest) / max(np.linalg.norm(torque), np.finfo(float).tiny))
    if share < LEFT_OUT:
        return ""
    return (
        " Real bodies cannot keep to all that the model leaves out or holds: in the nearest real "
        f"robot the difference makes {100 * share:.2g} % of the torque."
    )
