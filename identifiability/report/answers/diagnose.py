"""Answers of `diagnose`: the missing effects, their share of the error, the residual."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.special import expit, logit

from identifiability.effects import find_family, name_place, title_of
from identifiability.effects.base import GravityTilt, apply_tilt
from identifiability.estimation.rules import RULES
from identifiability.foundation.answers import Answer, Cell, Note, Table
from identifiability.foundation.keyed import Row, name_estimates
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array, Strings, name_each
from identifiability.foundation.quoting import option_for_shell, path_for_shell
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import (
    REACH,
    format_measured,
    join,
    measured,
    state_probability,
)
from identifiability.physical.cad_prior import find_rises
from identifiability.physical.rules import RULES as FILE_RULES
from identifiability.reading.rules import RULES as READING_RULES
from identifiability.workflows.diagnose.result import logs_disagree
from identifiability.workflows.provenance import given_paths
from identifiability.workflows.wrong_bodies import find_wrong_bodies

from .commands import compare_line, export_line, held_back, name_logs, on_file
from .common import (
    NAMED,
    TONES,
    VISIBLE,
    Command,
    PredictingPresenter,
    advise_motion,
    after_mass,
    answer,
    capital,
    command,
    join_sentences,
    list_points,
    sentence,
    state_contradicted,
    torque_noise,
)
from .compare import table_odd_rows
from .predict import moves_worse, state_harm
from .tables import add_units, make_table, unit_cell
from .values_table import list_values

if TYPE_CHECKING:
    from identifiability.bending import Bending
    from identifiability.robot.description import Tilt
    from identifiability.workflows.diagnose.result import Diagnosis, NamedEffect, Odds, Placement

#: Names that a sentence says of one effect; JSON has them all.
LIKELIEST = 4

#: Units of a size that is a torque or a force.
TORQUE_UNITS = ("N·m", "N")


class DiagnosisPresenter(PredictingPresenter):
    """Answers of `diagnose`."""

    verb = "diagnose"

    result: Diagnosis

    brief = (
        *("effect", "joint", "log_odds", "parameter", "value"),
        *("error", "unit", "or", "before", "after"),
    )

    def asked(self) -> tuple[Answer, ...]:
        """Return the missing effects, their share of the error, and the residual."""
        result = self.result
        missing = after_mass(_answer_missing(result), result.mass_warning)
        if moves_worse(result.moved):
            return missing, _answer_gap(result)
        question = sentence("diagnosis.residual", "question")
        error = self.answer_error("", result.unexplained, question=question)
        # The answer above states the error: this one is headed by the uses, if no joint stands out.
        if result.moved is None and np.isfinite(self.errors()[0]) and "; " not in error.short:
            question = sentence("diagnosis.residual", "uses")
            worst, noisy, _ = self._state_worst("left")
            left = join_sentences(self.state_limit(), worst, noisy)
            more = sentence("laddered.measured", "about")
            tone = TONES[self.grade_uses()]
            tone = error.tone if tone == "green" else tone
            short = self.state_uses()
            error = replace(error, question=question, short=short, tone=tone, text=left, more=more)
        error = error if result.moved is None else result.moved.lead(error)
        answers = missing, _answer_gap(result), error
        bending = result.bending
        if bending is None:
            return answers
        return (*answers, _answer_bending(bending))

    def errors(self) -> tuple[float, Array, Array]:
        """Return the errors of the model with the named effects on unseen motion."""
        error, rms = self.result.error_frame()[["after", "rms_after"]].to_numpy().T
        return self.result.held_after, error, rms

    def noise(self) -> Array | None:
        """Return the noise of each joint's torque; None where torque was computed."""
        result = self.result
        if result.commanded:
            return None
        return torque_noise(result.validation or result.samples)

    def commands(self) -> list[Command]:
        """Return lines for the terminal, the most useful first."""
        d = self.result
        paths = given_paths(d.samples)
        given = name_logs(d.robot, paths, how=d.preparation)
        logs = given + held_back(d.validation, d.samples)
        again = f"diagnose {self.robot} {logs}{_given_options(d)}"
        undecided = any(e.alternatives for e in d.effects) and not d.written("next")
        with_model = partial(on_file, d, "model", "model.toml", f"{again} --out")
        out = []
        judge = f"analyze {self.robot} {logs}"
        if moves_worse(d.moved):
            return [command("keep", f"{judge} --json fitted.json --report report.html")]
        if d.included:
            line = with_model(partial("{} --ladder {} --report report.html".format, judge))
            used = d.effects[: d.included]
            names = [f"the {len(used)} named effects"]
            if len(used) == 1:
                names = [name_place(used[0].name, name_places(used[0]))]
            file = Path(d.written("model") or "").name
            out.append(command(_choose_judge(d, file), line, names=names, file=file))
        if undecided:
            out.append(command("separate", f"{again} --next motion.json"))
        if logs_disagree(d):
            line = compare_line(d.robot, paths, d.preparation)
            if d.included:
                line = with_model(partial("{} --ladder {}".format, line))
            out.append(command("compare", line))
        if not d.commanded and find_rises(d.physical, "mjcf"):  # such a file is refused
            return out or [command("judge_again", f"{judge} --report report.html")]
        export = partial(export_line, d.robot)
        line = on_file(d, "json", "diagnose.json", f"{again} --json", export)
        return [*out, command("export", line)]

    def warnings(self) -> Strings:
        """Return the findings on the logs, on one joint, and on contradicted bodies."""
        judged = self.result.judged
        seen = super().warnings()
        return seen if judged is None or judged.nothing else (*seen, *state_contradicted(judged))

    def tables(self) -> tuple[Table, ...]:
        """Return values of joints, what changed in mid-log, named effects, and errors of joints."""
        result = self.result
        tables = [] if result.judged is None else [list_values(result.judged)]
        if result.changes:
            tables.append(table_odd_rows(result.changes, sentence("diagnosis.tables", "changed")))
        if result.effects:
            tables.append(make_table("effects", _list_effects(result)))
        if result.bending is not None and result.bending.joints:
            tables.append(make_table("bending", _list_bending(result)))
        joints = add_units(result.error_frame(), "rms_before", "rms_after")
        named = {p.joint: e.title for e in result.effects for p in e.placements}
        for row in joints:
            row["joint"] = Cell(row["joint"], note=named.get(row["joint"], ""))
        return (*tables, make_table("gap", joints))

    def cautions(self) -> tuple[Note, ...]:
        """Return the caveats of the named effects, and the refuted effects."""
        result = self.result
        notes = [*_list_doubts(result)]
        notes += [_write_note("refuted", _state_refuted(x, result)) for x in result.refuted]
        notes += [_write_note("remark", hint) for hint in result.remarks]
        return tuple(notes)

    def details(self) -> str:
        """Return the answers in plain words, and below them the caveats."""
        notes = (note.text for note in self.result.cautions())
        return "\n- ".join([super().details(), *notes])

    def unexplained(self) -> str:
        """Return the residual in words."""
        result = self.result
        about = "diagnosis.residual"
        if max(result.held_after, result.error_after) < ROUNDOFF:
            return sentence(about, "rounding")
        parts = []
        asked = [x for x in result.evidence if np.isfinite(x.after)]
        if asked:
            most = max(asked, key=lambda x: x.after)
            name = name_place(most.name, most.place)
            sure = state_probability(most.after)
            part, weak = _choose_reason(result, most)
            holes: dict[str, Any] = {"verified": result.verified_on}
            holes["motion"] = advise_motion([most.name])
            holes |= {"gain": weak.unseen, "needed": weak.needed}
            parts.append(sentence(about, part, name=name, probability=sure, **holes))
        parts.append(_state_looks(result, self.noise()))
        return " ".join(parts)

    def effect_rows(self) -> Iterator[Row]:
        """Yield the parameters of the named effects with their log odds."""
        about = "diagnosis.missing"
        for e in self.result.effects:
            verdict = sentence(about, "confirmed" if e.confirmed else "unconfirmed")
            for p in e.placements:
                details = {"effect": e.name, "joint": p.place, "log_odds": p.odds}
                reason = sentence(about, "odds", name=name_effect(e), odds=p.odds)
                yield from name_estimates(p.rows, verdict=verdict, reason=reason, details=details)

    def frame(self) -> pd.DataFrame:
        """Return one row for every named effect and place."""
        rows = []
        for e in self.result.effects:
            for p in e.placements:
                where = (e.name, p.place, p.shape, p.odds)
                which = (", ".join(e.alternatives), e.before, e.after)
                rows += [(*where, *row, *which) for row in p.rows]
        place = "effect joint shape log_odds"
        columns = f"{place} parameter value error unit or before after".split()
        return by_name(pd.DataFrame(rows, columns=columns))

    def error_frame(self) -> pd.DataFrame:
        """Return the errors of each joint on unseen motion before and after."""
        robot = self.result.robot
        found = self.result.gap
        error = found.joint_error()
        rms = found.joint_rms()
        columns = {
            "joint": robot.joints,
            "unit": robot.torque_units,
            "before": error[:, 0],
            "after": error[:, -1],
            "rms_before": rms[:, 0],
            "rms_after": rms[:, -1],
        }
        return pd.DataFrame(columns)


def _given_options(d: Diagnosis) -> str:
    """Return the options that state the diagnosed model and its kept values, after a space."""
    model = d.provenance.get("model")
    kept = d.provenance.get("fixed" if d.fixed else "prior", "")
    words = [option_for_shell("--model", model)] if model else []
    usual = "" if d.fixed else str(FILE_RULES.body_within)
    if kept not in ("", d.known.words, usual):
        words.append(f"--fixed {'exact' if kept == 'True' else path_for_shell(kept)}")
    return "".join(f" {word}" for word in words)


def _choose_reason(d: Diagnosis, most: Odds) -> tuple[str, Odds]:
    """Return why the likeliest further effect has no name, and its odds on other rows."""
    if most.after <= 0:
        return "unexplained", most
    same = (most.name, most.place)
    refused = {(x.name, x.place): x for x in d.possible}.get(same, most)
    if same in {(x.name, x.place) for x in d.refuted}:
        return "refuted", most
    if most.after < RULES.name:
        return "likeliest", most
    if refused.unseen < refused.needed:
        return "weak", refused
    harmful = refused is not most and np.isnan(refused.needed)
    return "harmful" if harmful else "unconfirmed", refused


# Joints that bend.


def _answer_bending(found: Bending) -> Answer:
    """Return which joints bend."""
    about = "diagnosis.bending"
    if found.lost:
        return answer(about, "lost", why=found.lost)
    if not found.joints:
        told = sentence(about, "told", band=found.band, bandwidth=found.bandwidth)
        return replace(answer(about, "none"), more=told)
    each = [
        sentence(about, "one", joint=x.joint, resonance=measured(x.resonance, x.resonance_sd, "Hz"))
        for x in found.joints
    ]
    how = sentence(about, "how", bandwidth=found.bandwidth)
    return replace(answer(about, "found", joints=join(each, NAMED, "joints")), more=how)


def _list_bending(d: Diagnosis) -> Iterator[tuple[Any, ...]]:
    """Yield the cells of the joints that bend."""
    bending = d.bending
    if bending is None:
        return
    units = dict(zip(d.robot.joints, d.robot.torque_units, strict=True))
    for x in bending.joints:
        at = d.robot.joints.index(x.joint)
        way = "rad" if units[x.joint] == "N·m" else "m"
        held = bending.held_before, bending.held_after
        unseen = [np.nan if rms is None else float(rms[at]) for rms in held]
        yield (
            x.joint,
            measured(x.stiffness, x.stiffness_sd, f"{units[x.joint]}/{way}"),
            measured(x.resonance, x.resonance_sd, "Hz"),
            x.damping_ratio,
            x.gain,
            float(bending.error_before[at]),
            float(bending.error_after[at]),
            *unseen,
        )


# What is missing.


def _answer_missing(d: Diagnosis) -> Answer:
    """Return the missing effects and the changes in the middle of a log."""
    about = "diagnosis.missing"
    tilted = _state_turned(d)
    named = [*map(partial(_state_effect, d), d.effects)]
    named += [
        f"{' or '.join([c.what, *c.others])} in {'all' if c.whole else 'a part'} of {c.log}"
        for c in d.changes
    ]
    short = capital(_name_missing([*tilted, *named]))
    if named and _is_unsure(d):
        short = join_sentences(short, sentence(about, "unproven", count=named))
    odds = max([e.odds for e in d.effects] + [c.odds for c in d.changes], default=0.0)
    unsure = odds < READING_RULES.log_odds and not d.interval[1] < 0
    worse = moves_worse(d.moved)
    weak = worse or unsure or not (d.included or d.problem.left_out)
    # A level over Coulomb friction is easily read as the whole static friction.
    first = [find_family(e.name).needs for e in d.effects[: len(named) == 1]]
    over = sentence(about, "over") if "coulomb_friction" in first else ""
    more = [f"{capital(name)}." for name in named[1:] if len(named) > 2 and not weak]
    text = list_points(join_sentences(over, _state_search(d)), *more)
    if named and weak:
        likeliest = capital(_name_missing(named))
        text = join_sentences(sentence(about, "likeliest", names=likeliest), text)
        short = state_harm(d.moved) if d.moved and worse else sentence(about, "weak")
        short = capital(_name_missing(tilted)) if tilted else short
    springs = [] if d.nothing or d.fixed else [*find_wrong_bodies(d.fit).springs]
    if springs:
        short = join_sentences(short, sentence(about, "spring", joints=springs))
    question = sentence(about, "question")
    return Answer(question, short, text, "grey" if weak and not tilted else "vermilion")


def _name_missing(names: list[str]) -> str:
    """Return a sentence that names effects, or that there are none."""
    return sentence("diagnosis.missing", "named" if names else "nothing", names=names)


def _is_turned(d: Diagnosis) -> bool:
    """Return whether the logs were read with another direction of gravity."""
    return d.reading is not None and d.reading.reading.turned


def _state_turned(d: Diagnosis) -> list[str]:
    """Return the tilt of a base that the reading of the logs has found, if it has."""
    if not _is_turned(d) or any(e.name == GravityTilt.name for e in d.effects):
        return []
    size = sentence("diagnosis.missing", "size", size=_measure_tilt(d))
    return [f"{title_of(GravityTilt.name)}{size}"]


def _state_search(d: Diagnosis) -> str:
    """Return the searched model, the omitted rows, and why no effect was named."""
    about = "diagnosis.missing"
    model = d.alternative.partition(":")[0]
    parts = [f"{model}."] if model else []
    tilt = _tilt_of(d, d.values) if _is_turned(d) else None
    if tilt is not None:  # as fitted, which the reading is not exactly
        parts = [sentence("laddered.statement", "tilt", tilt=tilt.text)]
    rows = "restored" if d.problem.restored else "changed"
    parts += [sentence(about, rows, name=capital(c.called)) for c in d.changes]
    if not d.effects:
        parts.append(sentence(about, "none") if d.evidence else _state_untried(d))
    return " ".join(parts)


def _state_untried(d: Diagnosis) -> str:
    """Return why no family was tried."""
    about = "diagnosis.missing"
    if d.nothing:
        return sentence(about, "because", why=d.nothing)
    why = list(dict.fromkeys(f"{r.family} ({r.reason})" for r in d.refusals))
    return sentence(about, "refused", why=why)


def _state_effect(d: Diagnosis, e: NamedEffect) -> str:
    """Return the name of an effect with its size and probability, then its alternatives."""
    first, *others = list_names(e)
    size = _state_size(d, e) + _state_share(e)
    if len(others) > 1:  # a caveat names them
        others = [sentence("diagnosis.missing", "others", count=len(others))]
    share = e.weight if others else 1.0
    shares = np.array([share, 1.0 - share])[: 1 + bool(others)]
    sure = [state_probability(x) for x in logit(shares * expit(e.odds)) if np.isfinite(e.odds)]
    named = [f"{first}{size}", *filter(None, [" or ".join(others)])]
    each = zip_longest(named, sure)
    return " or ".join(f"{name} ({odds})" if odds else name for name, odds in each)


def name_places(e: NamedEffect) -> str:
    """Return where an effect is, in words."""
    if e.everywhere:
        return sentence("diagnosis.missing", "everywhere")
    return join(e.joints, NAMED, "joints")


def list_names(e: NamedEffect) -> list[str]:
    """Return the name of an effect with its place, and its alternatives.

    An alternative has its own place where that is another.
    """
    rivals = [r for p in e.placements for r in p.rivals]
    first = name_place(e.name, name_places(e))
    return list(dict.fromkeys([first, *_name_rivals(rivals, e.joints)]))


def _name_rivals(rivals: Sequence[tuple[str, str]], places: Strings) -> list[str]:
    """Return the names of alternatives at some places, then those elsewhere with their place."""
    there = [title_of(family) for family, place in rivals if place in places]
    return [*there, *(name_place(*rival) for rival in rivals if rival[1] not in places)]


def name_effect(e: NamedEffect) -> str:
    """Return the name of an effect and its likeliest alternatives."""
    names = list_names(e)
    more = len(names) - LIKELIEST
    if more > 0:
        names[LIKELIEST:] = [sentence("diagnosis.missing", "more", more=more)]
    return " or ".join(names)


def _state_size(d: Diagnosis, e: NamedEffect) -> str:
    """Return masses of a load, a tilt's angle, or the largest torque, ± one standard error.

    The largest torque in the logs replaces numbers of another unit, several numbers, and the limit
    of a curve that the logs do not reach. A remark says if this limit may also be zero.
    """
    placements = [p for p in e.placements if p.sure]
    rows = [row for p in placements for row in p.rows]
    masses = [row for row in rows if row[0].endswith(".payload_m")]
    if masses:
        sizes = [measured(value, error, unit) for _, value, error, unit in masses]
        return sentence("diagnosis.missing", "size", size=" and ".join(sizes))
    if not placements:
        return ""
    if e.name == GravityTilt.name and d.included:
        return sentence("diagnosis.missing", "size", size=_measure_tilt(d))
    torques = [row for row in rows if row[3] in TORQUE_UNITS]
    most = max(placements, key=lambda p: p.peak)
    peak = sentence("diagnosis.missing", "peak", peak=most.peak, unit=most.torque_unit)
    if len(rows) > len(placements) or not torques:
        return peak
    p = max(placements, key=lambda p: abs(p.values[0]))
    ((_, value, error, unit),) = p.rows
    part = "size" if len(rows) == 1 else "largest"
    vague = np.isfinite(p.shape) and abs(value) < REACH * error
    if np.isfinite(p.shape) and _is_far(value, error, p.peak):
        value, error, part = p.peak, error * p.peak / abs(value), "largest"
    size = sentence("diagnosis.missing", part, size=measured(abs(value), error, unit))
    return size + sentence("diagnosis.missing", "vague") if vague else size


def _state_share(e: NamedEffect) -> str:
    """Return the largest torque of an effect as a share of the variation in its joint."""
    most = e.placements[0]
    part = "own_share" if e.joints == (most.joint,) else "share"
    return sentence("diagnosis.missing", part, share=most.share, joint=most.joint)


def _tilt_of(d: Diagnosis, values: Array) -> Tilt | None:
    """Return the tilt of the base by base parameters (b,) of the completed model."""
    return apply_tilt(d.completed.robot, name_each(d.completed.base.names, values))[0].tilt


def _measure_tilt(d: Diagnosis) -> str:
    """Return the angle of the base ± one standard error, as files have it."""
    step = 1e-4  # the angle is linear over it
    steps = step * np.eye(len(d.values))
    tilts = (_tilt_of(d, d.values + by) for by in (np.zeros(len(steps)), *steps))
    degrees, *moved = (0.0 if tilt is None else tilt.degrees for tilt in tilts)
    slope = (np.array(moved) - degrees) / step
    error = np.sqrt(slope @ d.fit.base_covariance @ slope)
    angle, half = format_measured(degrees, float(error))
    return f"{angle}° ± {half}°"


def _is_far(limit: float, error: float, peak: float) -> bool:
    """Return whether the limit of a curve is surely larger than its largest torque in the logs."""
    return abs(limit) - peak > REACH * error


# How much of the gap it explains, and how good the model is then.


def _answer_gap(d: Diagnosis) -> Answer:
    """Return the error on unseen motion without and with the named effects."""
    about = "diagnosis.explained"
    if not (d.included or d.problem.left_out):
        model = d.known.words.rstrip(",")
        text = sentence(about, "measured", verified=d.verified_on, model=model)
        if d.effects:
            text += sentence(about, "useless", count=d.effects)
        return answer(about, "tilted" if _state_turned(d) else "stays", text, error=d.held_before)
    ends = [f"{100 * x:+.2g}".replace("-", "−") for x in d.interval]
    holes: dict[str, Any] = {"verified": d.verified_on, "ends": " … ".join(ends)}
    interval = sentence(about, "interval", **holes) if any(d.interval) else ""
    text = _state_joint(d) if interval else sentence(about, "unseen", **holes)
    reduction, more = d.used.reduction, ""
    every = len(d.completed.base)
    if len(reduction) < every:
        more = sentence(about, "reduced", name=reduction.name, kept=len(reduction), all=every)
    tone = "amber" if d.interval[1] >= 0 or moves_worse(d.moved) else "green"
    part = "unsure" if _is_unsure(d) else "falls"
    errors: dict[str, Any] = {"before": d.held_before, "after": d.held_after}
    errors |= {"count": d.effects, "interval": interval}
    return replace(answer(about, part, text, tone, **errors), more=more)


def _choose_judge(d: Diagnosis, file: str) -> str:
    """Return the part of `next` for a fit with the named effects, whose model may be in a file."""
    if _is_unsure(d):
        return "judge_unsure"
    return "judge_written" if file else "judge"


def _is_unsure(d: Diagnosis) -> bool:
    """Return whether the error may rise, by the interval of its change on unseen motion."""
    return any(d.interval) and d.interval[1] >= 0


def _state_joint(d: Diagnosis) -> str:
    """Return the errors of the joints in which all named effects lower and raise it most."""
    joints = {p.joint for e in d.effects[: d.included] for p in e.placements}
    errors = d.error_frame().dropna()
    own = errors[errors["joint"].isin(joints)]
    if own.empty:
        return ""
    about = "diagnosis.explained"
    order = own.assign(rise=own["after"] - own["before"]).sort_values("rise")
    first, last = (dict(order.iloc[k]) for k in (0, -1))
    rises = last != first and last["rise"] > VISIBLE * last["before"]
    more = sentence(about, "rises", **last) if rises else ""
    return join_sentences(sentence(about, "joint", **first), more)


def _state_looks(d: Diagnosis, noise: Array | None) -> str:
    """Return the variable of the residual in words, and its size if that exceeds the noise."""
    about = "diagnosis.residual"
    most = max(d.discrepancies, key=lambda x: max(x.explained.values(), default=0.0))
    where, best = max(most.explained.items(), key=lambda x: x[1])
    sizes = np.array([x.rms for x in d.discrepancies])
    known = np.zeros(1) if noise is None else noise
    # The noise of a torque that was smoothed before it was logged is not known.
    ratios = sizes / np.where(known > ROUNDOFF * sizes, known, np.inf)
    worst = int(ratios.argmax())
    larger = bool(ratios[worst] > REACH)
    part = "depends" if best >= VISIBLE else "unknown" if larger else "noise"
    parts = [sentence(about, part, where=where, joint=most.joint, share=best)]
    if larger:
        holes = {"rms": sizes[worst], "unit": d.robot.torque_units[worst]}
        joint = d.robot.joints[worst]
        parts.append(sentence(about, "size", joint=joint, ratio=ratios[worst], **holes))
    return " ".join(parts)


# Other findings.


def _write_note(name: str, text: str) -> Note:
    """Return a caveat under its title."""
    return Note("note", sentence("diagnosis.notes", name), text)


def _list_doubts(d: Diagnosis) -> Iterator[Note]:
    """Yield the names that have confounders, are nonparametric, or are not confirmed."""
    about = "diagnosis.doubts"
    for e in d.effects:
        if e.alternatives:
            motion = advise_motion([e.name, *e.alternatives])
            text = sentence(about, "rivals", name=name_effect(e), motion=motion)
            yield _write_note("rivals", text)
        if e.unnamed:
            part = "near" if e.nearest else "alone"
            near = sentence(about, part, names=e.nearest)
            text = sentence(about, "unnamed", where=name_places(e), near=near)
            yield _write_note("unnamed", text)
        if not e.confirmed:
            yield _write_note("unconfirmed", sentence(about, "unconfirmed", title=e.title))


def _state_refuted(x: Odds, d: Diagnosis) -> str:
    """Return that the motion that verifies did not confirm an effect."""
    name = capital(name_place(x.name, x.place))
    holes = {"before": state_probability(x.before), "gain": state_probability(x.unseen)}
    return sentence("diagnosis.doubts", "refuted", name=name, verified=d.verified_on, **holes)


# What to do next.


def _list_effects(d: Diagnosis) -> Iterator[tuple[Any, ...]]:
    """Yield the parameters of the named effects as rows of a table."""
    for e in d.effects:
        equation = find_family(e.name).effect.equation
        for p in e.placements:
            here = name_place(e.name, p.place)
            if p is not e.placements[0]:
                equation, here = "", shorten_title(here)
            others = " ".join(f"or {rival}" for rival in _name_rivals(p.rivals, (p.place,)))
            small = others if len(p.rivals) > 1 else ""
            note = "; ".join(filter(None, (equation, small)))
            title = here if small else f"{here} {others}".rstrip()
            name = Cell(capital(title), note=note)
            added = unit_cell(p.peak, p.torque_unit)
            named = name if p.sure else sentence("diagnosis.missing", "unsure")
            shape = _state_shape(d, e.name, p)
            odds = logit(p.weight * expit(p.odds)) if p.rivals else p.odds
            names = [row[0] for row in p.rows]
            if len(names) > 2:  # no coefficient of a curve means anything alone
                curve = sentence("diagnosis.missing", "curve", count=names)
                yield named, f"{names[0]} … {names[-1]}", curve, odds, p.unseen, added
                continue
            for parameter, value, error, unit in p.rows:
                far = np.isfinite(p.shape) and _is_far(value, error, p.peak)
                limit = sentence("diagnosis.missing", "limit") if far else ""
                note = "; ".join(filter(None, (shape, limit)))
                symbol = parameter.rpartition(".")[2]
                size = Cell(f"{symbol} = {measured(value, error, unit)}", value, note=note)
                yield named, parameter, size, odds, p.unseen, added


def shorten_title(title: str) -> str:
    """Return the title of an effect without its article and what brackets explain.

    Examples
    --------
    >>> shorten_title("an error of clocks (torque stamped before its motion)")
    'error of clocks'
    """
    return re.sub(r"^an? (unnamed )?| \([^)]*\)", "", title)


def _state_shape(d: Diagnosis, family: str, p: Placement) -> str:
    """Return the speed and exponent that shape a curve of friction, if they are known."""
    if not np.isfinite(p.shape_error):
        return ""
    sliding = [axis.name for axis in d.robot.axes if axis.prismatic]
    unit = "m/s" if p.place in sliding else "rad/s"
    symbol = getattr(find_family(family).effect, "symbol", "") or "shape"
    exponent = f", δ = {p.exponent:.2g}" if np.isfinite(p.exponent) else ""
    return f"{symbol} = {measured(p.shape, p.shape_error, unit)}{exponent}"
