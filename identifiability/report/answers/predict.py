"""Answers of `predict`: torque along logs, or errors of positions."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from identifiability.estimation.rules import RULES
from identifiability.foundation.answers import Answer, Column, Table
from identifiability.foundation.findings import phrase
from identifiability.foundation.names import Array, shorten_paths
from identifiability.foundation.quoting import option_for_shell, path_for_shell
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import LEVEL, digits, format_number, join
from identifiability.logs.commands import find_earliest, has_commands
from identifiability.workflows.predict import WINDOW

from .analyze import state_interval
from .commands import compare_line, diagnose_lines, export_line, name_logs, validate_options
from .common import (
    TONES,
    VISIBLE,
    AnsweringPresenter,
    Command,
    PredictingPresenter,
    answer,
    command,
    find_command,
    first_sentence,
    grade_of,
    hint_note,
    join_sentences,
    sentence,
    worst_joint,
)
from .tables import add_units, make_table

if TYPE_CHECKING:
    from identifiability.workflows.predict import PositionPrediction, TorquePrediction


#: Columns of a sample without details.
SAMPLED = ("tau", "predicted", "from", "to", "residual", "weight")


class TorquePredictionPresenter(PredictingPresenter):
    """Answers of `predict` on torque."""

    result: TorquePrediction

    def asked(self) -> tuple[Answer, ...]:
        """Return the predicted logs, the error, and whether to trust it."""
        result = self.result
        known = [name for name, has in zip(result.logs, result.measured, strict=True) if has]
        interval = state_interval(result.errors) if all(result.measured) else ""
        text = (
            sentence("prediction.what", "measured", logs=known, interval=interval) if known else ""
        )
        question = sentence("prediction.what", "good")
        part = "along" if {*result.logs} & {*result.fit.sides[0]} else "error"
        error = self.answer_error(text, question=question, raw=result.error_ra_raw, part=part)
        about = error, _answer_intervals(result), _answer_what(result)
        return about if known else about[::-1]

    def errors(self) -> tuple[float, Array, Array]:
        """Return the errors along the logs that have torque."""
        error, rms = self.result.error_frame()[["error", "rms"]].to_numpy(float).T
        return self.result.error_ra, error, rms

    def reserved(self) -> bool:
        """Return whether trust is no unreserved yes."""
        return _answer_intervals(self.result).tone != "green"

    def noise(self) -> Array:
        """Return the noise of each joint's torque; nan where torque was computed."""
        return np.broadcast_to(self.result.noise, len(self.result.robot.joints))

    def followed(self) -> np.ndarray:
        """Return no joint: nothing is rolled out."""
        return np.zeros(len(self.result.robot.joints), bool)

    def commands(self) -> list[Command]:
        """Return lines for the terminal, the most useful first."""
        result = self.result
        given = path_for_shell(result.fit.origin)
        every = name_logs(result.robot, result.logs)
        pairs = zip(result.logs, result.measured, strict=True)
        measured = [name for name, known in pairs if known]
        line = f"predict {self.robot} {given} {every} --out torque.csv"
        table = [command("samples", line)] if result.written("table") is None else []
        lacks = result.fit.missing
        finds = diagnose_lines(result.fit)[:1]
        missing = [find_command(lacks, line, "name_fitted") for line in finds]
        fitted = result.fit.sides[0][:1]
        if _find_few(result) and fitted and fitted[0] not in measured:
            paths = *fitted, *measured
            return [command("compare", compare_line(result.robot, paths, None)), *missing, *table]
        export = [] if result.fit.worse else [export_line(result.robot, given)]
        return [*missing, *table, *(command("export", line) for line in export)]

    def tables(self) -> tuple[Table, ...]:
        """Return one row a joint."""
        result = self.result
        table = make_table("predicted", add_units(result.error_frame(), "rms"))
        return (table if result.unknown.any() else table.without("unknown"),)

    def to_frame(self, *, details: bool = False) -> pd.DataFrame:
        """Return one row a sample and joint; with `details`, one row a sample as files have it."""
        if details:
            return self.frame()
        result = self.result.as_logged
        names = np.array(self.result.logs)
        each = []
        for k, joint in enumerate(result.robot.joints):
            samples = _list_samples(result, k)
            about = {"log": names[result.log], "t": result.t, "joint": joint}
            about["unit"] = result.robot.torque_units[k]
            each.append(pd.DataFrame(about | {name: samples[name] for name in SAMPLED}))
        return pd.concat(each, ignore_index=True)

    def frame(self) -> pd.DataFrame:
        """Return one row a sample, in the columns of the logs."""
        result = self.result.as_logged
        logs = np.array(result.logs)[result.log]
        columns: dict[str, Any] = {"log": logs, "t": result.t}
        for k, joint in enumerate(result.robot.joints):
            for what, values in _list_samples(result, k).items():
                columns[f"{joint}.{what}"] = values
        if result.motors:
            pairs = {"tau": result.tau, "predicted": result.predicted}
            for what, torque in pairs.items():
                names = [f"{motor}.{what}" for motor in result.motors]
                columns |= dict(zip(names, result.at_motors(torque).T, strict=True))
        return pd.DataFrame(columns)

    def error_frame(self) -> pd.DataFrame:
        """Return one row a joint: relative and absolute error, and shares inside the intervals."""
        result = self.result
        robot = self.result.robot
        columns: dict[str, Any] = {"joint": robot.joints, "unit": robot.torque_units}
        columns |= result.errors.by_joint()
        columns |= {"inside": result.inside, "unknown": result.unknown}
        frame = pd.DataFrame(columns)
        frame.loc[~result.known.any(0), ["rms", "rms_raw"]] = np.nan
        return by_name(frame)


def _list_samples(result: TorquePrediction, joint: int) -> dict[str, Any]:
    """Return the columns of one joint, sample by sample."""
    tau, raw, found = (x[:, joint] for x in (result.tau, result.raw, result.predicted))
    weight = result.known[:, joint].astype(int)
    columns: dict[str, Any] = {
        "tau": tau,
        "tau_raw": raw,
        "predicted": found,
        "residual": tau - found,
        "residual_raw": raw - found,
        "weight": weight,
    }
    halves = {"mean_": result.mean, "": result.low, "raw_": result.new}
    for name, half in halves.items():
        columns[f"{name}from"] = found - half[:, joint]
        columns[f"{name}to"] = found + half[:, joint]
    return columns


def _answer_what(result: TorquePrediction) -> Answer:
    """Return the predicted logs and the model."""
    about = "prediction.what"
    logs = shorten_paths(result.logs)
    names = {"model": result.fit.submodel.name, "origin": result.fit.origin}
    text = sentence(about, "model", samples=len(result.t), **names)
    silent = [name for name, has in zip(logs, result.measured, strict=True) if not has]
    if silent:
        text += sentence(about, "silent", logs=silent)
    return answer(about, "torque", text, joints=result.robot.joints, logs=logs)


def _find_few(result: TorquePrediction) -> list[str]:
    """Return the joints of whose samples too few lie in their intervals."""
    # Share of samples inside their 95 % interval below which something must have changed.
    few: list[str] = np.array(result.robot.joints)[result.inside < 0.8].tolist()
    return few


def _answer_intervals(result: TorquePrediction) -> Answer:
    """Return whether the prediction and its intervals may be trusted."""
    about = "prediction.trust"
    new = np.array(result.robot.joints)[result.unknown > 0].tolist()
    text = phrase("predicted", "new", joints=new) if new else ""
    if not any(result.measured):
        return answer(about, "unmeasured", text)
    needed = _find_needed_width(result)
    width = "narrow" if needed > 1.25 else "wide" if needed < 0.8 else "right"
    holes: dict[str, Any] = {"share": float(result.inside.mean()), "needed": needed}
    meaning = sentence(about, f"{width}_means", **holes)
    if few := _find_few(result):
        meaning = join_sentences(phrase("predicted", "few", joints=few), meaning)
        return answer(about, "no", join_sentences(meaning, text), **holes)
    if lacks := result.fit.missing:
        text = join_sentences(sentence(about, f"said_{width}", **holes), meaning, text)
        return answer(about, "lacks", text, missing=lacks)
    notes = [hint for hint in result.hints if hint_note(hint).level == "warning"]
    grave = first_sentence(*result.warnings, *notes)
    part = f"care_{width}" if grave or width == "narrow" else width
    tone = "amber" if new or grave else ""
    return answer(about, part, join_sentences(meaning, text), tone, first=grave, **holes)


def _find_needed_width(result: TorquePrediction) -> float:
    """Return the share of their width with which the intervals would hold 95 % of the samples."""
    off = np.abs(result.tau - result.predicted)[result.known]
    return float(np.quantile(off / result.low[result.known], LEVEL))


class PositionPredictionPresenter(AnsweringPresenter):
    """Answers of `predict --forward` on positions."""

    result: PositionPrediction

    def asked(self) -> tuple[Answer, ...]:
        """Return the error of positions, and of a fitted robot whether to trust it."""
        result = self.result
        trust = (_answer_motion(result),) if result.origin else ()
        return (_answer_positions(result), *trust)

    def commands(self) -> list[Command]:
        """Return the line that takes a robot that moves well into a simulator, or diagnoses it."""
        result = self.result
        if not result.origin:
            return []
        if _moves_better(result):
            return [command("export", export_line(result.robot, path_for_shell(result.origin)))]
        fitted, unseen = result.sides
        logs = f"{name_logs(result.robot, fitted)}{validate_options(unseen)}"
        line = f"diagnose {self.robot} {logs} --out model.toml --report missing.html"
        return [command("missing", line)]

    def tables(self) -> tuple[Table, ...]:
        """Return one row a joint, in mrad or mm; where all are alike, one of all joints."""
        result = self.result
        names = [*result.robot.joints]
        errors = np.array([run.errors for run in result.runs])
        units = _list_units(result)
        if len(units) == 1:
            names.append(sentence("diagnosis.missing", "everywhere"))
            errors = np.column_stack([errors, result.totals])
        rows = zip(names, *(1e3 * errors), strict=True)
        more = [Column(f"error of {name}", digits(3)) for name in name_runs(result, "the ")]
        return (make_table("rollout", rows, more=more, unit=" or ".join(units)),)

    def frame(self) -> pd.DataFrame:
        """Return one row a joint: the error of each robot [rad or m]."""
        frame = pd.DataFrame({"joint": list(self.result.robot.joints)})
        for run in self.result.runs:
            frame[f"error of {run.name}"] = run.errors
        return by_name(frame)

    def told(self) -> str:
        """Return the errors of the file's and of the fitted robot."""
        result = self.result
        logs = [log.name for log in result.logs]
        part = "unseen" if result.unseen else "fitted"
        return sentence("rollout.errors", part, logs=logs, runs=_state_runs(result))

    def lead(self, usual: Answer) -> Answer:
        """Return an answer that begins with the motion of the fitted robot, if it follows."""
        result = self.result
        if not result.follows:
            return usual
        error = _state_size(result, result.runs[1].errors)
        lag = _state_size(result, result.from_commands)
        alone, advice = _state_alone(result)
        torque = usual.short.replace("Error", "Torque error", 1)
        holes = {"error": error, "lag": lag, "alone": alone}
        logs = [log.name for log in result.logs]
        short = sentence("rollout.errors", "moves", logs=logs, **holes)
        tone = "amber" if usual.tone == "vermilion" else usual.tone  # only its torque is poor
        more = join_sentences(usual.text, usual.more)
        return replace(
            usual, short=join_sentences(short, advice), text=torque, more=more, tone=tone
        )


def _state_alone(result: PositionPrediction) -> tuple[str, str]:
    """Return the joint that alone follows its command poorly, and the remedy."""
    errors = np.where(result.alike, result.runs[1].errors, np.nan)
    joint, worst = worst_joint(result.robot.joints, errors)
    rest = errors[errors < worst]
    if not len(rest):
        return "", ""
    others = float(np.sqrt(np.mean(rest**2)))
    lag = result.from_commands[errors == worst].max()
    is_poor = worst > 0 and TONES[grade_of(worst / lag)] == "vermilion"
    if not (is_poor and worst > RULES.uneven * others):
        return "", ""
    rule = option_for_shell("--map", f"{joint}.cmd=left_out")
    holes = {"joint": joint, "worst": 1e3 * worst, "others": 1e3 * others, "rule": rule}
    parts = ("alone", "touches")
    alone, advice = (sentence("rollout.errors", part, **holes) for part in parts)
    return alone, advice


def moves_worse(result: PositionPrediction | None) -> bool:
    """Return whether the named effects make the motion of commands worse, if it was simulated."""
    return result is not None and bool(result.totals[-1] < result.totals[1])


def state_harm(result: PositionPrediction) -> str:
    """Return the errors of motion with and without the named effects."""
    error, without = (_state_size(result, result.runs[at].errors) for at in (1, -1))
    return sentence("diagnosis.missing", "worse", error=error, without=without)


def name_runs(result: PositionPrediction, article: str = "") -> list[str]:
    """Return what a page calls the robots: by their part in a fit, else by their files."""
    if not result.origin:
        return [run.name for run in result.runs]
    return [article + sentence("rollout.errors", part) for part in ("file", "fit")]


def _state_runs(result: PositionPrediction) -> str:
    """Return the errors of the positions of each robot, the fitted one first."""
    about = "rollout.errors"
    each = []
    late = [float(np.median(run.delays)) for run in result.runs]
    for run, total, delay in zip(result.runs, result.totals, late, strict=True):
        part = "error" if np.isfinite(total) else "diverges"
        size = _state_size(result, run.errors)
        error = sentence(about, part, size=size)
        # The best delay of a file without friction stands for that friction.
        differs = abs(delay - late[-1]) > VISIBLE * abs(late[-1])
        own = sentence(about, "delayed", delay=1e3 * delay) if differs else ""
        each.append(join_sentences(f"{run.name} {error}", own))
    return ", ".join(each[::-1])


def _state_size(result: PositionPrediction, errors: Array) -> str:
    """Return errors (n,) [rad or m] in one number (rms) for joints that turn or slide."""
    each = []
    for unit, joints in result.kinds.items():
        if joints.any():
            size = 1e3 * np.sqrt(np.mean(errors[joints] ** 2))
            each.append(f"{size:.3g} {unit}")
    return join(each)


def _moves_better(result: PositionPrediction) -> bool:
    """Return whether the last robot is nearer to the recording than the first one."""
    totals = np.nan_to_num(result.totals, nan=np.inf)
    return bool(totals[-1] < totals[0])


def state_span(result: PositionPrediction) -> str:
    """Return along which logs, or windows of them, errors are taken."""
    part = "whole" if any(map(has_commands, result.logs)) else "windows"
    logs = [log.name for log in result.logs]
    seconds = max(result.starts)
    return sentence("rollout.errors", part, window=WINDOW, logs=logs, seconds=seconds)


def find_worst(result: PositionPrediction) -> int:
    """Return the joint that errs most in any robot."""
    errors = np.max(np.nan_to_num([run.errors for run in result.runs]), axis=0)
    return int(np.where(result.alike, errors, -1.0).argmax())


def _list_units(result: PositionPrediction) -> list[str]:
    """Return the units of errors times 1000, of joints that turn and that slide."""
    return [unit for unit, joints in result.kinds.items() if joints.any()]


def _answer_positions(result: PositionPrediction) -> Answer:
    """Return the errors of the positions of each robot; of two the nearer one first."""
    about = "rollout.errors"
    totals = result.totals
    short = f"{_state_runs(result)}."
    order = np.argsort(totals).tolist()
    names = name_runs(result, "the ")
    late = [f"{1e3 * np.median(result.runs[k].delays):.3g} ms ({names[k]})" for k in order]
    delays = sentence(about, "delays", late=late) if any(map(has_commands, result.logs)) else ""
    span = state_span(result)
    least, most = totals.min(), totals.max()
    if most > (1 + VISIBLE) * least > 0 and len(_list_units(result)) == 1:
        near = name_runs(result, "The ")[order[0]]
        size, other = (_state_size(result, result.runs[k].errors) for k in order)
        holes = {
            "near": near,
            "far": names[order[1]],
            "size": size,
            "other": other,
            "times": most / least,
        }
        short = sentence(about, "nearer", **holes)
        span = join_sentences(sentence(about, "times", **holes), span)
    tone = "green" if _moves_better(result) else "blue" if len(totals) == 1 else "amber"
    short = join_sentences(short, *find_earliest(result.logs, result.runs[-1].delays))
    return Answer(sentence(about, "question"), short, span, tone, more=delays)


def _answer_motion(result: PositionPrediction) -> Answer:
    """Return whether the motion of a fitted robot may be trusted."""
    about = "rollout.trust"
    lag = result.from_commands
    own = np.sort(1e3 * result.runs[-1].errors[result.alike]).tolist()
    ends = (format_number(x, 3, pad=True) for x in (*own[:1], *own[-1:]))
    size = f"{' … '.join(dict.fromkeys(ends))} {result.unit}"
    late = sentence(about, "lag", lag=_state_size(result, lag)) if np.isfinite(lag).all() else ""
    noise = _state_size(result, result.noise)
    text = sentence(about, "joints", size=size, noise=noise, lag=late) if own else ""
    grave = first_sentence(*(x for x in result.hints if hint_note(x).level == "warning"))
    part = "care" if grave else "yes" if result.unseen else "fitted"
    part = part if _moves_better(result) else "no"
    logs = [log.name for log in result.logs]
    return answer(about, part, text, logs=logs, file=name_runs(result, "the ")[0], first=grave)
