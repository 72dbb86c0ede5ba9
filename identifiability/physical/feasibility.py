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
from functools import cached_property, lru_cache

import numpy as np

from identifiability.effects.holding import held_by_file
from identifiability.estimation.estimator import Estimate, Estimator, settle_signs
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import INERTIAL, Array
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import CadPrior, nominal_cones
from identifiability.physical.certify import Certificate, certify
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.held import find_held, left_out
from identifiability.physical.least_squares import LeastSquares
from identifiability.physical.project import FeasibleEstimate, Projection
from identifiability.physical.pseudo_inertia import BodyCheck, check_body, natural_scale
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
    theta = structure.nominal[structure.inertial]
    stated = (theta[:, 9] > 0) & (theta[:, [0, 3, 5]].sum(1) > 0)  # a file may state no mass at all
    mass, length = natural_scale(theta)
    return PhysicalSet(
        bodies=structure.inertial,
        nonnegative=structure.nonnegative,
        names=tuple(structure.bodies.values()),
        columns=structure.columns,
        mass=np.where(stated, mass, 1.0),
        length=np.where(stated, length, 0.1),
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
        """The estimate's loss in the standard parameters."""
        return LeastSquares.of_fit(self.information, self.estimate).through(self.to_x)


def leave_undecided(structure: Structure, rung: Rung, why: str) -> PhysicalResult:
    """Return what physics says where nothing was fitted."""
    undecided = _no_answer(physical_set(structure), rung, 0.0)
    return replace(undecided, sentence=f"Not decided, because {why}.")


def _no_answer(region: PhysicalSet, rung: Rung, cad_weight: float) -> PhysicalResult:
    value, found = np.full(len(rung), np.nan), np.full(len(rung.M), np.nan)
    return PhysicalResult(region, None, None, value, found, found, "", cad_weight)


def find_impossible_bodies(robot: Robot) -> str:
    """Return one sentence on the bodies of the robot file that cannot exist, or nothing."""
    wrong = [check.reason for check in _check_file(robot) if not check.feasible]
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
    checks = _check_file(robot)
    for check in checks:
        if not check.feasible:
            raise IdentifiabilityError(
                f"{robot.path}: {check.reason} Correct the body's <inertial> in the robot file."
            )
    return checks


def _check_file(robot: Robot) -> tuple[BodyCheck, ...]:
    return tuple(check_body(stated_body(robot, body), body) for body in robot.bodies)


def stated_body(robot: Robot, body: str) -> Array:
    """Return the ten inertial parameters (10,) that the robot file states [kg m², kg m, kg]."""
    return np.array([robot.nominal[f"{body}.{kind}"] for kind in INERTIAL])


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


def assess_feasibility(model: FittedModel, cad_weight: float = 0.0) -> PhysicalResult:
    """Say whether a real robot has the estimated parameters, and find the nearest that has.

    Parameters
    ----------
    model : FittedModel
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
        if model.determined:
            settled = settle_signs(model.information, model.estimate, model.rung.nonnegative)
            certificate = certify(model.to_x, settled, physical_set(model.structure))
            sentence = certificate.sentence(model.rung.columns)
    except ValueError as error:
        sentence = f"Whether a real robot has these values was not decided: {error}"
    found = find_nearest(model, cad_weight)
    return replace(found, certificate=certificate, sentence=sentence + found.sentence)


def find_nearest(model: FittedModel, cad_weight: float = 0.0) -> PhysicalResult:
    """Find the nearest real robot, without asking whether it is the estimate itself.

    Cross-validation needs its torque alone. Parameters and errors as in `assess_feasibility`.
    """
    structure, rung = model.structure, model.rung
    region = physical_set(structure)
    found = _no_answer(region, rung, cad_weight)
    try:
        prior = _cad_prior(structure, cad_weight)
        held = find_held(region, structure.G, rung.M, rung.held)
        R = model.whole.factor(model.estimate.weights)
        rows, aim = left_out(R[:-1, :-1], structure.G, rung.M, rung.held)
        nearest = Projection(
            replace(region, nonnegative=region.nonnegative & ~held.fixed),
            reference=_possible(structure.nominal, region),
            prior=prior,
            held=held,
        ).solve(model.data.beside(rows, aim))
    except ValueError as error:
        return replace(found, sentence=f" The nearest real robot was not found: {error}")
    phi = dict(zip(region.columns, nearest.phi, strict=True))
    in_file = held_by_file(structure.robot, phi)
    base = np.array([nearest.phi, [in_file[n] for n in region.columns]]) @ structure.G.T
    sentence = _say_left_out(rows @ nearest.phi - aim, R[:, -1])
    if not nearest.accurate:
        reach = f"within {nearest.gap:.2g} σ² of the optimum"
        sentence = f" The nearest real robot is {reach}.{sentence}"
    value = model.to_x @ nearest.phi
    return replace(
        found, nearest=nearest, value=value, base=base[0], in_file=base[1], sentence=sentence
    )


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
