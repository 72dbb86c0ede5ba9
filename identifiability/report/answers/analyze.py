"""Answers of `analyze`, and answers about the model to use that `prune` shares."""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from identifiability.effects import FAMILIES
from identifiability.effects.base import apply_tilt
from identifiability.estimation.combinations import find_combinations
from identifiability.estimation.groups import describe_term, shorten_places
from identifiability.estimation.prediction import Prediction, change_interval, loaded_joints
from identifiability.estimation.rules import RULES, Thresholds
from identifiability.estimation.verdict import Class, Flag, Verdict, percent_of, to_row
from identifiability.foundation.answers import Answer, Cell, Note, Table, measured_cells
from identifiability.foundation.errors import listing
from identifiability.foundation.findings import joints_with_play, of_key
from identifiability.foundation.names import INERTIAL_KINDS, Array, Strings
from identifiability.foundation.presenter import Presenter
from identifiability.foundation.quoting import option_for_shell
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import (
    LEVEL,
    chance_text,
    format_number,
    join,
    measured,
    percent_text,
    stated_text,
)
from identifiability.physical.cad_prior import find_rises
from identifiability.robot import Robot
from identifiability.workflows.analyze.result import compare_logs, stated_values
from identifiability.workflows.case import SENSOR_ERRORS
from identifiability.workflows.provenance import given_paths

from . import commands
from .common import (
    NAMED,
    TONES,
    VISIBLE,
    WORDS,
    Command,
    PredictingPresenter,
    advise_motion,
    after_colon,
    after_mass,
    answer,
    answer_trust,
    capital,
    command,
    find_command,
    first_sentence,
    grade_of,
    hint_note,
    join_sentences,
    list_points,
    note,
    sentence,
    state_contradicted,
    state_uneven_log,
    torque_noise,
)
from .profiles import answer_profiles, is_width
from .tables import add_units, make_table

if TYPE_CHECKING:
    from identifiability.workflows.analyze.result import Analysis, Laddered, ModelResult


#: Columns of a frame without details.
FRAME = (
    "name",
    "unit",
    "value",
    "standard_error",
    "lower",
    "upper",
    "used",
    "nominal",
    "verdict",
    "reason",
)


class LadderedPresenter(PredictingPresenter):
    """Answers about the model to use, for analyze and prune."""

    result: Laddered[Any]

    @abstractmethod
    def answer_use(self) -> Answer:
        """Return the model to use, and the number of its identifiable parameters."""

    def asked(self) -> tuple[Answer, ...]:
        """Return the recommended model, its error, and its reliability."""
        result = self.result
        use = self.answer_use()
        warned = after_mass(use, result.mass_warning)
        # The reservation states the cause, if nothing else is odd.
        known = use.text if _state_wrong_mass(result) else warned.text
        text = _state_cause(result) or known
        short = join_sentences(state_weight(result), warned.short)
        use = replace(warned, short=short, text=text, more=use.more)
        more = ""
        if not result.nothing:
            more = join_sentences(_state_own_means(result), _state_left_out(result))
        measured_on = sentence(
            "laddered.measured",
            kind=result.validation_kind,
            interval=state_interval(result.held_out),
        )
        error = self.answer_error(measured_on, more, raw=result.left_out["raw"])
        if result.moved is not None:
            error = result.moved.lead(error)
        return use, error, answer_doubt(result)

    def commands(self) -> list[Command]:
        """Return at most three lines for the terminal, the most useful first."""
        result = self.result
        verb = self.verb
        names = given_paths(result.samples)
        how = result.settings["preparation"]
        logs = commands.name_logs(result.robot, names, how=how)
        if result.nothing:
            return [command("inspect", f"inspect {self.robot} {logs}")]
        inputs = f"{self.robot} {logs}{commands.held_back(result.validation, result.samples)}"
        ladder = commands.ladder_option(result.robot, result.source)
        all_fitted = "" if result.validation else " --validate none"
        again = f"{verb} {inputs}{all_fitted}{ladder}"
        find = f"diagnose {inputs}"
        export = partial(commands.export_line, result.robot)
        exported = commands.on_file(result, "json", f"{verb}.json", f"{again} --json", export)
        commanded = result.recordings.commanded
        out = list[Command]()
        # A missing effect changes which parameters are needed: name it before pruning.
        if verb == "prune" and not result.missing.functions:
            use = partial("{} --model {}".format, find)
            find = commands.on_file(result, "model", "pruned.toml", f"{again} --out", use)
        elif verb == "analyze" and _has_unknown(result.chosen):
            line = f"{again.replace('analyze', 'prune', 1)} --report pruned.html --json prune.json"
            # Another motion separates values from offsets, a smaller model does not. But no motion
            # separates a function of position, which contains a constant.
            every = result.structure.parameters
            curves = [p.name for p in every if FAMILIES[p.group].flexible]
            offsets = [v.name for v, _ in result.chosen.without_offsets if v.name not in curves]
            apart = _separate_offsets(result, offsets) if offsets else ""
            if commanded:  # the gains of the servos are no torque to start from
                file = exported.split()[-1]
                more = f"{exported} && identifiability excite {file}{apart} --out commands.csv"
            else:
                begun = commands.name_logs(result.robot, names, "--start-from", how)
                more = f"excite {self.robot} {begun}{apart} --out next.json"
            measure = command("offsets" if offsets else "measure", more)
            # Of a motion that is not rich enough a smaller model hides that.
            poor = len(result.full.estimate.kept) < result.base.rank
            out = [command("prune", line), measure][:: -1 if offsets or poor else 1]
        if commanded or not find_rises(result.real_robot, "mjcf"):
            out.append(command("export", exported))
        found = _order_commands(
            result, out, f"{find} --out model.toml --report missing.html", ladder
        )
        if found:
            return found
        # No robot file of this model errs less than the robot's own.
        paths = given_paths(result.validation or result.samples)
        along = commands.name_logs(result.robot, paths)
        use = partial("predict {0} {2} {1} --out torque.csv".format, self.robot, along)
        line = commands.on_file(result, "json", f"{verb}.json", f"{again} --json", use)
        return [command("predict", line)]

    def warnings(self) -> Strings:
        """Return the findings on the logs, on one joint, and on contradicted bodies."""
        result = self.result
        if result.nothing:
            return Presenter.warnings(self)
        return (*super().warnings(), *self._uneven_logs(), *state_contradicted(result))

    def _uneven_logs(self) -> Strings:
        """Return which logs err much more than the others, if any do."""
        result = self.result
        logs = self.error_frame().query("of == 'log'")
        errors = logs["error"].fillna(logs["error_validation"]).to_numpy(float)
        variations = [result.fitted.variation(k) for k in range(len(result.samples))]
        variations += [result.held_out.variation(k) for k in range(len(result.validation))]
        given = [*logs["name"]], errors, np.array(variations)
        return tuple(state_uneven_log(*given, commanded=result.recordings.commanded))

    def errors(self) -> tuple[float, Array, Array]:
        """Return the errors of the values to use on unseen motion."""
        result = self.result
        each = result.held_out.by_joint()
        return result.chosen.error_ra_validation, each["error"], each["rms"]

    def reserved(self) -> bool:
        """Return whether trust is no unreserved yes."""
        return answer_doubt(self.result).tone != "green"

    def noise(self) -> Array | None:
        """Return the noise of each joint's torque; None where torque was computed."""
        result = self.result
        if result.recordings.commanded:
            return None
        return torque_noise(result.validation or result.samples)

    def details(self) -> str:
        """Return the answers in plain words, with warnings and remarks."""
        result = self.result
        tilt = result.robot.tilt
        stated = sentence("laddered.statement", "tilt", tilt=tilt.text) if tilt else ""
        moved = result.moved.told if result.moved else ""
        return join_sentences(super().details(), stated, moved, *result.remarks)

    def cautions(self) -> tuple[Note, ...]:
        """Return the caveats of physics, motion, samples and fit, gravest first."""
        order = {"warning": 0, "note": 1, "good": 2}
        return tuple(sorted(self.notes(), key=lambda n: order[n.level]))

    def notes(self) -> Iterator[Note]:
        """Yield the caveats of physics, motion, samples and fit."""
        result = self.result
        chosen = result.chosen
        base = result.base
        kept = result.full.estimate.kept
        # The head of the page names effects that the model got.
        named = of_key(result.remarks, "completed")
        yield from (hint_note(x) for x in result.remarks if x not in named)
        for found in of_key(result.findings, "unclosed", "singular"):
            yield note(found.key, log=found.subject, text=found)
        if chosen.infeasible and not result.nothing and not chosen.physical_used:
            yield note("impossible", names=chosen.infeasible, near=chosen.unseen_by(1))
        yield from (note("unreal", text=text) for text in _state_impossible(result))
        if len(kept) < base.rank:
            yield note("poor", rank=base.rank, excited=len(kept))
        if base.ambiguous:
            yield note("ambiguous", rank=base.rank)
        if not result.validation:
            yield note("inside", kind=result.validation_kind)

    def validation_kind(self) -> str:
        """Return the motion on which the unseen error was measured."""
        validation = self.result.validation
        if validation:
            names = [s.name for s in validation]
            return sentence("laddered.measured", "held", names=names)
        return sentence("laddered.measured", "crossed")

    def to_frame(self, model: str | None = None, *, details: bool = False) -> pd.DataFrame:
        """Return one row a parameter of the model to use, or of the named one."""
        result = self.result
        shown = result.chosen if model is None else result.models[result.find_model(model)]
        rows = shown.rows()
        frame = pd.DataFrame(rows)
        frame[["lower", "upper"]] = [to_row(row).interval for row in rows]
        return by_name(frame if details else frame[[*FRAME]])

    def ladder_frame(self) -> pd.DataFrame:
        """Return one row a model."""
        return by_name(pd.DataFrame([m.row() for m in self.result.models]))

    def error_frame(self) -> pd.DataFrame:
        """Return the errors of the values to use by joint and by log."""
        result = self.result
        robot = self.result.robot
        joints: dict[str, Any] = {"of": "joint", "name": robot.joints, "unit": robot.torque_units}
        joints |= result.fitted.by_joint() | result.held_out.by_joint("_validation")
        each = (*result.samples, *result.validation)
        known = len(result.samples)
        held = range(known if result.validation else 0, len(each))
        unseen = [result.held_out.relative_error(k)[0] for k in range(len(held))]
        names = [s.path or s.name for s in each]
        logs = pd.DataFrame({"of": "log", "name": names, "unit": ""})
        logs["error"] = pd.Series([result.fitted.relative_error(k)[0] for k in range(known)])
        logs["error_validation"] = pd.Series(unseen, held)
        return pd.concat([pd.DataFrame(joints), logs], ignore_index=True)


class AnalysisPresenter(LadderedPresenter):
    """Answers of `analyze`."""

    verb = "analyze"

    result: Analysis

    def asked(self) -> tuple[Answer, ...]:
        """Return the recommended model, its error, its reliability, and the profiled numbers."""
        result = self.result
        # The answer on trust has the errors of measurement that the logs show.
        shown = (".lead", ".delay") if of_key(result.hints, "alternative") else ()
        named = {x.number.name: x for x in result.profiles if not is_width(x)}
        profiles = [x for name, x in named.items() if not name.endswith(shown)]
        if not profiles:
            return super().asked()
        profiled = answer_profiles(profiles, result.shapes)
        lacks = result.missing.functions
        if lacks:
            as_it_is = sentence("analysis.bounds", "lacks", lacks=lacks)
            profiled = replace(profiled, text=as_it_is)
        return (*super().asked(), profiled)

    def answer_use(self) -> Answer:
        """Return the model to use, and the number of its identifiable parameters."""
        result = self.result
        about = "analysis.use"
        chosen = result.chosen
        if result.nothing:
            return answer(about, "nothing")
        what = _state_open(result)
        part = "unjudged" if chosen.unjudged else "none" if what else "found"
        tone = "blue" if is_nearly_real(chosen) else "amber"
        near = "" if is_nearly_real(chosen) else state_nearest(chosen)
        few = _state_few(chosen)
        most, known = ("", few) if few else _state_known(result.robot, chosen)
        holes: dict[str, Any] = {"found": found_cell(chosen).text, "count": len(chosen.submodel)}
        holes |= {"most": most, "quantity": what}
        return replace(answer(about, part, known, tone, **holes), more=near)

    def tables(self) -> tuple[Table, ...]:
        """Return the models, the errors by joint and by log, the parameters of the model to use."""
        result = self.result
        models = make_table("models", map(model_row, result.models), result.selected)
        parameters = parameter_table(result.chosen)
        sums = _find_determined(result)
        determined = [make_table("determined", sums)] if sums else []
        errors = error_tables(result)
        return (models, *errors, *determined, parameters, file_table(result))

    def file_frame(self) -> pd.DataFrame:
        """Return the numbers of the robot file that the logs contradict, then confirmed ones."""
        result = self.result
        pairs = zip(result.full.verdicts, stated_values(result, result.full), strict=True)
        known = [(v, x) for v, x in pairs if x is not None]
        reach = NormalDist().inv_cdf(1 - (1 - LEVEL) / (2 * max(len(known), 1)))
        rows = list[tuple[Any, ...]]()
        for v, x in known:
            off = abs(v.value - x) / v.sigma_label if np.isfinite(v.sigma_label) else np.nan
            judged = v.verdict is Class.IDENTIFIABLE or Flag.NEGLIGIBLE in v.flags
            word = "agrees" if judged else "not determined"
            word = "contradicted" if off > reach and not result.nothing else word
            rows.append((v.name, v.label, v.unit, x, v.value, v.sigma_label, off, word))
        words = [*BELIEVED]
        rows.sort(key=lambda r: (words.index(r[-1]), -np.nan_to_num(r[-2])))
        columns = ["name", "label", "unit", "file", "value", "sigma", "sigmas", "logs"]
        return by_name(pd.DataFrame(rows, columns=columns))


# How good the model to use is, and whether to trust it.


def is_nearly_real(model: ModelResult) -> bool:
    """Return whether physically consistent values predict unseen motion about as well."""
    return model.feasible or model.unseen_by(1) <= (1 + VISIBLE) * model.unseen_by(0)


def state_nearest(model: ModelResult) -> str:
    """Return that no real robot has exactly the values, with the error of the nearest ones."""
    near = model.unseen_by(1)
    if model.feasible or not np.isfinite(near):
        return ""
    part = "nearest" if model.physical_used else "apart"
    return sentence("laddered.statement", part, near=near, free=model.unseen_by(0))


def _state_left_out(result: Laddered[Any]) -> str:
    """Return which rows the error leaves out, as they have no weight."""
    left = result.left_out
    if not left["rows"] > 0:
        return ""
    return sentence("decision.left", "rows", share=left["rows"], error=left["all_rows"])


def state_interval(out: Prediction) -> str:
    """Return the 95 % interval of the error on unseen motion; nothing without its samples."""
    if not len(out.predicted):
        return ""
    error = np.abs(out.residual[:, :, :1]) * np.arange(2)
    low, high = change_interval(error, out.apart(), np.random.default_rng(0))
    return sentence("quality", "interval", low=low, high=high)


def _name_kind(robot: Robot, v: Verdict) -> str:
    """Return the kind of a value in words."""
    kinds: dict[str, str] = WORDS["analysis.known"]
    if v.others:
        return kinds["combined"]
    kind = v.name.rpartition(".")[2]
    usual = "bodies" if kind in INERTIAL_KINDS else "other"
    return kinds["passive"] if v.place in robot.passive else kinds.get(kind, kinds[usual])


def _state_few(chosen: ModelResult) -> str:
    """Return the identifiable parameters with their values, if these are one, two or three."""
    known = [v for v in chosen.verdicts if v.verdict is Class.IDENTIFIABLE]
    if chosen.unjudged or not 0 < len(known) < 4:
        return ""
    each = []
    for v in known:
        combined = sentence("values", "of_several", name=v.name)
        name = combined if label_note(v.label) else v.name
        each.append(f"{name} = {measured(v.value, v.sigma_label, v.unit)}")
    return sentence("analysis.use", "few", each=each)


def _state_known(robot: Robot, chosen: ModelResult) -> tuple[str, str]:
    """Return which frictions, rotors, … the logs determine.

    The first text is the headline: kinds known of all joints, or of all but few; else empty.
    """
    about = "analysis.use"
    joints = robot.joints
    which = "actuated joints" if len(robot.tree.joints) > len(joints) else "joints"
    kinds: dict[str, str] = WORDS["analysis.known"]
    groups = dict[str, list[Verdict]]()
    for v in chosen.verdicts:
        groups.setdefault(_name_kind(robot, v), []).append(v)
    told, every, most = dict[str, str](), [], ""
    for what in dict.fromkeys(kinds.values()):
        group = groups.get(what, [])
        lost = [v.place for v in group if v.verdict is not Class.IDENTIFIABLE]
        names = list(dict.fromkeys(lost))
        count = len(group) - len(lost)
        holes: dict[str, Any] = {"count": count, "total": len(group), "what": what}
        part = ("but" if names else "every") if {*joints} <= {v.place for v in group} else "values"
        if names and (part == "values" or len(names) > min(NAMED, len(joints) // 2)):
            part = "share"
        if part == "every":
            every.append(what)
        elif count:
            text = sentence(about, part, names=names, joints=which, **holes)
            share = sentence(about, "share", **holes)
            told[text] = share if part == "but" else text
            most = most or text * (part == "but" and what != kinds["off"])
    if every:
        most = sentence(about, "every", what=join(every), joints=which)
    others = [count for text, count in told.items() if text != most]
    if chosen.unjudged or not (most or others):
        return "", ""
    rest = sentence(about, "also", each=others) if others else ""
    return f"{capital(most)}. " * bool(most), rest


def _state_own_means(result: Laddered[Any]) -> str:
    """Return the error about each joint's mean, where the error of all joints misleads."""
    constant = result.held_out.constant_error()
    if not constant * RULES.means_apart < 1.0:
        return ""
    error = result.chosen.error_ra_validation
    return sentence("decision.left", "means", error=error / constant)


def _state_open(result: Laddered[Any]) -> str:
    """Return the quantity that a model without identifiable parameters predicts well, or ""."""
    chosen = result.chosen
    if chosen.count(Class.IDENTIFIABLE) or chosen.unjudged or result.nothing:
        return ""
    if result.moved is not None and result.moved.follows:
        return sentence("decision.left", "motion")
    good = grade_of(chosen.error_ra_validation) in ("very-good", "good")
    return sentence("decision.left", "torque") if good else ""


def _find_determined(result: Laddered[Any]) -> list[tuple[str, str]]:
    """Return at most five determined combinations, with values, where few parameters are."""
    chosen = result.chosen
    if result.nothing or chosen.unjudged or chosen.count(Class.IDENTIFIABLE) > NAMED:
        return []
    sigma = np.sqrt(np.diag(result.fit.covariance)) + chosen.fit.terms["alternatives"]
    far = np.array([v.verdict is not Class.IDENTIFIABLE for v in chosen.verdicts])
    at = np.flatnonzero(far & np.isfinite(sigma))
    values = np.array([chosen.verdicts[k].value for k in at])
    doubt = np.diag(chosen.fit.terms["alternatives"][at] ** 2)
    covariance = result.fit.covariance[np.ix_(at, at)] + doubt
    found = find_combinations(values, covariance, result.fit.spread.unknown[at], NAMED)
    rows = []
    for one in found[:5]:
        columns = [chosen.submodel.columns[at[k]] for k in one.members]
        pairs = zip(one.weights[1:], columns[1:], strict=True)
        rest = [f" {'−' if w < 0 else '+'} {format_number(abs(w), 3)} {name}" for w, name in pairs]
        unit = chosen.submodel.units[at[one.members[0]]]
        value = measured(one.value, one.sigma, unit)
        rows.append(("".join([columns[0], *rest]), value))
    return rows


def _state_cause(result: Laddered[Any]) -> str:
    """Return the usual largest source of standard errors where no parameter is identifiable."""
    chosen = result.chosen
    if chosen.count(Class.IDENTIFIABLE) or chosen.unjudged or result.nothing:
        return ""
    largest = Counter(max(v.terms, key=v.terms.__getitem__) for v in chosen.verdicts if v.terms)
    if not largest:
        return ""
    cause, part = largest.most_common(1)[0]
    limit = sentence("decision.left", "open") if _state_open(result) else ""
    if cause == "alternatives" and result.missing.functions:  # the answer on trust names them
        return limit
    share = sentence("analysis.causes", "part", part=part, count=len(chosen.submodel))
    return join_sentences(limit, sentence("analysis.causes", cause, share=share))


def answer_doubt(result: Laddered[Any]) -> Answer:
    """Return whether the result may be trusted."""
    doubt = result.chosen.unjudged
    if result.nothing:
        doubt = sentence("laddered.trust", "nothing", why=result.nothing)
    missing = _state_missing(result)
    odd = [*_list_odd(result), *filter(None, [_state_wrong_mass(result)])]
    headline = first_sentence(*odd)
    notes = [n for n in result.cautions() if first_sentence(n.text) != headline]
    usual = answer_trust(notes, doubt, missing, result.warnings, _state_in_doubt(result))
    named = result.missing.functions
    if missing and [*map(shorten_places, named)] != [*named]:
        places = sentence("trust", "places", each=named)
        usual = replace(usual, more=join_sentences(usual.more, places))
    if doubt or not odd:
        return usual
    # What the fit has accounted for does not lead where the model lacks an effect.
    modelled = of_key(result.hints, "alternative", "odd_joint")
    if missing and {*odd} <= {*modelled} and not joints_with_play(result.hints):
        return replace(usual, text=list_points(usual.text, *odd))
    # One answer says once that care is needed.
    prefix = sentence("trust", "care", grave="").rstrip(".")
    second = capital(usual.short.removeprefix(prefix))
    others = () if usual.tone == "green" else (second, usual.text)
    text = list_points(_state_measurement(result), *others)
    care = sentence("trust", "care", grave=after_colon(odd[0]))
    return replace(usual, short=care, text=text, tone="amber")


def _list_odd(result: Laddered[Any]) -> list[str]:
    """Return the doubts about a result, apart from its masses, in sentences."""
    odd = of_key(result.hints, "alternative", "odd_joint")
    return [*of_key(result.hints, "stated_delay"), *_state_impossible(result), *odd]


def _state_wrong_mass(result: Laddered[Any]) -> str:
    """Return the remedy for masses unlike the file's; empty if there is another doubt."""
    # Where the model surely lacks an effect, this effect is the doubt.
    if result.missing.statement:
        return ""
    why = result.mass_warning.partition(": ")[2]
    return "" if result.chosen.unjudged or _list_odd(result) else capital(why)


def _state_missing(result: Laddered[Any]) -> str:
    """Return the effects that the model lacks, and those that `diagnose` could not confirm."""
    missing = result.missing.statement
    models = result.source.entry.models if result.source else []
    left_out = {text for m in models for text in m.refuted}
    groups = [(t.group.family, f"{t.group.family}@{t.group.place}") for t in result.missing.named]
    refuted = [k for k, texts in enumerate(groups) if left_out.intersection(texts)]
    if not (missing and refuted):
        return missing
    names = [describe_term(result.missing.named[k]) for k in refuted]
    families = [groups[k][0] for k in refuted]
    holes = {"names": names, "count": names, "motion": advise_motion(families)}
    return sentence("trust", "refuted", missing=missing, **holes)


def name_values(names: Sequence[str]) -> list[str]:
    """Return friction of joints in words, both kinds of a joint together; others by their names."""
    kinds: dict[str, list[str]] = {}
    for name in names:
        place, _, kind = name.rpartition(".")
        if kind in ("Fc", "Fv"):
            kinds.setdefault(f" of {place}", []).append(sentence("values", kind))
        else:
            kinds[name] = [""]
    return [f"{join(own).replace(' friction and', ' and')}{place}" for place, own in kinds.items()]


def _state_in_doubt(result: Laddered[Any]) -> str:
    """Return which values are in doubt, and the effect behind most of them."""
    chosen = result.chosen
    alternatives = chosen.fit.alternatives
    doubted = list_doubted(chosen)
    if alternatives is None or not doubted:
        return ""
    effects = Counter(filter(None, (alternatives.names[k] for k in doubted)))
    ((effect, _),) = effects.most_common(1) or [("", 0)]
    names = [chosen.verdicts[k].name for k in doubted]
    lacks = effect in result.missing.functions  # the headline says it
    may = "" if lacks else _state_effect(result, effect, names)
    return effect and sentence("trust", "doubted", names=name_values(names), effect=may)


def _state_effect(result: Laddered[Any], effect: str, names: Sequence[str]) -> str:
    """Return which effect that may be missing would change values, with its probability."""
    chances = [s.weigh(names) for s in result.missing.shares if describe_term(s.term) == effect]
    odds = "".join(
        sentence("trust", "chance", chance=chance_text(max(each))) for each in chances[:1]
    )
    return sentence("trust", "may", names=name_values(names), effect=effect, odds=odds)


def _state_measurement(result: Laddered[Any]) -> str:
    """Return the values of the errors of measurement that the model has, in words."""
    names = {p.name for p in result.structure.parameters if p.group in SENSOR_ERRORS}
    every = (v for v in result.chosen.verdicts if v.name in names)
    values = [f"{v.name} = {measured(v.value, v.sigma_label, v.unit)}" for v in every]
    numbers = dict(zip(result.chosen.submodel.columns, result.chosen.recommended, strict=True))
    tilt = apply_tilt(result.robot, numbers)[0].tilt
    if not values:
        return ""
    stated = f"{listing(values, NAMED, things='values')}."
    if tilt is None or result.robot.tilt is not None:
        return stated
    return f"{sentence('laddered.statement', 'tilt', tilt=tilt.text)} {stated}"


def _state_impossible(result: Laddered[Any]) -> Iterator[str]:
    """Yield the error of the nearest physically consistent robot if it misses these logs."""
    used = result.chosen
    real = result.chosen.physical
    free, near = used.fitted.relative_error()[:2].tolist()
    if result.nothing or used.physical_used or real is None or near <= (1 + VISIBLE) * free:
        return
    each = used.fitted.joint_error()[:, 1]
    joint = result.robot.joints[int(np.argmax(each))]
    held = real.nearest.active if real.nearest else ()
    why = sentence("decision.impossible", "held" if held else "inside", names=held)
    text = sentence("decision.impossible", near=near, error=free, joint=joint, why=why)
    brakes = [x for x in result.robot.joints if {f"{x}.Fv ≥ 0", f"{x}.Fc ≥ 0"} <= {*held}]
    if brakes:
        columns = _list_drives(result.robot, brakes)
        text += sentence("decision.impossible", "negative", joints=brakes, columns=columns)
    yield text


def _list_drives(robot: Robot, joints: Sequence[str]) -> Sequence[str]:
    """Return the coupled motors that move some joints; the joints if no motors are coupled."""
    coupled = robot.transmission
    if coupled is None:
        return joints
    moved = [name in joints for name in robot.motor_joints]
    drives = np.any(coupled.coupling[:, moved] != 0, axis=1).tolist()
    return [motor for motor, drive in zip(coupled.motors, drives, strict=True) if drive]


def state_weight(result: Laddered[Any]) -> str:
    """Return the weight of a floating robot by its logs and by its file; else nothing.

    The mass of all its bodies is one of its base parameters: gravity acts on all of it.
    """
    structure = result.structure
    if result.robot.base is None or result.nothing:
        return ""
    masses = np.array([p.kind == "m" for p in structure.parameters], float)
    pairs = zip(structure.base.names, structure.G, strict=True)
    total = [name for name, row in pairs if np.allclose(row, masses, atol=1e-6)]
    for v in result.full.verdicts:
        if v.name in total and np.isfinite(v.sigma_label):
            value = measured(v.value, v.sigma_label, "kg")
            file = float(structure.nominal @ masses)
            return sentence("decision.weight", title=result.robot.title, value=value, file=file)
    return ""


# What to do next.


def _separate_offsets(result: Laddered[Any], names: Sequence[str]) -> str:
    """Return the options of a motion that tells parameters from torque offsets."""
    effects = dict.fromkeys((*result.effects, "torque_offset"))
    model = option_for_shell("--model", ",".join(effects))
    names = [name for name in names if name in result.base.names]
    asked = [option_for_shell("--parameter", name) for name in names]
    return " ".join(["", model, *asked])


def list_doubted(chosen: ModelResult) -> list[int]:
    """Return the values in doubt, but for those that only a rare effect would change."""
    missing = chosen.fit.alternatives
    rare = missing.rare.tolist() if missing else [False] * len(chosen.verdicts)
    each = enumerate(zip(chosen.verdicts, rare, strict=True))
    return [k for k, (v, seldom) in each if Flag.IN_DOUBT in v.flags and not seldom]


def _has_unknown(chosen: ModelResult) -> bool:
    """Return whether a parameter is not identifiable, and not only in doubt."""
    unknown = (v for v in chosen.verdicts if v.verdict is not Class.IDENTIFIABLE)
    return any(Flag.IN_DOUBT not in v.flags for v in unknown)


def _order_commands(
    result: Laddered[Any], lines: list[Command], find: str, ladder: str
) -> list[Command]:
    """Return the three most useful commands, with those that diagnose and compare.

    Parameters
    ----------
    result : Laddered
    lines : list of (purpose, command)
    find : str
        The command that diagnoses.
    ladder : str
        The option that names the ladder, if one was given.
    """
    missing = find_command(result.missing.functions, find)
    good = TONES[grade_of(result.chosen.error_ra_validation)] == "green"
    first = result.missing.functions or result.chosen.contradicted or not good
    # Where values depend on offsets, another motion comes first.
    first = first or (list_doubted(result.chosen) and not of_key(result.hints, "excluded_offsets"))
    # A ladder may come from a diagnosis, which proposes to compare.
    if not ladder:
        lines = [missing, *lines] if first else [*lines, missing]
    # Logs disagree under a model that misses an effect; differences show in addition to that.
    if not result.missing.functions and compare_logs(result.samples, result.chosen):
        names = given_paths(result.samples)
        how = result.settings["preparation"]
        line = command("compare", commands.compare_line(result.robot, names, how, ladder))
        lines = [*lines[:2], line] if ladder else [line, *lines]
    return lines[:3]


# Tables, as page, terminal and notebook show them.


def model_title(result: ModelResult) -> str:
    """Return the name of a model inside a sentence."""
    name = result.name
    about = result.submodel.description.rstrip(".")
    if "model" in name.lower():
        return f"{name} ({about})" if about else name
    return f"the model {name}" if name.startswith("without ") else f"“{name}”"


def found_cell(model: ModelResult) -> Cell:
    """Return the number of identifiable parameters of a model."""
    found = model.count(Class.IDENTIFIABLE)
    return Cell("not judged" if model.unjudged else str(found), found)


def possible_cell(m: ModelResult) -> Cell:
    """Return whether a model is physically consistent, and the error of the nearest values."""
    about = "laddered.tables"
    error = m.unseen_by(1)
    near = sentence(about, "near", error=error) if np.isfinite(error) else ""
    if m.feasible:
        return Cell("", 2.0) if m.physical is None else Cell("yes", 2.0, badge="pass")
    if m.infeasible:
        signs = sentence(about, "sign", names=m.infeasible)
        return Cell("no", 0.0, "; ".join(filter(None, (signs, near))), "differs")
    open_ = m.physical is None or m.physical.certificate is None
    return Cell("open" if open_ else "not exactly", 1.0, near, "partly")


def model_row(m: ModelResult) -> dict[str, Any]:
    """Return a model as one row of a table."""
    name = Cell(m.name, note=m.submodel.description)
    return m.row() | {"model": name, "found": found_cell(m), "possible": possible_cell(m)}


def error_tables(result: Laddered[Any]) -> tuple[Table, ...]:
    """Return the errors of the model to use by joint and, where there are several, by log."""
    errors = result.error_frame()
    samples = (*result.samples, *result.validation)
    joints = errors[errors["of"] == "joint"].iloc[loaded_joints(result.held_out.rms)]
    each = make_table("joints", add_units(joints, "rms_validation"))
    if np.allclose(joints["error_raw_validation"], joints["error_validation"]):  # not low-passed
        each = each.without("unseen, before low-pass")
    if len(samples) == 1:
        return (each,)
    of_logs = errors[errors["of"] == "log"]
    logs = of_logs.assign(name=[s.name for s in samples])
    return each, make_table("logs", logs.itertuples())


def bar(x: float, whole: float) -> Cell:
    """Return a percentage with a bar of that length."""
    share = float(np.nan_to_num(min(x / whole, 1.0)))
    return Cell(percent_text(x), x, share=share)


def parameter_table(result: ModelResult) -> Table:
    """Return one row for each parameter of a model, filtered by verdict."""
    shares = (v.share for v in result.verdicts if np.isfinite(v.share))
    most = max(shares, default=0.0) or 1.0
    each = zip(result.verdicts, result.recommended.tolist(), result.departures, strict=True)
    return make_table("parameters", [_parameter_row(*one, most) for one in each])


def _parameter_row(v: Verdict, used: float, why: str, most: float) -> dict[str, Any]:
    """Return a judged parameter as one row of a table.

    Parameters
    ----------
    v : Verdict
    used : float
        The value in predictions and files.
    why : str
        Why it differs from the estimate, if it does.
    most : float
        Largest share of torque of a parameter of the model.
    """
    value, sigma = measured_cells(v.value, v.sigma_label)
    limit = Thresholds().sigma_percent  # a full bar is the limit of the verdicts, or more
    name = Cell(v.name, note=label_note(v.label))
    usage = Cell(stated_text(used, v.sigma_label), used)
    if why:
        more = sentence("values", "used", value=usage.text, why=why)
        value = replace(value, note=sentence("values", "differs"), more=more)
    share_bar = bar(100 * v.share, 100 * most)
    flags = f"{capital(', '.join(v.flags))}. " if v.flags else ""
    verdict = Cell(v.verdict, v.word, f"{flags}{v.reason}", v.look)
    return {
        "name": name,
        "value": value,
        "sigma": sigma,
        "unit": v.unit,
        "label": bar(v.sigma_label_percent, limit),
        "robust": percent_of(v.sigma_robust, v.value),
        "bootstrap": percent_of(v.sigma_bootstrap, v.value),
        "used": usage,
        "share": share_bar,
        "rule": "✓" if v.paper_rule else "–",
        "verdict": verdict,
    }


#: Information of the logs on a number of the robot file, and its mark.
BELIEVED = {"contradicted": "differs", "agrees": "pass", "not determined": "partly"}


def file_table(analysis: Analysis) -> Table:
    """Return which numbers of the robot file may be believed, after these logs."""
    frame = analysis.file_frame()
    counts = [f"{count} {word.rstrip('s')}" for word, count in Counter(frame["logs"]).items()]
    rows = frame.to_dict("records")
    for row in rows:
        row["parameter"] = Cell(row["name"], note=label_note(row["label"]))
        row["believed"] = Cell(row["logs"], badge=BELIEVED[row["logs"]])
    return make_table("file", rows, counts=", ".join(counts))


def label_note(label: str) -> str:
    """Return the effective combination of a name; empty where it is the parameter alone."""
    return label if " " in label else ""
