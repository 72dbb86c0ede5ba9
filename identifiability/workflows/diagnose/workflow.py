"""`diagnose`: find, name, add, verify; each stage can be called by itself.

Another reading of the torque columns, or gravity far from the file's, is found before all else
(`alternatives`), since under a wrong model much seems to be missing that is not: what is diagnosed
is then the model that the fitted logs prefer.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from identifiability.effects import Placed, default_effects, find_families, title_of
from identifiability.estimation.groups import NO_MISSING_EFFECTS, place_of
from identifiability.estimation.mixed_model import EVERYWHERE
from identifiability.foundation.engines import Engine, Serial, one_thread
from identifiability.foundation.errors import ModelError
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.options import Effects, Seed, checked
from identifiability.foundation.values import frozen
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Dataset, Preparation
from identifiability.logs.prepare.dataset import require_signal
from identifiability.physical.cad_prior import load_by_fit, resolve_prior
from identifiability.quality.hints import where_outlying
from identifiability.regression.information import gather_information
from identifiability.regression.reduction import (
    USUAL_EFFECTS,
    LadderEntry,
    ModelLike,
    Submodel,
    build_comparison,
    choose_model,
    find_ladder,
    free_again,
    full_model,
    ladder_model,
)
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike, complete_motion
from identifiability.workflows.analyze.workflow import conclude_analysis, say_band
from identifiability.workflows.diagnose.changes import Change
from identifiability.workflows.diagnose.naming import (
    Naming,
    find_change_in_log,
    leave_out,
    look,
    name_missing,
    with_parts,
    without_outliers,
)
from identifiability.workflows.diagnose.problem import (
    MOST_IN_ALL,
    MOST_SAMPLES,
    Given,
    KnownValues,
    Setting,
    along_rollouts,
    assign_roles,
    change_of,
    find_discrepancies,
    know_file,
    know_fit,
    know_nothing,
    know_share,
    prepare_rows,
    read_given,
    weigh_fit,
)
from identifiability.workflows.diagnose.result import (
    Curve,
    Diagnosis,
    NamedEffect,
    Odds,
    Placement,
    Rival,
    simulate_forward,
)
from identifiability.workflows.session import (
    Logs,
    Opening,
    Progress,
    Recordings,
    Session,
    common_delay,
    count_offsets,
    prepare_unfitted,
    quiet,
    read_recordings,
    settle_gains,
    state_provenance,
)

#: What is to be known of values that are kept without their errors.
EXACT = (
    "The robot file's values were taken as exact, so that their errors may be named as effects: "
    "give the result that they come from (--fixed RESULT.json) or how far they may be off "
    "(--fixed 0.1)."
)


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
    seed : int
    quick : bool
        Leave out the simulation of `forward`.
    forward : bool
        Also simulate the motion that verifies, before and after what was named (half a second).
    progress : callable(str, float), optional
    engine : Engine, optional
        Where logs are prepared; here by default. The result does not depend on it.

    Raises
    ------
    IdentifiabilityError
    """
    say = progress or quiet
    streams = tuple(np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
    find_families(effects)  # what is misspelt is told before logs are read
    with one_thread():
        robot = Robot.of(robot)
        say("reading logs", 0.0)
        robot = settle_gains(robot, logs)
        given = read_recordings(logs, validate, Conventions.of(robot), preparation, commands=True)
        commanded = given.commanded
        near = 0.0
        if commanded and isinstance(fixed, int | float) and fixed is not True:
            near, fixed = resolve_prior(fixed if fixed is not False else None, None, True)[0], False
        structure, known = _settle_values(robot, model, fixed, commanded=commanded)
        session = Session(structure, given, preparation, say, engine or Serial())
        session = session.follow(np.random.default_rng(seed))
        given, robot = session.recordings, session.structure.robot
        ladder = find_ladder(robot, None, beside=True).models_for(commanded=commanded)
        own = near, fixed is not False, seed, ladder if model is None else None
        asked = _Asked(session, effects, known, streams[0], *own)
        found, opening = asked.look(given)
        later = common_delay(found.effects, robot.motor_joints)
        if later and robot.servo is not None:
            given = given.acting_later(robot.servo, later)
            found, opening = asked.look(given)
        texts = [model] if isinstance(model, (str, Path)) else model
        words = ",".join(map(str, texts)) if isinstance(texts, (list, tuple)) else ""
        options = {
            **({"model": words} if words else {}),
            "effects": "all" if effects is None else list(effects),
            "fixed": fixed if isinstance(fixed, bool) else known.words,
            **({"prior": near} if near else {}),
            "quick": quick,
            "preparation": preparation or Preparation(),
        }
        used = [*found.samples, *found.validation]
        kept = (EXACT,) if fixed is True else ()
        believed = (found.known.hint,) if near else ()
        # With commands it is calibrated in this one.
        band = () if commanded else say_band(getattr(found.preparation, "band", None))
        hints = (*kept, *believed, *found.hints, *opening.hints, *band)
        found = replace(
            found,
            nothing="" if found.fixed else opening.misread,
            alternative="" if opening.alternative is None else opening.alternative.statement,
            hints=(*hints, *free_again(model)),
            provenance=state_provenance(robot, used, seed, None, options),
        ).moved_by(given)
        if quick or not (forward and found.included) or found.robot.base is not None:
            return found
        say("simulating forward", 0.95)
        return replace(found, forward=simulate_forward(found, streams[1]))


@frozen
class _Asked:
    """How effects are looked for.

    Attributes
    ----------
    session : Session
    effects : iterable of str or None
        Families that may be named.
    known : KnownValues
    stream : numpy.random.Generator
        For intervals.
    near : float
        Share within which bodies are the file's, of logs of commands.
    fixed : bool
        Whether values are those that are known, and the file's direction of gravity one of them.
    seed : int
    ladder : LadderEntry or None
        Models that `analyze` compares, where no model is given.
    """

    session: Session
    effects: Effects | None
    known: KnownValues
    stream: np.random.Generator
    near: float
    fixed: bool
    seed: int
    ladder: LadderEntry | None

    def look(self, given: Recordings) -> tuple[Diagnosis, Opening]:
        """Name what is missing in recordings, under the model that the fitted ones prefer."""
        fit, verify, verified_on = assign_roles(given.fitted, given.held_out)
        session = replace(self.session, recordings=Recordings(fit, verify, given.hints))
        how = session.preparation if session.how.cutoff is None else session.how
        most = min(MOST_SAMPLES, MOST_IN_ALL // len(fit))
        prepare = partial(prepare_rows, self.session.structure.robot, how=how, most=most)
        # Of what memory does not hold stretches are fitted, too.
        own = prepare if any(log.long for log in (*fit, *verify)) else None
        if self.fixed:
            opening = session.open("diagnosed", own, seek=False)
        else:
            session, opening = session.settle("diagnosed", own)
            at_fit = load_by_fit(opening.structure, opening.samples, session.engine, named=True)
            opening = replace(opening, structure=at_fit)
        logs, looked = session.recordings, list[tuple[Dataset, ...]]()
        if own is None:
            unseen = prepare_unfitted(prepare, self.session.structure.robot, session.how)
            looked = [tuple(map(prepare, logs.fitted)), tuple(map(unseen, logs.held_out))]
        if (rolled := given.rolled) is None:
            opening = session.with_instruments(opening, "wls", "auto")[0]
        else:
            pairs = [(opening.samples, logs.fitted), (opening.validation, logs.held_out)]
            pairs += zip(looked, (logs.fitted, logs.held_out), strict=False)
            along = [along_rollouts(opening.structure, s, own, rolled) for s, own in pairs]
            opening = replace(opening, samples=along[0], validation=along[1])
            looked = along[2:]
        samples, validation = opening.samples, opening.validation
        require_signal(validation, "verified")
        session.say("building columns", 0.1)
        near = know_share(self.near, opening.structure, refitted=True) if self.near else None
        setting = Setting(
            structure=opening.structure,
            samples=samples,
            known=near or (self.known if self.fixed else know_nothing(opening.structure)),
            validation=validation,
            looked=looked[0] if looked else (),
            looked_unseen=looked[1] if looked else (),
            fixed=self.fixed,
            verified_on=verified_on,
            preparation=how or Preparation(),
            commanded=given.commanded,
            seed=self.seed,
        )
        if not (self.fixed or setting.known.precision.any()):
            setting = self._recommend(session, opening, setting)
        # Values that are kept are those of the file, and a wrong scale or sign is an effect.
        asked = self if self.fixed or not opening.misread else replace(self, effects=())
        return asked.name(setting), opening

    def _recommend(self, session: Session, opening: Opening, setting: Setting) -> Setting:
        """Return the setting with the model and values that `analyze` recommends."""
        structure = own = opening.structure
        models: tuple[Submodel, ...] = (full_model(own.base),)
        if self.ladder is not None:
            other = Structure.of(session.structure.robot, ladder_model(self.ladder))
            if opening.alternative is not None:
                other = opening.alternative.structure(other)
            other = load_by_fit(other, opening.samples, session.engine)
            with suppress(ModelError):  # its models are of parameters of the model as it was given
                models, structure = build_comparison(self.ladder, other), other
        rows = session.weigh(replace(opening, structure=structure), "wls", "auto", whole=False)
        how = {"cad_prior": None, "replicates": 0}
        rng = np.random.default_rng(self.seed)
        found = conclude_analysis(session, rows, models, rng, how, NO_MISSING_EFFECTS)
        chosen = found.chosen
        real = chosen.physical if chosen.physical_used else None
        base = chosen.submodel.expand(chosen.recommended) if real is None else real.base
        # A model that leaves out what the diagnosed one has not is that.
        common = [n for n in structure.columns if n in own.columns]
        G, to = (s.G[:, [s.columns.index(n) for n in common]] for s in (structure, own))
        phi = np.linalg.lstsq(G, base, rcond=None)[0]
        if np.linalg.norm(G @ phi - base) <= NEARLY * np.linalg.norm(base):
            return replace(setting, recommended=to @ phi)
        return replace(setting, recommended=base, under=structure)

    def name(self, setting: Setting) -> Diagnosis:
        """Name what is missing, add it, verify.

        Rows that hardly count even beside what was named are no data for names.
        """
        found, said, samples = self._settle(setting), "", setting.samples
        if not setting.fixed:
            robot, changes, weighed = setting.structure.robot, found.setting.changes, found.weighed
            if changes:  # a burst may look like one
                rows = gather_information(found.completed.regression(samples))
                weighed = weigh_fit(robot, samples, rows)
            *_, said, outliers = weighed
            outliers = None if outliers is None else outliers.below()
            if outliers is None or _last(changes, samples):
                said = "" if changes else said
            else:
                where = where_outlying(robot.joints, samples, outliers)
                said = said or f"{where} was left out. Look at what happened there."
                found = self._settle(without_outliers(setting, outliers))
        self.session.say("verifying", 0.9)
        return replace(conclude(found, self.stream), hints=(said,) if said else ())

    def _settle(self, setting: Setting) -> Naming:
        """Return what is missing in logs without what changed in their midst.

        A change that explains more than any effect is left out before names are looked for, else
        it would be named piece by piece.
        """
        looked = look(setting, self.effects)
        self.session.say("naming effects", 0.3)
        change = None if setting.fixed else find_change_in_log(looked, self.effects)
        without = None if change is None else leave_out(setting, change)
        return name_missing(looked) if without is None else self._settle(without)


def _last(changes: Sequence[Change], samples: Sequence[Dataset]) -> bool:
    """Whether a change lasts longer than a burst that was low-passed."""
    for c in changes:
        own = next(s for s in samples if s.name == c.log)
        t, d = own.output_times(), own.decimation
        if np.sum((t >= c.start) & (t <= c.stop)) > (0.0 if d is None else 2 * d.reach / d.factor):
            return True
    return False


def _settle_values(
    robot: Robot, model: ModelLike | None, fixed: Given, *, commanded: bool
) -> tuple[Structure, KnownValues]:
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
    if fixed is True:
        return structure, know_file(structure)
    if isinstance(fixed, int | float) and fixed is not False:
        return structure, know_share(float(fixed), structure)
    structure = count_offsets(structure)
    return structure, know_nothing(structure)


def usual_effects(robot: Robot, *, commanded: bool = False) -> tuple[str, ...]:
    """Return the effects of the model that is diagnosed when none is given.

    Zeros of commands and encoders differ, of which servos make torque: logs of commands have
    offsets, as they have in every verb.
    """
    offsets = ("torque_offset",) if commanded else ()
    return default_effects(robot, (*USUAL_EFFECTS, *offsets))


def conclude(naming: Naming, rng: np.random.Generator) -> Diagnosis:
    """Return the diagnosis.

    Parameters
    ----------
    naming : Naming
        What is missing.
    rng : numpy.random.Generator
        For intervals.
    """
    setting, parts = naming.setting, naming.parts
    robot = setting.structure.robot
    counts = Counter(p.candidate.family.name for p in parts)  # families stand together
    ends = np.cumsum([0, *counts.values()]).tolist()
    plain = setting.recommended if len(setting.recommended) else with_parts(naming, ()).fit(())
    fits = [naming.of(setting.plain) @ plain, *(naming.fit(range(n)) for n in ends[1:])]
    left = naming.predict(fits[-1:], naming.fitted.samples).residual[:, :, 0]
    # Folds of the fitted logs choose what predicts, and unseen motion may refute that: what came
    # last is left out first.
    for n in range(len(counts), -1, -1):
        used = naming if n == len(counts) else with_parts(naming, parts[: ends[n]])
        values = used.best if n or setting.changes else plain  # without what changed
        last = naming.of(used.completed) @ values
        each = [*fits[: len(fits) - (0 < n == len(counts))], last]
        gap = naming.predict(each, setting.validation or setting.samples)
        if not n or ((setting.fixed or used.predicts) and not gap.surely_better(0, -1)):
            break
    errors = gap.relative_error()
    before = naming.predict([fits[0], last], setting.samples).relative_error()
    placed = [_place(naming, k) for k in range(len(parts))]
    effects = list[NamedEffect]()
    for at, (a, b) in enumerate(pairwise(ends)):
        family = parts[a].candidate.family
        near = [title_of(t.group.family) for p in parts[a:b] for t in p.nearest]
        effects.append(
            NamedEffect(
                name=family.name,
                placements=tuple(placed[a:b]),
                before=float(errors[at]),
                after=float(errors[at + 1]),
                interval=change_of(gap, at, at + 1, rng),
                everywhere=1 < len(family.places(robot)) == b - a,
                nearest=tuple(dict.fromkeys(near)),
            )
        )
    after = {t.key: t.odds for t in naming.after}
    return Diagnosis(
        **vars(setting),
        effects=tuple(effects),
        curves=tuple(_curve(naming, left, k, p) for k, p in enumerate(placed)),
        gap=gap,
        error_before=float(before[0]),
        error_after=float(before[-1]),
        held_before=float(errors[0]),
        held_after=float(errors[-1]),
        refuted=tuple(
            Odds(t.group.family, place_of(t), t.odds, unseen=x) for t, x in naming.refuted
        ),
        interval=change_of(gap, 0, -1, rng),
        discrepancies=find_discrepancies(naming.fitted, left, robot.joints),
        refusals=naming.refusals,
        evidence=tuple(
            Odds(t.group.family, place_of(t), t.odds, after.get(t.key, float("nan")))
            for t in naming.before
        ),
        values=values,
        model=used.completed.model,
        included=n,
    )


def _place(naming: Naming, k: int) -> Placement:
    """Return what is known of a part."""
    part, robot = naming.parts[k], naming.setting.structure.robot
    c = part.candidate
    value, covariance = naming.values(k)
    parameters = Placed([c.part]).parameters(robot)
    added = [naming.columns([k], j) @ value for j in naming.acts(k)]
    every = [r.group for r in part.rivals]  # what is everywhere is here, too
    rivals = dict.fromkeys(Rival(g.family, g.place.replace(EVERYWHERE, c.place)) for g in every)
    return Placement(
        place=c.place,
        shape=c.shape,
        parameters=tuple(x.name for x in parameters),
        units=tuple(x.unit for x in parameters),
        values=value,
        errors=np.sqrt(np.maximum(np.diag(covariance), 0.0)),
        rms=max((float(np.sqrt(np.mean(x**2))) for x in added), default=0.0),
        rivals=tuple(rivals),
        weight=part.weight,
        odds=part.term.odds,
        unseen=part.unseen,
    )


def _curve(naming: Naming, left: Array, k: int, placed: Placement) -> Curve:
    """Return what a part was learned to be, along the fitted motion."""
    c, rows = naming.parts[k].candidate, naming.fitted
    joints, robot = naming.acts(k), naming.setting.structure.robot
    columns = {j: naming.columns([k], j) for j in joints}
    j = max(joints, key=lambda j: float(np.abs(columns[j] @ placed.values).sum()))
    law, of = columns[j], c.effect.drawn_over(robot, j)
    added = law @ placed.values
    if c.family.against in ("velocity", "position") and not (c.family.remembers or robot.closed):
        # As it is, not as the low-pass leaves it, which depends on where the motion came from.
        every = np.zeros((*rows.measured.shape, law.shape[1]))
        Placed([c.part]).fill(robot, complete_motion(robot, rows.seen.t, *rows.states), every)
        law = every[:, j]
    return Curve(
        title=c.family.title,
        joint=j,
        of=of,
        against=c.family.against,
        x=rows.along(of)[c.family.against],
        learned=law @ placed.values,
        spread=np.sqrt(law**2 @ placed.errors**2),
        data=left[:, j] + added,
    )
