"""Physical consistency of a fitted model, and the nearest physically consistent values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
from scipy.linalg import null_space

from identifiability.effects.registry import is_loaded
from identifiability.effects.vocabulary import file_values
from identifiability.estimation.estimator import clip_signs
from identifiability.estimation.evidence import LEVELS, Evidence, Folds, HeldOut, Score
from identifiability.foundation.engines import one_thread
from identifiability.foundation.errors import listing
from identifiability.foundation.linalg import NEARLY, ROUNDOFF, or_one, solve_least
from identifiability.foundation.names import GROUPED_KINDS, Array, name_each
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel, leave_to_terms
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.robot.inertials import describe_faults, find_faults
from identifiability.robot.locate import LARGEST

from .cad_prior import WEIGHTS, CadPrior, draw_bodies, state_rows
from .fitted_model import FittedModel, LeastSquares, PhysicalSet, physical_set
from .project import FeasibleEstimate, Projection, solve_cones
from .pseudo_inertia import BOUNDARY, check_body
from .rules import RULES


@frozen
class PhysicalResult:
    """Physical consistency of a fitted model.

    Attributes
    ----------
    region : PhysicalSet
    value : (m,)
        Values of the model's parameters of the nearest physically consistent robot; NaN where there
        is none.
    base : (b,)
        Its base parameters, including omitted ones that its bodies require.
    in_files : (2, b)
        Base parameters that a robot file without a sidecar can represent: one of the robot's own
        format, and one of the other.
    sentence : str
        The certificate in words.
    certificate : Certificate or None
        Whether the estimated base parameters are physically consistent; None where the motion
        leaves some of them undetermined.
    nearest : FeasibleEstimate or None
        The physically consistent values nearest to the data under the model; None where the solver
        found none.
    cad_weight : float
        Weight of the prior around the robot file in the search for these values.
    as_good : bool
        Whether the estimate does not surely predict unseen regions of the fitted motion better than
        the physically consistent values do.
    """

    region: PhysicalSet
    value: Array
    base: Array
    in_files: Array
    sentence: str
    certificate: Certificate | None = None
    nearest: FeasibleEstimate | None = None
    cad_weight: float = 0.0
    as_good: bool = False

    @property
    def feasible(self) -> bool:
        """Whether the estimated base parameters are physically consistent."""
        return self.certificate is not None and self.certificate.feasible

    @property
    def margin(self) -> float:
        """Smallest scaled eigenvalue that all bodies can keep; negative when infeasible."""
        if self.certificate is None:
            return np.nan
        return self.certificate.margin

    def within(self, submodel: Submodel) -> Submodel | None:
        """Return the fitted model with the parameters fixed that it omits but bodies need.

        The result is None if physical bodies cannot satisfy the ties of the model.
        """
        M = submodel.M
        apart = self.base - M @ self.value
        fixed = np.where(M.any(axis=1), submodel.fixed, apart)
        reach = NEARLY * np.abs(self.base).max(initial=0.0)
        if np.abs(apart - fixed).max() <= reach:
            return replace(submodel, fixed=fixed)
        return None

    def parameters(self) -> dict[str, float]:
        """Return the standard parameters of the nearest physically consistent robot by name."""
        if self.nearest is None:
            return {}
        return name_each(self.region.columns, self.nearest.phi)


def leave_undecided(structure: Structure, submodel: Submodel) -> PhysicalResult:
    """Return the result before the solvers have run, with NaN for all values."""
    value = np.full(len(submodel), np.nan)
    found = np.full((3, len(submodel.M)), np.nan)
    return PhysicalResult(physical_set(structure), value, found[0], found[1:], "")


def check_bodies(robot: Robot) -> dict[str, str]:
    """Return why moving bodies cannot exist, by body; bodies fixed to them are merged."""
    ten = {b: np.array([robot.nominal[f"{b}.{k}"] for k in GROUPED_KINDS]) for b in robot.bodies}
    reasons = {body: check_body(theta, body) for body, theta in ten.items()}
    return {body: reason for body, reason in reasons.items() if reason}


def find_impossible_bodies(robot: Robot) -> str:
    """Return one sentence on all impossible bodies of the robot file, or "".

    It quotes the numbers of the file. MuJoCo refuses, or corrects, such bodies of an MJCF itself.
    """
    frames = {f.name: f.parentJoint for f in robot.model.frames if f.parentJoint}
    faults = {} if robot.mjcf else find_faults(robot.path, frames)
    explained = {frames[body] for body in faults}
    carriers = name_each(robot.bodies, robot.carriers)
    for body, reason in check_bodies(robot).items():
        if carriers[body] not in explained:
            faults[body] = reason.rstrip(".")
    if not faults:
        return ""
    return (
        f"{describe_faults(faults)} Correct <inertial> there: physically consistent values, "
        "their prior and every comparison with the file rest on it."
    )


def certify_model(model: FittedModel) -> tuple[Certificate | None, str]:
    """Return whether the estimates are physically consistent (None if open), and a reason."""
    try:
        if model.determined:
            clipped = clip_signs(model.information, model.estimate, model.submodel.nonnegative)
            certificate = certify(model.to_x, clipped, physical_set(model.structure))
            return certificate, certificate.sentence(model.submodel.columns)
    except ValueError as error:
        return None, f"Whether a real robot has these values was not decided: {error}"
    return None, "The motion leaves parameters of the model undetermined."


@frozen
class PriorChoice:
    """Weight of the prior around the robot file, chosen by predictive likelihood.

    Attributes
    ----------
    weight : float
        Of the prior [σ²].
    values : (F, b)
        Base parameters of the nearest physically consistent robot under it, found from the other
        folds.
    score : Score
        What they predict.
    as_good : bool
        Whether the free fit is not surely better in other regions of the motion. If the data cannot
        decide between the two, the physically consistent one is used.
    """

    weight: float
    values: Array
    score: Score
    as_good: bool


def choose_prior(
    model: FittedModel, held_out: HeldOut, weights: Sequence[float] = WEIGHTS
) -> PriorChoice | None:
    """Choose the heaviest prior within two nats of the best predictive log density.

    Regions of the motion that are left out decide whether its values predict as well as the free
    fit.

    Parameters
    ----------
    model : FittedModel
    held_out : evidence.HeldOut
        Folds of what was fitted, about all base parameters.
    weights : sequence of float
        Among which, the heaviest first; of a single weight, only whether it predicts as well is
        checked.

    Returns
    -------
    PriorChoice or None
        None if no nearest real robot was found.
    """
    try:
        projection = _projection(model, 1.0)
    except ValueError:
        return None
    # a log counts as its independent samples
    G = model.structure.G
    wider = float(np.sqrt(model.estimate.memory))
    with one_thread():
        ways = _follow_folds(model, projection, held_out.folds, weights)
        values = list[Array]()
        scores = list[Score]()
        total = list[float]()
        for found in zip(*ways, strict=False):
            base = np.stack([phi for phi, _ in found]) @ G.T
            # A rest without motion determines nothing, and a light prior no longer does.
            if not np.all(np.abs(base) < LARGEST):
                break
            values.append(base)
            roots = wider * (G @ np.stack([root for _, root in found]))
            scores.append(held_out.score(values[-1], roots))
            total.append(float(scores[-1].density.sum()))
            # Densities have summits up to six nats apart, and none behind so deep a valley.
            if total[-1] < max(total) - 10 * LEVELS.nats:
                break
    if not scores:
        return None
    at = int(np.argmax(np.array(total) >= max(total) - LEVELS.nats))
    good = _predicts_as_well(model, projection, held_out.regions, weights[at])
    return PriorChoice(weights[at], values[at], scores[at], good)


def _follow_folds(
    model: FittedModel, projection: Projection, folds: Folds, weights: Sequence[float]
) -> Iterator[Iterator[tuple[Array, Array]]]:
    """Yield the path of optima under falling weights of the prior, for each fold's rest."""
    # A path that begins at a light weight fails: bodies begin too far from the optimum.
    heavier = [weight for weight in WEIGHTS if weight > weights[0]]
    for row in folds.train:
        rest = model.whole.take(row)
        information = model.submodel.reduce(rest)
        part = replace(model, whole=rest, information=information)
        path = projection.follow(_believe(part, weights[-1]), [*heavier, *weights])
        yield islice(path, len(heavier), None)


def _predicts_as_well(
    model: FittedModel, projection: Projection, regions: HeldOut, weight: float
) -> bool:
    """Return whether the free fit does not surely predict regions of the motion better.

    Where the solver finds no physically consistent values for a rest, nothing is sure.
    """
    submodel = model.submodel
    with one_thread():
        found = [list(path) for path in _follow_folds(model, projection, regions.folds, [weight])]
    if not all(found):
        return True
    real = np.stack([path[0][0] for path in found]) @ model.structure.G.T
    free = regions.refit(model.estimate, submodel.M, submodel.fixed)
    return Evidence.of(regions.score(real), regions.score(free)).limits[1] >= 0


def scale_bodies(structure: Structure, whole: Information) -> Array:
    """Return the standard parameters (p,) to whose bodies a prior draws.

    A file whose masses are another robot's, as placeholders are, draws to its proportions alone.
    All base parameters decide that, so that models of one robot are drawn to the same bodies. A
    scale of the torque takes no part: with one at each joint bodies could weigh anything. Stated
    rotors count as stated: where they are free, one heavy tool could make all bodies heavier.

    Parameters
    ----------
    structure : Structure
    whole : Information
        About all base parameters.
    """
    bodies, _ = draw_bodies(structure)
    at = physical_set(structure).bodies.ravel()
    # A joint whose torque is rounding says nothing of bodies.
    turned = whole.torque > ROUNDOFF * whole.torque.max(initial=0.0)
    rows = whole.factor(1.0 / np.where(turned, whole.torque, np.inf))[:-1]
    R = rows[:, :-1] @ structure.G
    loaded = [k for k, p in enumerate(structure.parameters) if is_loaded([p])]
    parts = structure.robot.inertia_parts
    is_rotor = [p.name.rpartition(".")[2] in parts for p in structure.parameters]
    stated = np.flatnonzero(np.array(is_rotor) & (structure.nominal != 0))
    others = np.delete(R, [*at, *loaded, *stated], axis=1)
    alike = np.column_stack([R[:, at] @ bodies[at], others])
    of_bodies = rows[:, -1] - R[:, stated] @ structure.nominal[stated]
    factor = solve_least(alike, of_bodies)[0]
    if factor > 0 and not 1 / RULES.another_robot < factor < RULES.another_robot:
        bodies = bodies.copy()
        bodies[at] *= factor
    return bodies


def _projection(model: FittedModel, cad_weight: float) -> Projection:
    """Return the program that finds the physically consistent values nearest to a model's estimate.

    Raises
    ------
    ValueError
        If no real robot has what it holds.
    """
    structure = model.structure
    region = physical_set(structure)
    possible = structure.nominal.copy()
    bodies = scale_bodies(structure, model.whole)
    for columns, name in zip(region.bodies, region.names, strict=True):
        if check_body(possible[columns], name):
            possible[columns] = 0.0
    prior = CadPrior(bodies, cad_weight) if cad_weight and region.names else None
    return Projection(model.region, reference=possible, prior=prior, fixed=model.fixed)


def find_nearest(model: FittedModel, cad_weight: float) -> PhysicalResult:
    """Find the nearest physically consistent values, without a certificate of the estimate."""
    structure = model.structure
    data = _believe(model, cad_weight)
    found = replace(leave_undecided(structure, model.submodel), cad_weight=cad_weight)
    try:
        nearest = _projection(model, cad_weight).solve(data)
    except ValueError as error:
        return replace(found, sentence=f" No physically consistent values were found: {error}")
    found = replace(found, nearest=nearest)
    unsure = "" if nearest.accurate else " The solver is not sure that no real robot is nearer."
    replaced = draw_bodies(structure)[1] if cad_weight else ""
    found = replace(found, sentence=f"{unsure} {replaced}".rstrip())
    return with_values(found, model, leave_to_terms(structure, data.R, nearest.phi))


def with_values(found: PhysicalResult, model: FittedModel, phi: Array) -> PhysicalResult:
    """Return a result whose nearest physically consistent robot has other parameters, (p,)."""
    assert found.nearest is not None
    structure = model.structure
    values = name_each(structure.columns, phi)
    every = [values, *file_values(structure.robot, values)]
    base = np.array([[x[n] for n in values] for x in every]) @ structure.G.T
    nearest = replace(found.nearest, phi=phi)
    value = model.to_x @ phi
    return replace(found, nearest=nearest, value=value, base=base[0], in_files=base[1:])


def _believe(model: FittedModel, cad_weight: float) -> LeastSquares:
    """Return the least squares of a fit with rows for left-out parameters and the sidecar's priors.

    Bodies that are better known than by the divergence of that weight are held tighter.
    """
    data = model.data.beside(*model.left_out)
    rows, aim = state_rows(model.structure, 0.0, cad_weight)
    return data.beside(data.unit * rows, data.unit * aim)


# Can base parameters belong to a real robot? The answer with its proof.
#
# A vector ``beta`` of base parameters is feasible exactly when some full vector ``phi`` of the
# physical set has ``G phi = beta``. The proof of yes is that ``phi``; the proof of no is a
# combination of the base parameters that no real robot has below zero, and ``beta`` has
# [Boyd 2004, §5.8].


@frozen
class Certificate:
    """Whether base parameters are feasible, and the proof.

    Attributes
    ----------
    margin : float
        Largest margin (dimensionless) that all bodies and signs can keep at once, at most 1: more
        is not
        asked for.
    phi : (p,)
        Full parameters with these base parameters that attain it: consistent values when
        `feasible`, else the values that violate the conditions least.
    combination : (b,)
        Coefficients over the base parameters, zero when feasible: no physically consistent robot
        has ``combination @ beta`` below zero.
    value : float
        What was found of it.
    level : float
        Instead of zero, where masses or centres of mass are bounded.
    """

    margin: float
    phi: Array
    combination: Array
    value: float
    level: float = 0.0

    @property
    def feasible(self) -> bool:
        """Whether these base parameters are physically consistent.

        Bodies without volume have margin 0.
        """
        return self.margin >= -BOUNDARY

    def sentence(self, names: Sequence[str]) -> str:
        """Return the certificate in words.

        Parameters
        ----------
        names : (b,) str
            Names of the base parameters.
        """
        if self.feasible:
            return f"A real robot has these base parameters (margin {self.margin:.2g})."
        size = np.abs(self.combination)
        terms = [i for i in np.argsort(-size) if size[i] > RULES.left_out * size.max()]
        bounds = " within the bounds" if self.level else ""
        text = listing([f"{self.combination[i]:+.3g}·[{names[i]}]" for i in terms], 4)
        return (
            f"No real robot has exactly these base parameters. The sum of {text} is at least "
            f"{self.level:.3g} for any real bodies{bounds}, and {self.value:.3g} was found."
        )


def certify(base_map: Array, beta: Array, region: PhysicalSet) -> Certificate:
    """Decide whether base parameters can be physically consistent.

    Parameters
    ----------
    base_map : (b, p)
        ``G`` with ``beta = G phi``.
    beta : (b,)
        Base parameters.
    region : PhysicalSet
        What is possible.

    Raises
    ------
    ValueError
        When the solver finds no answer.
    """
    with one_thread():
        scale = _column_scale(base_map, beta, region)
        G = base_map * scale
        heights = or_one(np.linalg.norm(G, axis=1))
        unit_rows = G / heights[:, None]
        start = solve_least(unit_rows, beta / heights, ROUNDOFF)
        null = null_space(unit_rows, rcond=ROUNDOFF)
        rows = region.scaled_rows
        cones = region.cones
        u, margin, multiplier, Z = _most_room(
            rows @ null, rows @ start - region.least, cones @ null, cones @ start
        )
        phi = scale * (start + null @ u)
        if margin >= -BOUNDARY:
            return Certificate(margin, phi, np.zeros_like(beta), 0.0)
        force = np.einsum("kep,ke->p", cones, Z) + multiplier @ rows
        combination = solve_least(G.T, force)
        value = combination @ beta
        level = multiplier @ region.least
        return Certificate(margin, phi, combination, float(value), float(level))


def _most_room(
    rows: Array, slack: Array, maps: Array, at: Array
) -> tuple[Array, float, Array, Array]:
    """Return the u of the largest margin t, t, and the multipliers of rows and matrices.

    maximise t ≤ 1 over ``rows @ u + slack ≥ t`` and ``maps @ u + at ⪰ t 1``

    Parameters
    ----------
    rows, slack : (m, n) and (m,)
    maps, at : (k, 16, n) and (k, 16)
        Symmetric matrices of four by four, flattened.

    Returns
    -------
    (n,), float, (m,) and (k, 16)

    Raises
    ------
    ValueError
        When the solver finds no answer.
    """
    unit = np.eye(4).reshape(16, 1)
    one = np.broadcast_to(unit, (len(maps), 16, 1))
    last = np.eye(1 + rows.shape[1])[:1]
    no_square = np.zeros(last.size)
    no_rows = np.zeros((0, last.size))
    room = -np.ones((len(rows), 1))
    linear = np.vstack([-last, np.hstack([room, rows])])
    least = np.append(1.0, slack)
    cones = np.concatenate([-one, maps], axis=2)
    (t, *u), dual, Z, _ = solve_cones(
        "certificate", no_square, -last[0], no_rows, linear, least, cones, at
    )
    return np.array(u), float(t), dual[1:], Z


def _column_scale(G: Array, beta: Array, region: PhysicalSet) -> Array:
    # A column outside the bodies takes its scale from the base parameter it enters most.
    size = np.abs(G)
    share = size / or_one(size.max(axis=1, initial=0.0))[:, None]
    row = share.argmax(axis=0)
    most = size[row, np.arange(len(row))]
    known = ~region.inertial & (most > 0) & (beta[row] != 0)
    return np.where(known, np.abs(beta[row]) / or_one(most), region.scale)
