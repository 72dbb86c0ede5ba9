"""Find a motion that is worth measuring."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np

from identifiability.effects import default_effects
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.engines import Engine, Serial, one_thread
from identifiability.foundation.errors import ClosureError
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array
from identifiability.foundation.options import (
    MOST_SAMPLES,
    Count,
    Duration,
    Harmonics,
    Names,
    Seed,
    check_option,
    checked,
    counted,
)
from identifiability.foundation.runs import Progress, Run, quiet
from identifiability.logs.prepare import Preparation
from identifiability.quality.recordings import Logs
from identifiability.regression.reduction import USUAL_EFFECTS, ModelLike, choose_model, free_again
from identifiability.regression.structure import Structure
from identifiability.robot import RobotLike
from identifiability.workflows.case import MEASURED, Case, Data, take_case
from identifiability.workflows.provenance import state_provenance

from .criteria import Known, LogDet, Question, gather_known, know_nothing, pose_question, scaled
from .limits import CLEARANCE, Drive, LimitsLike, Workspace, find_limits, limit_by_logs
from .result import Excitation, Merit
from .search import OPEN, Objective, Search, Series, search


@checked
def excite(
    robot: RobotLike | Case,
    *,
    harmonics: Harmonics = DEFAULTS.harmonics,
    duration: Duration | None = None,
    samples: int = DEFAULTS.samples,
    limits: LimitsLike | None = None,
    parameters: Names | None = None,
    model: ModelLike | None = None,
    start_from: Logs | None = None,
    separate: Names | None = None,
    preparation: Preparation | None = None,
    evaluations: Count = DEFAULTS.evaluations,
    seed: Seed = 0,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> Excitation:
    """Find a periodic motion within limits that determines parameters well.

    Parameters
    ----------
    robot : Robot, path, shipped name, or Case
        The motion is the best one to measure after the fitted logs of a case, about its model.
    harmonics : int
        Harmonics of the finite Fourier series [Swevers 1997].
    duration : float [s], optional
        The period, by default `DEFAULTS.period`.
    samples : int
        Samples a period; all of them are checked.
    limits : mapping, path or None
        Replaces limits of the robot file: ``{"joint1": {"q": [-1, 1], "v": 2, "a": 10}}``, or a
        TOML file with JOINT = {q = [low, high], v = speed, a = acceleration, tau = torque,
        power = power}.
    parameters : sequence of str, optional
        Base parameters about which the log-determinant of the information is made large; by
        default all.
    model : Model, sequence of str, path of a model file or result of `prune`, optional
        Effects of the model; parameters that a model file omits, fixes or ties are free. By default
        rigid bodies, viscous and Coulomb friction and actuator inertia; of a case, the model that
        `analyze` reduces.
    start_from : log, path, DataFrame, or several
        Log that was measured already: the motion is the best one to measure next.
    separate : two of str
        Effect to tell from another, everywhere (``stribeck_friction``) or at one place
        (``joint_stiffness@joint1``); two are given.
    preparation : Preparation, optional
        How derivatives of the logs are made.
    evaluations : int
        Largest number of evaluated motions, after the first random ones. The same number gives the
        same motion on every machine of a kind.
    seed : int
    progress : callable(str, float), optional
    engine : Engine, optional
        Where logs to start from are read, if they are long; here by default.

    Raises
    ------
    IdentifiabilityError
        With one sentence on what to do.

    Example
    -------
    >>> motion = excite("two-link", evaluations=200, seed=1)
    >>> motion.after.figure > motion.before.figure
    True
    """
    check_option("samples", samples, Annotated[int, counted(4 * harmonics + 1, MOST_SAMPLES)])
    run = Run(progress or quiet, engine or Serial(), seed)
    with one_thread("blas"):
        case = take_case(robot, () if start_from is None else start_from, (), preparation, MEASURED)
        case.robot.check_stands("designing a motion")
        run.say("reading logs", 0.0)
        ask = partial(pose_question, parameters=parameters, separate=separate)
        planned = samples if start_from is None and not case.logs else None
        question, known, data = _pose(ask, case, robot, model, run, planned)
        measured = data.samples if data else ()
        bounds = limit_by_logs(find_limits(question.structure.robot, limits), measured)
        series = Series(bounds, duration or DEFAULTS.period, harmonics)
        found = find_motion(question, known, series, run, samples, evaluations)
    return _complete(found, case, data, model, evaluations)


def _pose(
    ask: Callable[[Structure], Question],
    case: Case,
    given: RobotLike | Case,
    model: ModelLike | None,
    run: Run,
    planned: int | None,
) -> tuple[Question, Known, Data | None]:
    """Return the question about a robot as logs show it, their information, and the logs.

    Parameters
    ----------
    ask : callable
    case, given, model, run
        Without a model, that of a case that was given.
    planned : int or None
        Samples of the first log; None where there are logs.
    """
    if model is None and isinstance(given, Case):
        structure = case.first_structure(run)
    else:
        usual = default_effects(case.robot, USUAL_EFFECTS)
        structure = Structure.of(case.robot, choose_model(model, usual))
    question = ask(structure)  # wrong arguments are refused before logs are read
    if planned is not None:
        return question, know_nothing(question, planned), None
    data = case.data(structure, run)
    question = ask(data.structure)
    alone = question.model is data.structure.model  # then the case has the same columns
    along = data.regression if alone else question.along(data.samples)
    return question, gather_known(along), data


def _complete(
    found: Excitation, case: Case, data: Data | None, model: ModelLike | None, evaluations: int
) -> Excitation:
    """Return a motion with remarks on its logs and model, and its provenance."""
    logs, hints = (data.samples, data.hints) if data else ((), ())
    options = {"evaluations": evaluations, "preparation": case.preparation or Preparation()}
    provenance = state_provenance(found.robot, logs, found.seed, None, options)
    hints = (*hints, *free_again(model), *found.hints)
    return replace(found, hints=hints, provenance=provenance)


def find_motion(
    question: Question,
    known: Known,
    series: Series,
    run: Run,
    samples: int,
    evaluations: int,
    name: str = "excite",
) -> Excitation:
    """Find the motion that answers a question best, given earlier information.

    Parameters
    ----------
    question : Question
    known : Known
        Information of logs that were measured already.
    series : Series
        All motions that may be found.
    run : Run
    samples, evaluations : int
        As for `excite`.
    name : str
        Of the motion.

    Raises
    ------
    IdentifiabilityError
        If no candidate keeps the workspace.
    """
    drive = Drive.of(question, series.limits, known.values)
    objective = Objective(question, known, series, min(samples, series.looks), drive)
    aim = question.criterion

    sooner = f"--set evaluations={evaluations // 4} takes a quarter of the time"

    def show(cost: float, share: float) -> None:
        run.say(f"{aim.title}: {aim.figure(cost):.4g} ({sooner})", min(share, 0.99))

    found = search(objective, np.random.default_rng(run.seed), evaluations=evaluations, say=show)
    x, space, gap = _best(objective, found, samples)
    middle = _middle(found)
    noisy = objective if known.logs else _with_noise(objective, middle, samples)
    before, after = (
        _judge(objective, noisy, motion, samples) for motion in (None if known.logs else middle, x)
    )
    return Excitation(
        robot=question.structure.robot,
        trajectory=series.trajectory(x, samples, name),
        criterion=aim,
        effects=question.model.names,
        names=question.names,
        units=question.units,
        chosen=question.chosen,
        logs=known.logs,
        before=before,
        after=after,
        limits=series.limits,
        drive=drive,
        torque=objective.torque(x, samples),
        closure=float(space.condition[0]),
        gap=gap,
        evaluations=found.evaluations,
        seed=run.seed,
        hints=tuple(filter(None, objective.watched[1:])),
    )


def _judge(objective: Objective, noisy: Objective, x: Array | None, samples: int) -> Merit:
    """Return the merit of a motion; None means the motion of the logs, measured again.

    Parameters
    ----------
    objective, noisy : Objective
        With noise that is white, and of its actual size.
    x : (size,) or None
    samples : int
    """
    known = objective.known
    question = objective.question
    plain, sized = (
        known.repeated if x is None else each.look(x, samples)[0][0] for each in (objective, noisy)
    )
    aim = question.criterion
    asked = aim.chosen if isinstance(aim, LogDet) else np.arange(len(question.names))
    spread = _sigma(sized)
    limit = Thresholds().sigma_percent / 100 * np.abs(known.values)
    told = ((spread > 0) & (spread <= limit))[asked]
    costs = aim.cost(plain[None])
    return Merit(aim.figure(float(costs[0])), _sigma(plain), told)


def _best(objective: Objective, found: Search, samples: int) -> tuple[Array, Workspace, float]:
    """Return the best candidate that keeps the workspace at all samples.

    The last value is the least distance of unconnected bodies [m].
    """
    cheapest = np.argsort(found.costs)[:10]
    order = [k for k in cheapest if found.costs[k] < OPEN]
    for x in [*(x for _, x in found.found), *found.draws[order]]:
        space = objective.look(x, samples)[1]
        gap = float(objective.gaps(x, samples).min())
        if space.kept(objective.limits.closure_bound)[0] and gap >= CLEARANCE:
            return x, space, gap
    robot = objective.question.structure.robot
    place = {"robot": robot.name, "home": robot.describe_home()}
    bounds = {"bound": objective.limits.closure_bound, "gap": 1000 * CLEARANCE}
    raise ClosureError(Finding("excite.none", **place, **bounds))


def _middle(found: Search) -> Array:
    """Return the random motion in the middle of all that keep the workspace."""
    order = [k for k in np.argsort(found.costs) if found.costs[k] < OPEN]
    return found.draws[order[len(order) // 2]]


def _with_noise(objective: Objective, x: Array, samples: int) -> Objective:
    """Return the objective in units of white noise of a share of the file's torque along x."""
    known = objective.known
    alone = (replace(known, weights=one) for one in np.eye(len(known.weights)))
    objectives = [replace(objective, known=one) for one in alone]
    each = (o.look(x, samples)[0][0] for o in objectives)
    # Where no log tells it, 5 % of each joint's torque (rms) is expected.
    noise = 0.05**2 / samples * np.array([known.values @ G @ known.values for G in each])
    weights = np.divide(1.0, noise, out=np.zeros_like(noise), where=noise > 0)
    return replace(objective, known=replace(known, weights=weights))


def _sigma(G: Array) -> Array:
    """Return standard deviations; a direction that nothing excites gets a large one."""
    unit, length = (part[0] for part in scaled(G[None]))
    inverse = np.linalg.pinv(unit, rcond=1e-13, hermitian=True)
    return np.sqrt(np.maximum(np.diag(inverse), 0.0)) / length
