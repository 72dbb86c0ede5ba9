"""A nominal robot as a prior on the cone: the log-det divergence of each body.

Bodies are those of the robot file; a body without values in the file is replaced by a ball;
`state_mass` checks whether the total mass of the bodies is plausible.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, get_args

import numpy as np
from scipy.special import chdtrc

from identifiability.effects.base import apply_tilt
from identifiability.effects.registry import is_loaded
from identifiability.effects.vocabulary import (
    Kind,
    complete_values,
    file_kinds,
    file_values,
    values_not_in_file,
)
from identifiability.estimation.estimate import find_estimator, with_known
from identifiability.estimation.evidence import LEVELS
from identifiability.estimation.prediction import predict
from identifiability.foundation.engines import Engine
from identifiability.foundation.errors import listing
from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array, NumberByName, name_each
from identifiability.foundation.options import OptionError
from identifiability.foundation.values import Json, frozen
from identifiability.logs.prepare.dataset import Dataset
from identifiability.regression.information import gather_information
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot

from .fitted_model import LeastSquares
from .pseudo_inertia import BASIS, BOUNDARY, THIN, check_body, natural_scale, to_matrix
from .rules import RULES

# A nominal robot as a prior on the cone: the log-det divergence of each body.


#: Weights [σ²] of the path on which predictions choose, the heaviest first. At 10 a body three
#: times as heavy as the file's costs as much as a 3 σ deviation, at 0.01 as much as 0.1 σ: it
#: breaks ties and no more. Without any, undetermined bodies may have any mass.
WEIGHTS = tuple(10.0**k for k in range(5, -3, -1))

#: The one where nothing chooses.
WEAK = WEIGHTS[5]


@frozen
class CadPrior:
    """Log-det divergence from a nominal robot [Lee 2020], in units of the noise variance.

    Adds ``weight Σ_k [log det J0_k − log det J_k + tr(J0_k⁻¹ J_k) − 4]`` to ``rss / σ²``. It does
    not depend on units or frames, and is infinite at the edge of the cone. A nominal body that is
    flat or a rod counts as one of a little thickness, `THIN`.

    Attributes
    ----------
    phi : (p,)
        Nominal parameters; only the inertial ones count.
    weight : float
    """

    phi: Array
    weight: float = 1.0


def relative_to(theta: Array, name: str) -> Array:
    """Return the map (16, 10) to pseudo-inertias congruent to a nominal one, which becomes 1.

    Raises
    ------
    ValueError
        When the nominal body cannot exist or is a point; it is named.
    """
    inverse = np.linalg.inv(np.linalg.cholesky(thick_inertia(theta, name)))
    return np.einsum("ai,kij,bj->abk", inverse, BASIS, inverse).reshape(16, 10)


def thick_inertia(theta: Array, name: str) -> Array:
    """Return the pseudo-inertia (4, 4) of a nominal body, with some thickness where it has none.

    Parameters
    ----------
    theta : (10,) [kg m², kg m, kg]
    name : str

    Raises
    ------
    ValueError
        When the body cannot exist or is a point; it is named.
    """
    J = to_matrix(theta)
    if wrong := check_body(theta, name):
        raise ValueError(
            f"CAD prior: {wrong} A log-det prior needs bodies that can exist; correct the robot "
            "file."
        )
    mass = J[3, 3]
    first = J[:3, 3]
    second = J[:3, :3]
    shift = np.outer(first, first) / (mass or 1.0)
    spread, axes = np.linalg.eigh(second - shift)
    size = spread.sum()
    if not (mass > 0 and size > BOUNDARY * (size + first @ first / mass)):
        raise ValueError(
            f"CAD prior: {name}: the nominal body is a point or has no mass. A log-det prior needs "
            "bodies with extent; correct the robot file."
        )
    lacking = np.maximum(THIN * size - spread, 0.0)
    J[:3, :3] += (axes * lacking) @ axes.T
    return J


# Bodies within a share of the file's, as a normal prior.
#
# With J0 = P Pᵀ, a body is P (1 + E)(1 + E)ᵀ Pᵀ, E upper triangular: entries of E of standard
# deviation s make a body that is s heavier or lighter, and moves its mass by as much of its own
# size. To first order S = P⁻¹ (J - J0) P⁻ᵀ = E + Eᵀ, of variance 4 s² on the diagonal and s² off
# it; the log-det divergence is ½ ‖S‖², so the weight 1 / (2 s²) is that prior on the diagonal and a
# little wider off it.


def share_weight(share: float) -> float:
    """Return the weight of the divergence that keeps bodies within a share of the file's [σ²]."""
    return 1.0 / (2.0 * share**2)


def resolve_prior(
    share: float | None, cad_weight: float | None, commanded: bool
) -> tuple[float, float | None]:
    """Return the share within which bodies are the file's, 0 for none, and its prior's weight.

    Parameters
    ----------
    share, cad_weight : float or None
        As asked for.
    commanded : bool
        Whether torque comes from commands: a default share then applies if none is given.

    Raises
    ------
    OptionError
        If both are asked for.
    """
    if share is not None and cad_weight is not None:
        raise OptionError(Finding("prior.twice", weight=share_weight(0.2)))
    if share is None:
        share = RULES.body_within if commanded and cad_weight is None else 0.0
    return share, share_weight(share) if share else cad_weight


@frozen
class WithFile:
    """Joint estimate of the m parameters of a model from log and file.

    Attributes
    ----------
    share : float
        Within which the bodies are the file's.
    mean, sd : (m,)
        Infinite sd where neither log nor file determines a value.
    p_value : float
        Of the log, if the bodies are.
    """

    share: float
    mean: Array
    sd: Array
    p_value: float

    @property
    def words(self) -> str:
        """The prior belief about the file, in words."""
        if not self.share:
            return "the values of bodies and parameters in the sidecar"
        return f"that bodies are within {100 * self.share:g} % of the robot file's"

    @property
    def hint(self) -> str:
        """That the log contradicts the share; nothing if it does not."""
        # Level at which a log contradicts that share.
        if self.p_value >= 0.001:
            return ""
        return (
            f"The log contradicts {self.words} (p < 0.001): they differ by more, or the model "
            "lacks something that they stand for; give a larger --prior, or look with diagnose."
        )


def state_rows(structure: Structure, share: float, weight: float = 0.0) -> tuple[Array, Array]:
    """Return the priors in addition to a log, as rows about standard parameters of variance 1.

    Bodies lie within a share of the file's, or within the share that the sidecar states of one.
    Parameters follow the sidecar's ``[prior]``.

    Parameters
    ----------
    structure : Structure
    share : float
        0 for no prior on bodies without a stated share.
    weight : float
        Of a divergence from the file's bodies that is already in use: its share of the prior is
        subtracted.

    Returns
    -------
    rows : (r, p)
    aim : (r,)
    """
    robot = structure.robot
    p = len(structure.columns)
    nominal = draw_bodies(structure)[0]
    rows = [np.zeros((0, p))]
    aim = [np.zeros(0)]
    for stem, columns in zip(structure.bodies, structure.inertial, strict=True):
        own = robot.said.prior_share.get(stem.removesuffix("."), share)
        more = (share_weight(own) if own else 0.0) - weight
        if more <= 0:
            continue
        block = np.zeros((16, p))
        block[:, columns] = relative_to(nominal[columns], stem)
        rows.append(np.sqrt(0.5 * more) * block)
        aim.append(rows[-1] @ nominal)
    for name, (mean, sd) in robot.prior.items():
        if name in structure.columns:
            at = structure.columns.index(name)
            rows.append((np.arange(p) == at)[None] / sd)
            aim.append(np.array([mean / sd]))
    return np.vstack(rows), np.concatenate(aim)


def combine_with_file(
    structure: Structure, A: Array, aim: Array, to_x: Array, share: float
) -> WithFile:
    """Return the estimate of a model's parameters from a log together with the file's bodies.

    Parameters
    ----------
    structure : Structure
    A : (r, p), aim : (r,)
        Rows about the standard parameters, in standard deviations of their noise.
    to_x : (m, p)
        The model's parameters.
    share : float
    """
    B, prior = state_rows(structure, share)
    size = np.linalg.norm(np.vstack([A, B]), axis=0)
    size[size == 0] = 1.0  # of columns that neither determines
    U, s, Vt = np.linalg.svd(np.vstack([A, B]) / size, full_matrices=False)
    known = s > ROUNDOFF * s[0]
    root = (Vt[known].T / s[known]) / size[:, None]
    phi = root @ (U[:, known].T @ np.concatenate([aim, prior]))
    sd = np.linalg.norm(to_x @ root, axis=1)
    seen = Vt[known].T @ Vt[known]
    unknown = to_x * size @ (np.eye(len(size)) - seen)
    unknown_size = np.linalg.norm(unknown, axis=1)
    scale = np.linalg.norm(to_x * size, axis=1)
    lost = unknown_size > np.sqrt(ROUNDOFF) * scale
    off = B @ phi - prior
    squares = float(off @ off + np.sum((A @ phi - aim) ** 2))
    # Only common statements of both can disagree.
    ranks = [np.linalg.matrix_rank(rows / size, tol=ROUNDOFF) for rows in (A, B)]
    dims = int(sum(ranks) - known.sum())
    return WithFile(
        share, to_x @ phi, np.where(lost, np.inf, sd), float(chdtrc(dims, squares)) if dims else 1.0
    )


#: Fits at most until values that depend on their own loads have settled.
ROUNDS = 8


def load_by_fit(
    structure: Structure, regression: Regression, named: bool = False, *, engine: Engine
) -> Structure:
    """Return the structure with loads as a fit has them: the file may be wrong of its robot.

    Combinations of the bodies that the logs do not determine keep the file's values. Where no
    effect depends on loads nothing changes, unless an effect may be `named`.
    """
    loaded = is_loaded(structure.parameters)
    before = np.empty(0)
    rounds = ROUNDS if loaded else int(named)
    # Each leaves the share of an error that a scale is of the torque.
    for _ in range(rounds):
        rows = gather_information(regression, engine=engine)
        fit = find_estimator("wls").fit(rows := with_known(rows, structure.known))
        data = LeastSquares.of_fit(rows, fit).through(structure.G)
        both = data.R / data.unit, data.z / data.unit, np.eye(len(structure.columns))
        phi = combine_with_file(structure, *both, RULES.body_within).mean
        known = name_each(structure.columns, phi)
        loads = complete_values(structure.robot, known, keep=False)
        structure = with_loads(structure, loads)
        if loaded:
            regression = structure.regression(regression.samples)
        x = fit.value
        # Settled to a tenth of an error; other loads may make more base parameters identifiable.
        if x.shape == before.shape and np.all(np.abs(x - before) <= 0.1 * fit.sigma):
            break
        before = x
    return structure


def with_loads(structure: Structure, loads: NumberByName) -> Structure:
    """Return a structure whose loads follow standard parameters."""
    robot = replace(structure.robot, reference=loads)
    # Columns that do not depend on loads have the same groupings.
    if is_loaded(structure.parameters):
        return Structure.of(robot, structure.model)
    return Structure(robot, structure.model, structure.base)


# Bodies to which a prior may draw: those of the robot file, and others where it states none.


@lru_cache(maxsize=4)
def draw_bodies(structure: Structure) -> tuple[Array, str]:
    """Return the bodies at the centre of a structure's prior, and a sentence on replaced bodies.

    They are standard parameters (p,), of bodies that are all physically consistent and have extent.
    A body that the file does not state is a ball about the origin of its frame, as light as the
    lightest stated body; if its mass alone is stated, it has that mass and is where the file says.
    A load is as the body that carries it.
    """
    phi = structure.nominal.copy()
    bodies = structure.bodies
    loads = {stem: stem.removesuffix("payload_") for stem in bodies if stem.endswith(".payload_")}
    at = dict(zip(bodies, structure.inertial, strict=True))
    sound = [stem for stem in bodies if stem not in loads and _exists(phi[at[stem]])]
    mass, length = natural_scale(phi[[at[stem] for stem in sound]].reshape(-1, 10))
    least, size = (float(mass.min()), float(np.median(length))) if sound else (1.0, 0.1)
    replaced = [stem for stem in bodies if stem not in loads and stem not in sound]
    for stem in replaced:
        phi[at[stem]] = ball(phi[at[stem]], least, size)
    for stem, carrier in loads.items():
        phi[at[stem]] = phi[at[carrier]] if carrier in at else ball(np.zeros(10), least, size)
    phi.flags.writeable = False
    if not replaced:
        return phi, ""
    return phi, (
        "The robot file states no body with mass and possible moments for "
        f"{listing([bodies[stem] for stem in replaced], 4)}: where the logs are silent they are "
        "drawn to light balls."
    )


def _exists(theta: Array) -> bool:
    try:
        thick_inertia(theta, "")
    except ValueError:
        return False
    return True


def ball(theta: Array, mass: float, length: float) -> Array:
    """Return a ball (10,) with the mass and centre of a body if it has a mass."""
    own = float(theta[9]) > 0
    mass, centre = (float(theta[9]), theta[6:9] / theta[9]) if own else (mass, np.zeros(3))
    spread = length**2 * np.eye(3) + np.outer(centre, centre)  # ∫ r rᵀ dm / m
    moments = mass * (np.trace(spread) * np.eye(3) - spread)
    entries = moments[np.triu_indices(3)]
    return np.array([*entries, *(mass * centre), mass])


# Whether the bodies of a physically consistent robot have plausible masses, compared with the robot
# file.


def state_mass(
    robot: Robot, parameters: NumberByName, cad_weight: float = 0.0, missing: str = ""
) -> str:
    """Return a warning about the total mass of a robot, with its remedy; empty if it is plausible.

    Reports state this warning first. A robot that is many times too heavy or too light may predict
    torque well along the fitted motion, and still move wrongly in a simulator.

    Parameters
    ----------
    robot : Robot
    parameters : mapping
        Standard parameters by name.
    cad_weight : float
        Weight of the prior that they were found with.
    missing : str
        The effects that their model surely lacks, as the start of a sentence. They come first.
    """
    rows = mass_rows(robot, parameters)
    mass = total_mass(robot, parameters)
    stated = total_mass(robot, robot.nominal)
    alike = stated / RULES.another_robot <= mass <= RULES.another_robot * stated
    heavy = [
        f" ({row['body']} {row['mass']:.4g} kg, by the file {row['mass_file']:.4g} kg)"
        for row in rows
        if row["mass"] > max(stated, RULES.another_robot * row["mass_file"])
    ]
    if robot.guessed or not (stated > 0 and rows) or (alike and not heavy):
        return ""
    weighs = (
        f"nearest physically consistent robot weighs {mass:.4g} kg, that of the robot file "
        f"{stated:.4g} kg{''.join(heavy)}"
    )
    if missing:
        return (
            f"{missing[0].upper()}{missing[1:]}, and the {weighs}: masses may take the place of "
            "what is missing. Complete the model (diagnose) before you believe or export masses."
        )
    return (
        f"The {weighs}: identified masses disagree with the file's. Check a mass of the file, a "
        "spring or counterweight, gravity (its direction, a compensation), a unit, a torque scale "
        f"and an encoder's zero. Or --set cad_prior={10 * cad_weight or WEAK:g} keeps it nearer to "
        "the file's proportions."
    )


def mass_rows(robot: Robot, parameters: NumberByName) -> list[Json]:
    """Return of each body and of all its mass and the robot file's [kg].

    Parameters
    ----------
    robot : Robot
    parameters : mapping
        Standard parameters by name; empty where no physically consistent values were found.
    """
    rows = []
    for body in robot.bodies:
        names = (f"{body}.m", f"{body}.payload_m")
        masses = [parameters[name] for name in names if name in parameters]
        nominal = float(robot.nominal.get(f"{body}.m", 0.0))
        if masses:
            rows.append({"body": body, "mass": sum(masses), "mass_file": nominal})
    return rows


def total_mass(robot: Robot, parameters: NumberByName) -> float:
    """Return the mass of all moving bodies with their payloads [kg]."""
    return float(sum(row["mass"] for row in mass_rows(robot, parameters)))


def find_rises(real: Mapping[str, Any], kind: str) -> dict[str, tuple[float, float]]:
    """Return where a robot file errs more than the robot's own file, with the errors of both.

    Rises without evidence are left out.

    Parameters
    ----------
    real : mapping
        Of `real_robot_dict`, with the errors on unseen motion.
    kind : {"mjcf", "urdf"}
        Format that is written; files of one format are compared.

    Returns
    -------
    dict
        Of "fitted" and "unseen" motion, the errors of the written file and of the robot's.
    """
    names = {
        "fitted": ("error_ra_files", "error_ra_given_files"),
        "unseen": ("error_ra_validation_files", "error_ra_validation_given_files"),
    }
    errors = {
        rows: (real.get(written, {}).get(kind), real.get(stated, {}).get(kind))
        for rows, (written, stated) in names.items()
    }
    return find_larger(errors)


def find_larger(
    errors: Mapping[str, tuple[float | None, float | None]],
) -> dict[str, tuple[float, float]]:
    """Return the pairs whose first error is larger than the second, with evidence."""
    larger = {}
    for rows, (new, before) in errors.items():
        if new is None or before is None:
            continue
        limit = (1.0 + LEVELS.rise) * before + LEVELS.least_rise
        if new > limit:
            larger[rows] = new, before
    return larger


def real_robot_dict(
    structure: Structure,
    parameters: NumberByName,
    errors: Sequence[float] = (np.nan,) * 5,
    samples: Sequence[Dataset] = (),
    cad_weight: float = 0.0,
) -> Json:
    """Return a physically consistent robot as plain values, as `export` reads them.

    Parameters
    ----------
    structure : Structure
        Of the robot whose file it is written to.
    parameters : mapping
        Standard parameters by name; empty where no physically consistent values were found.
    errors : (5,)
        ε_RA on the fitted logs, of all parameters and of what a robot file holds of them: one of
        the robot's own format, and one of the other. Then of such files as the robot is stated.
        Where they are not given, or gravity is tilted, they are measured.
    samples : sequence of Dataset
        The fitted logs.
    cad_weight : float
        Of the prior that it was found with.
    """
    robot = structure.robot
    own, other = file_kinds(robot)
    # Files keep the values that no sensor observes.
    unobserved = {p.name: robot.nominal.get(p.name, 0.0) for p in structure.unobserved}
    tilt = apply_tilt(robot, parameters)[0].tilt
    if samples and parameters and (tilt is not None or np.isnan(errors[0])):
        errors = _measure_errors(structure, samples, parameters)
    return {
        **({} if tilt is None else {"gravity": tilt.to_dict()}),
        "error_ra": errors[0],
        "error_ra_file": errors[1],
        "file": own,
        "error_ra_files": {own: errors[1], other: errors[2]},
        "error_ra_given_files": {own: errors[3], other: errors[4]},
        "mass": total_mass(robot, parameters) if parameters else None,
        "mass_file": total_mass(robot, robot.nominal),
        "masses": mass_rows(robot, parameters),
        "cad_prior": cad_weight,
        "shapes": dict(structure.shapes) if parameters else {},
        "reference": dict(robot.reference) if is_loaded(structure.parameters) else {},
        "parameters": unobserved | dict(parameters) if parameters else {},
        "lost": _find_lost_peaks(structure, samples, parameters),
    }


def _find_lost_peaks(
    structure: Structure, samples: Sequence[Dataset], values: NumberByName
) -> Json:
    """Return the largest torque that each file format cannot hold, and its joint; else nothing.

    Parameters
    ----------
    structure : Structure
    samples : sequence of Dataset
        The fitted logs: the torque is that of their motion [N·m or N].
    values : mapping
        Standard parameters by name.
    """
    robot, rest = apply_tilt(structure.robot, values)
    effects = [(e, {p.name for p in e.parameters(robot)}) for e in structure.model.effects]
    peaks: Json = {}
    for kind in get_args(Kind) if samples else ():
        lost = values_not_in_file(robot, rest, kind)
        having = [effect for effect, names in effects if names & {*lost}]
        regression = Regression(robot, Model(tuple(having)), tuple(samples))
        peaks[kind] = _find_peak(regression, lost) if having else None
    return peaks


def _find_peak(regression: Regression, values: NumberByName) -> Json:
    """Return the largest torque that some parameters have along logs, and its joint."""
    names = [p.name for p in regression.model.parameters(regression.robot)]
    phi = np.zeros((len(names), 1))
    for name, value in values.items():
        if name in names:
            phi[names.index(name)] = value
    found = predict(regression, phi)
    robot = regression.robot
    peaks = np.abs(found.predicted[:, :, 0] * found.data).max(axis=0, initial=0.0)
    most = int(np.argmax(peaks))
    return {"joint": robot.joints[most], "torque": float(peaks[most])}


def _measure_errors(
    structure: Structure, samples: Sequence[Dataset], values: NumberByName
) -> Sequence[float]:
    """Return ε_RA of a robot, of its values in each file format, and of the nominal ones, (5,).

    Nominal values are also those in each file format. Their errors are NaN for a tilted base, which
    files do not state. Gravity pulls at the bodies that were found, along where it points; the
    columns of a tilt are those of the file's bodies, and to first order.

    Parameters
    ----------
    structure : Structure
    samples : sequence of Dataset
    values : mapping
        Standard parameters by name.
    """
    robot, rest = apply_tilt(structure.robot, values)
    accounts = [rest, *file_values(robot, rest), *file_values(robot, robot.nominal)]
    rows = [[f.get(name, 0.0) for name in structure.columns] for f in accounts]
    phi = np.array(rows).T
    first = [structure.columns.index(n) == k for k, n in enumerate(structure.columns)]
    counted_once = phi * np.array(first)[:, None]
    regression = Regression(robot, structure.model, tuple(samples))
    if robot.tilt is None:  # bodies along the base columns were computed already
        regression = replace(regression, columns=structure.base.kept)
        errors = predict(regression, structure.G @ counted_once).relative_error()
    else:
        errors = predict(regression, counted_once).relative_error()
        errors[3:] = np.nan
    return list(errors)
