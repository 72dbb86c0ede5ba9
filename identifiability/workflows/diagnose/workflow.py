"""`diagnose`: find, name, add, verify; each stage can be called by itself.

A large tilt of the base is found before all else, since about the file's direction of gravity it
looks like much that it is not: the diagnosis is then of the model under the gravity that was found,
and the tilt is the first of its names. A small one is a name like others; its direction is settled
at the end.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from identifiability.effects import default_effects, find_families
from identifiability.effects.gravity import TILTS, GravityTilt, horizontal_axes
from identifiability.effects.measurement import CommandDelay
from identifiability.effects.nominal import gravity_torque
from identifiability.effects.registry import title_of
from identifiability.estimation.estimate import Outliers, estimate, find_estimator
from identifiability.estimation.prediction import Prediction, predict
from identifiability.foundation.engines.mapping import Engine, Serial, one_thread
from identifiability.foundation.names import BASE
from identifiability.foundation.options import (
    Effects,
    Seed,
    Simulated,
    checked,
    renamed,
    settle_count,
)
from identifiability.foundation.values import frozen
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation, Samples
from identifiability.physical.cad_prior import share_weight
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import (
    USUAL_EFFECTS,
    ModelLike,
    choose_model,
    free_again,
    unused_ladder,
)
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.robot.kinematics import shortest_turn
from identifiability.workflows.analyze.fit import say_band
from identifiability.workflows.diagnose.changes import (
    change_beside,
    change_first,
    leave_out,
    stays_beside,
    without_outliers,
)
from identifiability.workflows.diagnose.conclude import conclude, null_odds
from identifiability.workflows.diagnose.findings import NamedEffect, Placement, Shown
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.hypothesis import Hypothesis
from identifiability.workflows.diagnose.known_values import (
    Given,
    KnownValues,
    know_fit,
    know_share,
    near_file,
    read_given,
)
from identifiability.workflows.diagnose.motion import (
    OddLog,
    along_rollouts,
    assign_roles,
    describe_odd_log,
    prepare_rows,
    samples_each,
    still_odd,
)
from identifiability.workflows.diagnose.problem import Problem, Setting
from identifiability.workflows.diagnose.result import Diagnosis, simulate_forward
from identifiability.workflows.diagnose.rules import RULES, Rules
from identifiability.workflows.diagnose.search import Search
from identifiability.workflows.diagnose.verdict import Verdict, refute_worse, settle
from identifiability.workflows.gravity import Leaning, find_leaning, settle_tilt
from identifiability.workflows.oddities import MeasuredLogs
from identifiability.workflows.opening import (
    Logs,
    Opening,
    Progress,
    Recordings,
    in_memory,
    quiet,
    read_recordings,
    require_signal,
    state_provenance,
)
from identifiability.workflows.session import (
    Session,
    settle_gains,
    settle_prior,
    weigh_rows,
    where_outlying,
)

#: Simulated noises.
DRAWS = 199

#: What is to be known of values that are kept without their errors.
EXACT = (
    "The robot file's values were taken as exact, so that their errors may be named as effects: "
    "give the result that they come from (--fixed-from RESULT.json) or how far they may be off "
    "(--fixed-share 0.1)."
)

#: The model that is diagnosed when none is given.
BASE_EFFECTS = USUAL_EFFECTS


@renamed(draws="replicates")
@checked
def diagnose(
    robot: RobotLike,
    logs: Logs,
    validate: Logs = (),
    *,
    effects: Effects | None = None,
    model: ModelLike | None = None,
    fixed: Given = False,
    preparation: Preparation | None = None,
    rules: Rules | None = None,
    replicates: Simulated | None = None,
    seed: Seed = 0,
    quick: bool = False,
    forward: bool = True,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> Diagnosis:
    """Find where model and data disagree, name what is missing, add it, verify.

    Parameters
    ----------
    robot : Robot, path or shipped name
    logs : log, path, DataFrame, or several
        What the model is fitted to and effects are named from.
    validate : the same, optional
        Logs that are not fitted: they may refute a name, and measure the gap. Without any, the last
        log (or the last quarter of the only one) is set aside.
    effects : iterable of str, optional
        Families that may be named, such as stribeck_friction; by default all that are registered.
    model : Model, sequence of str, path of a model file or result of `prune`, optional
        Effects of the model to diagnose; by default rigid body, viscous and symmetric Coulomb
        friction and actuator inertia. What a model file leaves out, holds or ties is free.
    fixed : bool, float, path, Fit or result
        Keep values instead of refitting them; then wrong masses, payloads and gravity are
        candidates too. True: those of the robot file, as if they were exact. A share: those of the
        robot file, which may be off by it, such as 0.1 (a standard deviation). A result: those of
        an `analyze`, `prune` or `diagnose`, of its JSON or its `Fit`, with their covariance, for
        the model that is diagnosed. What these errors explain is no effect.
    preparation : Preparation, optional
        How derivatives are made.
    rules : Rules, optional
        Thresholds.
    replicates : int, optional
        Simulated noises; the smallest p-value, an upper bound, is 1 / (replicates + 1). By default
        199, or 99 if `quick`.
    seed : int
    quick : bool
        Fewer replicates, where nobody says how many.
    forward : bool
        Also simulate the motion that verifies, before and after what was named (half a second).
    progress : callable(str, float), optional
    engine : Engine, optional
        Where logs are prepared; here by default. The result does not depend on it.

    Raises
    ------
    IdentifiabilityError
    """
    say, draws = progress or quiet, settle_count(replicates, DRAWS, DRAWS // 2, quick=quick)
    streams = tuple(np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(6))
    rules = rules or RULES
    find_families(effects)  # what is misspelt is told before logs are read
    with one_thread():
        robot = Robot.of(robot)
        say("reading logs", 0.0)
        robot = settle_gains(robot, logs)
        given = read_recordings(logs, validate, Conventions.of(robot), preparation, commands=True)
        commanded = given.commanded
        if commanded and isinstance(fixed, int | float) and fixed is not True:
            near, fixed = settle_prior(fixed if fixed is not False else None, None, True)[0], False
        else:
            near = 0.0
        structure, known = _settle_values(robot, model, fixed, commanded=commanded)
        session = Session(structure, given, preparation, say, engine or Serial())
        weight = share_weight(near) if near else None
        given = session.follow_fitted(np.random.default_rng(seed), cad_weight=weight).recordings
        opened = partial(
            _open,
            session,
            rules=rules,
            fixed=fixed is not False,
            known=known,
            near=near,
            commanded=commanded,
            seed=seed,
        )
        asked = _Asked(effects, say, draws, streams)
        looked = asked.look(opened(given))
        later = common_delay(looked.found)
        if later and robot.servo is not None:
            given = given.acting_later(robot.servo, later)
            looked = asked.look(opened(given))
        found, doubts, setting, opening, leaning = looked
        found = (
            settle_named(found)
            if leaning is None
            else lead_with_tilt(found, session.structure, leaning, 1.0 / (draws + 1), streams[2])
        )
        options = {
            "effects": "all" if effects is None else list(effects),
            "fixed": fixed is True if known is None else known.words,
            **({"prior": near} if near else {}),
            "rules": setting.rules,
            "replicates": draws,
            "quick": quick,
            "preparation": preparation or Preparation(),
        }
        used = [*setting.samples, *setting.validation]
        kept = (EXACT,) if fixed is True else ()
        believed = () if setting.near is None else (setting.near.hint,)
        band = () if commanded else say_band(setting.preparation)  # it is calibrated in this one
        hints = (*kept, *believed, *doubts, *opening.hints, *band)
        found = replace(
            found,
            nothing="" if setting.fixed else opening.misread,
            hints=(*hints, *free_again(model), *unused_ladder(robot, model)),
            provenance=state_provenance(robot, used, seed, None, options),
        ).moved_by(given)
        if not (forward and found.effects) or found.robot.base is not None:
            return found
        say("simulating forward", 0.95)
        return replace(found, forward=simulate_forward(found, streams[3]))


class _Opened(NamedTuple):
    """What is diagnosed, from what, and where gravity points if not where the file says."""

    setting: Setting
    opening: Opening
    leaning: Leaning | None


class _Looked(NamedTuple):
    """A diagnosis, which logs and stretches of them are doubted, and of what it is."""

    found: Diagnosis
    doubts: list[str]
    setting: Setting
    opening: Opening
    leaning: Leaning | None


def _open(
    session: Session,
    given: Recordings,
    rules: Rules,
    *,
    fixed: bool,
    known: KnownValues | None,
    near: float,
    commanded: bool,
    seed: int,
) -> _Opened:
    """Return what is diagnosed.

    Values that are fixed are those of the file, and its direction of gravity is one of them.
    """
    roles, robot = assign_roles(given.fitted, given.held_out, rules), session.structure.robot
    parts = Recordings(roles.fit, roles.verify, given.hints)
    session = replace(session, recordings=parts)
    how = session.preparation if session.how.cutoff is None else session.how
    most = samples_each(map(len, roles.fit))
    opening = session.open("diagnosed", partial(prepare_rows, robot, how=how, most=most))
    if given.rolled is not None:
        both = ((opening.samples, roles.fit), (opening.validation, roles.verify))
        along = [along_rollouts(opening.structure, s, logs, given.values) for s, logs in both]
        opening = replace(opening, samples=along[0], validation=along[1])
    fit, verify = (in_memory(s, Samples) for s in (opening.samples, opening.validation))
    require_signal(verify, "verified")
    leaning = None
    if not fixed:
        leaning = find_leaning(MeasuredLogs(opening.structure, roles.fit, opening.samples))
    if leaning is not None:
        opening = opening.under(leaning.structure, roles.fit)
    session.say("building columns", 0.1)
    setting = Setting(
        structure=opening.structure,
        samples=tuple(fit),
        validation=tuple(verify),
        fixed=fixed,
        chosen_by="by the evidence of the fitted logs",
        verified_on=roles.verified_on,
        rules=rules,
        preparation=how or Preparation(),
        known=known,
        near=near_file(near, opening.structure) if near else None,
        commanded=commanded,
        seed=seed,
    )
    return _Opened(setting, opening, leaning)


def _name(asked: _Asked, setting: Setting, opening: Opening) -> tuple[Diagnosis, list[str]]:
    """Name effects, and say which logs and stretches of them are doubted."""
    if setting.fixed:
        return asked.run(setting), []
    odd, decided, outliers = _doubt_logs(opening)
    # Rows that hardly count are no data for names, unless a change or a name explains them: bursts
    # of 7 to 30 rows weigh at most .05, the worst rows of twelve sound logs .16 and more.
    if outliers is not None and (outliers := outliers.below(0.1)) is not None:
        first = asked.run(setting)
        if first.changes or not _still_outlying(first, outliers):
            return first, [decided] * bool(decided)
        where = where_outlying(opening.robot.joints, opening.samples, outliers)
        decided = decided or f"{where} was left out. Look at what happened there."
        setting = without_outliers(setting, outliers)
    if odd is None:
        return asked.run(setting), [decided] * bool(decided)
    found, said = asked.run_doubted(setting, odd)
    return found, [x for x in (said, decided) if x]


def _still_outlying(found: Diagnosis, outliers: Outliers) -> bool:
    """Whether stretches lie out under the model with what was named, too."""
    joints, wls = found.robot.joints, find_estimator("wls")
    information = gather_information(found.completed.regression(found.samples, keep=True))
    again = weigh_rows(joints, found.samples, information, wls)[2]
    if again is None:
        return False
    same = again.log[:, None] == outliers.log
    begun = again.first[:, None] < outliers.last
    return bool((same & begun & (outliers.first < again.last[:, None])).any())


@frozen
class _Asked:
    """How effects are looked for in some samples.

    Attributes
    ----------
    effects : iterable of str or None
        Families that may be named.
    say : callable(str, float)
    draws : int
        Simulated noises.
    streams : tuple of numpy.random.Generator
    """

    effects: Effects | None
    say: Progress
    draws: int = DRAWS
    streams: tuple[np.random.Generator, ...] = ()

    def look(self, opened: _Opened) -> _Looked:
        """Name what is missing in opened logs."""
        setting, opening, leaning = opened
        # Values that are kept are those of the file, and a wrong scale or sign is an effect.
        asked = self if setting.fixed or not opening.misread else replace(self, effects=())
        return _Looked(*_name(asked, setting, opening), setting, opening, leaning)

    def run(self, setting: Setting) -> Diagnosis:
        """Name what is missing, add it, verify."""
        search, verdict = self._settle(setting)
        self.say("verifying", 0.9)
        null = null_odds(search, self.draws, self.streams[0])
        return conclude(search, verdict, null, self.streams[2])

    def _settle(self, setting: Setting) -> tuple[Search, Verdict]:
        """Return what stands, and the search for it, in logs without what changed in their midst.

        A change that explains more than any name is left out before names are looked for; it must
        be there beside these all the same.
        """
        effects = self.effects
        search = Search(Problem(setting, effects), self.say)
        self.say("naming effects", 0.3)
        change, goes_first = change_first(search, effects)
        without = leave_out(setting, change) if change is not None and goes_first else None
        if without is not None:
            later, verdict = self._settle(without)
            named = [later.problem.candidates[k] for k in verdict.hypothesis.parts]
            if stays_beside(search, named, effects):
                return later, verdict
        verdict = refute_worse(search, settle(search, Hypothesis()), self.streams[4])
        change = change_beside(search, verdict, change, effects)
        without = None if change is None else leave_out(setting, change)
        return (search, verdict) if without is None else self._settle(without)

    def run_doubted(self, setting: Setting, odd: OddLog) -> tuple[Diagnosis, str]:
        """Name effects without a log that disagrees, unless what is named with it explains it.

        A log whose motion alone shows what is missing disagrees as well, and is the one that says
        most: then no log disagrees any more under the model with what was named. A log that is not
        fitted stays where it is.

        Returns
        -------
        found : Diagnosis
        said : str
            What became of the log.
        """
        found = self.run(setting)
        held_out = odd.number >= len(setting.samples)
        logs = (*found.samples, *found.validation)
        explained = found.effects or found.changes
        if len(found.samples) < len(setting.samples):
            return found, ""
        if explained and not still_odd(found.completed, logs, odd.number):
            return found, odd.kept
        if held_out:
            return found, odd.doubted
        samples = tuple(s for k, s in enumerate(setting.samples) if k != odd.number)
        found = self.run(replace(setting, samples=samples, left_out=(odd.name,)))
        return found, odd.left_out


def _doubt_logs(opening: Opening) -> tuple[OddLog | None, str, Outliers | None]:
    """Return the log that disagrees, if one does, and what is said of outlying stretches.

    Those that are not fitted are asked where the fitted ones do not tell, as two cannot; the only
    one that is fitted cannot be left out.
    """
    fitted = len(opening.samples)
    each = (*opening.samples, *opening.validation)
    regression = opening.structure.regression(each, keep=True)
    every = gather_information(regression)
    information, estimator = every.take(every.log < fitted), find_estimator("wls")
    fit = estimator.fit(information)
    odd = describe_odd_log(opening.regression, information, fit)
    if odd is None:
        odd = describe_odd_log(regression, every, estimator.fit(every))
        odd = None if odd is None or odd.number < fitted < 2 else odd
    return odd, *weigh_rows(opening.robot.joints, opening.samples, information, estimator)[1:]


def _settle_values(
    robot: Robot, model: ModelLike | None, fixed: Given, *, commanded: bool
) -> tuple[Structure, KnownValues | None]:
    """Return what is diagnosed, and what is known of the values that it keeps."""
    fit, name = read_given(fixed, robot)
    if fit is not None and model is None:
        structure = fit.structure
    else:
        structure = Structure.of(
            robot, choose_model(model, usual_effects(robot, commanded=commanded))
        )
    if fit is not None:
        return structure, know_fit(fit, structure, name)
    if isinstance(fixed, int | float) and not isinstance(fixed, bool):
        return structure, know_share(float(fixed), structure)
    return structure, None


def usual_effects(robot: Robot, *, commanded: bool = False) -> tuple[str, ...]:
    """Return the effects of the model that is diagnosed when none is given.

    Zeros of commands and encoders differ, of which servos make torque: logs of commands have
    offsets, as they have in every verb.
    """
    offsets = ("torque_offset",) if commanded else ()
    return default_effects(robot, (*BASE_EFFECTS, *offsets))


def common_delay(found: Diagnosis) -> float:
    """Return by how much commands act later at most joints than was taken of their logs [s].

    A log's delay is found of all joints together, so that one that is late, or whose gain is wrong,
    makes the others early. What most of them have is the log's.
    """
    named = {
        p.place: float(p.values[0])
        for e in found.effects
        if e.name == CommandDelay.name
        for p in e.placements
    }
    every = sorted(named.get(j, 0.0) for j in found.robot.motor_joints)
    return every[(len(every) - 1) // 2]


def settle_named(found: Diagnosis) -> Diagnosis:
    """Return a diagnosis that names a small tilt with gravity's direction in its model."""
    if found.fixed or not any(e.name == GravityTilt.name for e in found.effects):
        return found
    model = found.model
    others = Model(tuple(e for e in model.effects if e.name != GravityTilt.name))
    known = Structure.of(found.structure.robot, others)
    leaning = settle_tilt(known, found.samples)
    if leaning is None:
        return found
    effects = tuple(
        replace(e, leaning=leaning) if e.name == GravityTilt.name else e for e in found.effects
    )
    last = next(e for e in leaning.structure.model.effects if e.name == GravityTilt.name)
    return replace(found, effects=effects, model=Model((*others.effects, last)))


def lead_with_tilt(
    found: Diagnosis,
    upright: Structure,
    leaning: Leaning,
    p_value: float,
    rng: np.random.Generator,
) -> Diagnosis:
    """Return a diagnosis under the gravity that was found as one of the robot file's.

    Parameters
    ----------
    found : Diagnosis
        Of the model about that gravity.
    upright : Structure
        What was diagnosed, with gravity as the file states it.
    leaning : Leaning
    p_value : float
        The smallest that as many simulated noises can give.
    rng : numpy.random.Generator
    """
    fitted, unseen = _predict_both(upright, found.samples, found.validation)
    gap = Gap(found.gap.rows, np.concatenate([unseen.residual, found.gap.residual], axis=2))
    change = gap.change(0, 1, rng)
    joints = change["joints_before"], change["joints_after"], change["joints_interval"]
    first = NamedEffect(
        name=GravityTilt.name,
        title=title_of(GravityTilt.name),
        placements=(_place_tilt(found, upright, leaning, p_value),),
        **change,
        shown=Shown(*joints, gap.expected_change(0, 1)),
        leaning=leaning,
    )
    return replace(
        found,
        upright=upright,
        effects=(first, *found.effects),
        gap=gap,
        interval=gap.interval(0, -1, rng),
        held_before=change["before"],
        error_before=float(fitted.relative_error()[0]),
        real_before=float("nan"),
        real_after=float("nan"),
    )


def _predict_both(
    structure: Structure, samples: tuple[Samples, ...], validation: tuple[Samples, ...]
) -> tuple[Prediction, Prediction]:
    """Return what a model predicts on the logs that it was fitted to, and on unseen ones."""
    fitted = structure.regression(samples)
    values = estimate(gather_information(fitted)).value[:, None]
    return predict(fitted, values), predict(structure.regression(validation), values)


def _place_tilt(
    found: Diagnosis, upright: Structure, leaning: Leaning, p_value: float
) -> Placement:
    """Return a tilt as two rotations of gravity about horizontal axes of the file."""
    stated, turned = upright.robot, leaning.structure.robot
    step = shortest_turn(stated.gravity, turned.gravity)
    motion = found.samples[0].motion
    added = gravity_torque(turned, motion, turned.gravity)
    added = added - gravity_torque(stated, motion, stated.gravity)
    return Placement(
        place=BASE,
        shape=float("nan"),
        p_value=p_value,
        parameters=tuple(f"{BASE}.{kind}" for kind in TILTS),
        units=("rad", "rad"),
        values=np.array([axis @ step for axis in horizontal_axes(stated.gravity)]),
        errors=np.full(2, np.radians(leaning.sd)),
        rms=float(np.sqrt(np.mean(added**2, axis=0)).max()),
        rivals=(),
    )
