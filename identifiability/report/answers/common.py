"""Answers that results share: how large is its error, is it reliable? And the words of reports.

`words.toml` has the questions and notes; whoever shows a result reads them here.
"""

from __future__ import annotations

import math
import re
import tomllib
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np

from identifiability.effects import find_family
from identifiability.effects.springs import (
    FreeSpring,
    GravitySpring,
    JointStiffness,
    PositionTorque,
)
from identifiability.estimation.groups import describe_term, shorten_places
from identifiability.estimation.rules import RULES, Thresholds
from identifiability.estimation.search import share_a_link
from identifiability.estimation.verdict import Flag
from identifiability.foundation.answers import Answer, Column, Note
from identifiability.foundation.errors import listing
from identifiability.foundation.findings import Finding, Level, fill, joints_with_play, phrase
from identifiability.foundation.linalg import ROUNDED
from identifiability.foundation.names import INERTIAL_KINDS, Array, Strings
from identifiability.foundation.presenter import Presenter
from identifiability.foundation.rounding import REACH, format_number, join, stated_text
from identifiability.foundation.rules import Tolerance
from identifiability.logs.prepare import Dataset
from identifiability.physical.pseudo_inertia import entry_scale, natural_scale
from identifiability.regression.reduction import Submodel
from identifiability.regression.structure import BaseParameters, Structure
from identifiability.robot.robot import Robot, last_bodies
from identifiability.workflows.analyze.result import Laddered, stated_values
from identifiability.workflows.wrong_bodies import WrongBodies, find_wrong_bodies, find_wrong_zero

from .commands import source_name
from .python_lines import lines_in_memory

#: Kinds of friction of a joint, in the order of columns.
JOINT_KINDS = ("Fc", "Fc+", "Fc-", "Fv")

#: Parameters, logs, places or needs that a sentence or a first screen names.
NAMED = 3

#: Share from which on a difference is worth a sentence.
VISIBLE: Tolerance = 0.05

WORDS: dict[str, Any] = tomllib.loads(
    Path(__file__).with_name("words.toml").read_text(encoding="utf-8")
)


def words(name: str, /, **holes: Any) -> dict[str, Any]:
    """Return all sentences of a name by their keys, with holes filled."""
    return {what: fill(text, holes) for what, text in WORDS[name].items()}


def join_sentences(*texts: str) -> str:
    """Return the texts that say something as one text."""
    return " ".join(filter(None, texts))


def list_points(*texts: str) -> str:
    """Return the texts that say something, each on a line: a page shows several as points."""
    return "\n".join(filter(None, texts))


def capital(text: str) -> str:
    """Return a text that begins with a capital letter."""
    return text[:1].upper() + text[1:]


def first_sentence(*texts: str) -> str:
    """Return the first sentence of the first of some texts, as it stands after a colon."""
    return after_colon("".join(texts[:1]).partition(". ")[0])


def after_colon(text: str) -> str:
    """Return a text as it stands after a colon, without its final stop; names keep their case."""
    first = text.partition(" ")[0]
    plain = first.isalpha() and first[1:] == first[1:].lower()
    begun = text[:1].lower() if plain else text[:1]
    return f"{begun}{text[1:]}".rstrip(".")


def sentence(name: str, what: str = "text", /, **holes: Any) -> str:
    """Return one of the words of some name, with its holes filled."""
    return fill(WORDS[name][what], holes)


def note(name: str, /, **holes: Any) -> Note:
    """Return a caveat."""
    return Note(**words(f"note.{name}", **holes))


def answer(
    name: str, part: str, text: str = "", tone: str = "", /, question: str = "", **holes: Any
) -> Answer:
    """Return an answer: the question of some name and one of its sentences, with holes filled.

    Parameters
    ----------
    name : str
        Key in `words.toml`.
    part : str
        Which of its sentences is the short answer.
    text, tone : str
        As of `Answer`; by default the tone that `words.toml` gives the sentence.
    question : str
        Replaces the default question.
    """
    asked = question or sentence(name, "question", **holes)
    colour = tone or WORDS[name].get("tones", {}).get(part, "")
    return Answer(asked, sentence(name, part, **holes), text, colour)


def hint_note(hint: str) -> Note:
    """Return a hint as a note, which is a caveat unless it only informs."""
    if not isinstance(hint, Finding) or hint.level is not Level.INFO:
        return note("hint", hint=hint)
    own = {"commands": "commands", "thinned": "shown"}
    return note(own.get(hint.key, "read"), hint=hint)


def pushes(result: Any) -> bool:
    """Return whether all actuated joints of the robot of a result slide."""
    robot = getattr(getattr(result, "analysis", result), "robot", None)
    return isinstance(robot, Robot) and {*robot.torque_units} == {"N"}


def name_forces(text: str) -> str:
    """Return a text with the word force where it has torque, but for names with that word.

    Examples
    --------
    >>> name_forces("The torque, for computed-torque control: slider1.torque, [torque]")
    'The force, for computed-torque control: slider1.torque, [torque]'
    """
    text = re.sub(r"(?<![-\w.\[])torque(?!\.)(?=s?\b)", "force", text)
    text = text.replace("reflected inertia", "reflected mass")
    return re.sub(r"\bTorque(?=s?\b)", "Force", text)


#: Words for an error on unseen motion, the smallest first, with their colour.
TONES = {"very-good": "green", "good": "green", "fair": "amber"}
TONES |= dict.fromkeys(("poor", "useless"), "vermilion")


def grade_of(error: float) -> str:
    """Return the name of the grade of an error on unseen motion."""
    limits = (*RULES.grades, math.inf)
    return next(w for limit, w in zip(limits, TONES, strict=True) if error <= limit)


def after_mass(answer: Answer, warning: str) -> Answer:
    """Return the first answer of a page, behind the warning on the total mass if there is one.

    Parameters
    ----------
    answer : Answer
    warning : str
        What `state_mass` says.
    """
    if not warning:
        return answer
    total, _, why = warning.partition(": ")
    why = f"{capital(why)} {answer.text}"
    return replace(answer, short=f"{total}. {answer.short}", text=why, tone="vermilion")


#: Purpose of a line for the terminal, and the line.
Command: TypeAlias = tuple[str, str]


def command(purpose: str, line: str, **holes: Any) -> Command:
    """Return a line for the terminal, after its purpose.

    Parameters
    ----------
    purpose : str
        Key of what it is for, in `next` of `words.toml`.
    line : str
        Verb and options.
    holes
        Of the purpose.
    """
    return sentence("next", purpose, **holes), f"identifiability {line}"


def find_command(effects: Sequence[str], line: str, part: str = "name") -> Command:
    """Return the line that estimates effects that seem to be missing, or that finds any.

    `part` is the key of its purpose.
    """
    if not effects:
        return command("missing", line)
    one = len(effects) == 1
    names = [*map(shorten_places, effects)] if one else [f"the {len(effects)} missing effects"]
    return command(part, line, names=names, count=effects)


class AnsweringPresenter(Presenter, ABC):
    """Presenter of a result whose page answers questions and proposes commands.

    Attributes
    ----------
    verb : str
        A proposed line that begins with it runs this command again.
    """

    verb: ClassVar[str] = ""

    @abstractmethod
    def asked(self) -> Sequence[Answer]:
        """Return the questions that every reader asks first, with their answers."""

    @abstractmethod
    def commands(self) -> Sequence[Command]:
        """Return lines for the terminal, the most useful first."""

    @property
    def robot(self) -> str:
        """The robot of a command with its sidecar, base and locks as options."""
        return source_name(self.result.robot)

    def _name_quantity(self, told: Answer) -> Answer:
        """Return an answer that speaks of forces where all actuated joints slide."""
        if not pushes(self.result):
            return told
        names = ("question", "short", "text", "more")
        texts: Any = {name: name_forces(getattr(told, name)) for name in names}
        return replace(told, **texts)

    def answers(self) -> tuple[Answer, ...]:
        """Return the answers, and what to do next."""
        commands = tuple(self.commands())
        asked = tuple(map(self._name_quantity, self.asked()))
        if not commands:
            return asked
        again = f"identifiability {self.verb} "
        shown = lines_in_memory([line for _, line in commands], self.verb)
        first = commands[0][1]
        lines = [(commands[0][0], shown[0])]
        for (what, line), new in zip(commands[1:], shown[1:], strict=True):
            part = "again" if line.startswith(again) else ""
            if new != line:  # variables are explained once
                part = "mixed" if shown[0] == first else ""
            lines.append((_state_purpose(what, part, new), new))
        where = "rerun" if first.startswith(again) else "run"
        where = where if shown[0] == first else "python"
        step = answer("next", where, variables=_explain_variables(shown[0]))
        return (*asked, replace(step, commands=tuple(lines)))


def _state_purpose(what: str, part: str, line: str) -> str:
    """Return the purpose of a line, with that it runs again or is Python, as `part` says."""
    holes = {"what": what.rstrip(":"), "variables": _explain_variables(line)}
    return sentence("next", part, **holes) if part else what


def _explain_variables(call: str) -> list[str]:
    """Return the meaning of each variable that a call in Python uses."""
    known: dict[str, str] = WORDS["next"]["variables"]
    names = dict.fromkeys(re.findall(r"\b\w+\b(?=[,)])", call))
    return [known[name] for name in names if name in known]


class PredictingPresenter(AnsweringPresenter):
    """Presenter of a result whose model predicts torque."""

    @abstractmethod
    def errors(self) -> tuple[float, Array, Array]:
        """Return the errors on unseen motion: ε_RA of all joints, of each, and its rms, (n,)."""

    def noise(self) -> Array | None:
        """Return the noise of each joint's torque in the band of the model, (n,) [N·m or N].

        None where torque was computed.
        """
        return None

    def warnings(self) -> Strings:
        """Return the findings on the logs, and on one joint that errs far more than others.

        Nothing is wrong with a joint whose error is mainly noise of its torque, or play, or that
        rollouts follow by its command.
        """
        error, each, rms = self.errors()
        noise = self.noise()
        robot = self.result.robot
        joints = robot.joints
        # Play is stated already, with its remedy.
        play = share_a_link(robot, joints_with_play(self.result.hints))
        explained = is_noise(rms, noise) | play | self.followed()
        unexplained = np.where(explained, np.nan, each)
        commanded = noise is None or bool(np.isnan(noise).all())
        diagnosed = self.verb == "diagnose"
        holes = {"commanded": commanded, "diagnosed": diagnosed}
        return (*super().warnings(), *state_uneven(error, joints, unexplained, **holes))

    def followed(self) -> np.ndarray:
        """Return the joints that rollouts by commands follow, (n,) bool."""
        moved = self.result.moved
        return np.zeros(len(self.result.robot.joints), bool) if moved is None else moved.followed

    def reserved(self) -> bool:
        """Return whether the page states a doubt."""
        return bool(self.result.warnings)

    def answer_error(
        self,
        text: str,
        more: str = "",
        question: str = "",
        raw: float = math.nan,
        part: str = "error",
    ) -> Answer:
        """Return the error of the predictions, and the joint with the largest error.

        Parameters
        ----------
        text : str
            What it was measured on.
        more : str
            What a page tells further down.
        question : str
            In place of the usual one.
        raw : float
            Error of torque that no filter has passed.
        part : str
            Sentence of `quality` that states the error.
        """
        error = self.errors()[0]
        if not np.isfinite(error):
            return answer("quality", "none", question=question)
        worst, noisy, grade = self._state_worst()
        tone = TONES[grade]
        if self.reserved() and tone == "green":
            tone = "grey"
        # A filter makes a difference.
        noisier = sentence("quality", "raw", raw=raw) if raw > (1 + 1e-6) * error else ""
        about = sentence("laddered.measured", "about")
        uses = self.state_uses()
        grave = uses if list_useless(self) else ""  # a reader must not miss it
        more = join_sentences(about, noisier, "" if grave else uses, more)
        if noisy:
            text, more = sentence("quality", "quieter"), join_sentences(text, more)
        text = join_sentences(grave, text)
        holes: dict[str, Any] = {"error": error, "worst": worst}
        found = answer("quality", part, text, tone, question=question, **holes)
        return replace(found, short=join_sentences(found.short, noisy), more=more)

    def state_uses(self) -> str:
        """Return the tasks that the error of every joint is small enough for."""
        grade = self.grade_uses()
        names = list_useless(self)
        some = names and self.errors()[0] <= RULES.grades[-1]
        uses = sentence("decision.uses", "but" if some else grade, names=names)
        if TONES[grade] != "vermilion" and self.reserved():
            doubt = "warning" if self.result.warnings else "doubt"
            uses = sentence("quality", "reserved", uses=uses, doubt=doubt)
        return capital(uses)

    def state_limit(self) -> str:
        """Return the error up to which a model is usually enough for these tasks."""
        grade = self.grade_uses()
        limits = dict(zip(TONES, RULES.grades, strict=False))
        return sentence("quality", "below", limit=limits[grade]) if grade in limits else ""

    def grade_uses(self) -> str:
        """Return the grade of the joint that errs most, apart from joints whose error is noise."""
        _, each, sizes = self.errors()
        *_, grade = self._state_worst()
        explained = np.where(is_noise(sizes, self.noise()), np.nan, each)
        joint, error = worst_joint(self.result.robot.joints, explained)
        return max(grade, grade_of(error), key=list(TONES).index) if joint else grade

    def _state_worst(self, part: str = "worst") -> tuple[str, str, str]:
        """Return the worst joint in words, whether its error is noise, and the grade of all."""
        error, each, sizes = self.errors()
        robot = self.result.robot
        joint, own = worst_joint(robot.joints, each)
        grade = grade_of(error)
        if not joint:
            return "", "", grade
        at = robot.joints.index(joint)
        size = f"{format_number(float(sizes[at]), 3, pad=True)} {robot.torque_units[at]}"
        uneven = errs_unevenly(error, own)
        holes: dict[str, Any] = {"joint": joint, "own": own, "rms": size}
        holes["middle"] = float(np.nanmedian(each))
        worst = sentence("quality", "uneven" if uneven else part, **holes)
        if not uneven:
            return worst, "", grade
        noisy = is_noise(sizes, self.noise())[at]
        text = sentence("quality", "noisy", joint=joint) if noisy else ""
        return worst, text, max(grade, grade_of(own), key=list(TONES).index)


def list_useless(presenter: PredictingPresenter) -> list[str]:
    """Return the joints of which more than half of the torque variation is not predicted."""
    joints = presenter.result.robot.joints
    errors = presenter.errors()[1].tolist()
    return [joint for joint, error in zip(joints, errors, strict=True) if error > RULES.grades[-1]]


def worst_joint(joints: Sequence[str], each: Array) -> tuple[str, float]:
    """Return the joint that errs most and its error; no name of one joint, or if none is known."""
    known = np.flatnonzero(np.isfinite(each))
    if len(joints) < 2 or not len(known):
        return "", math.nan
    worst = int(known[np.argmax(each[known])])
    return joints[worst], float(each[worst])


def is_noise(rms: Array, noise: Array | None) -> Array:
    """Return at which joints noise is at least half of the mean square error, (n,) bool.

    Parameters
    ----------
    rms : (n,) [N·m or N]
        Errors in the band of the model.
    noise : (n,) [N·m or N] or None
        White noise of the torque in that band; None where it is not known.
    """
    if noise is None:
        return np.zeros(len(rms), bool)
    return 2 * noise**2 >= rms**2


def torque_noise(samples: Sequence[Dataset]) -> Array:
    """Return the noise of each joint's torque in the least noisy of some logs, (n,) [N·m or N]."""
    return np.min([s.torque_noise for s in samples], axis=0)


def state_uneven(error: float, joints: Sequence[str], each: Array, **given: bool) -> list[Finding]:
    """Return that one joint errs far more than all joints together, if one does.

    Parameters
    ----------
    error : float
        On unseen motion, relative to the variation of torque.
    joints : sequence of str
    each : (n,)
        The same of each joint over its own scale; nan where its torque was not measured.
    given : bool
        Whether `diagnose` has looked for effects (`diagnosed`), and torque is that of `commanded`
        servos.
    """
    joint, worst = worst_joint(joints, each)
    if not (joint and np.isfinite(error) and errs_unevenly(error, worst)):
        return []
    return [Finding("uneven", joint=joint, error=worst, together=error, **given)]


def state_uneven_log(
    logs: Sequence[str], each: Array, variations: Array, *, commanded: bool = False
) -> list[Finding]:
    """Return that the model errs far more on a third of the logs or less than on the others.

    It errs more in N·m as well: the same error is a larger share of the torque of slow motion.
    A fit leans to the odd logs if they are several. So each needs to err less, by the same evidence
    of all: the logarithm of its error over that of the others falls with the root of their number.

    Parameters
    ----------
    logs : sequence of str
        Only of three or more is one known to be the odd one.
    each : (k,)
        Error on each log, relative to the variation of its torque; nan without torque.
    variations : (k,) [N or N·m]
        That variation.
    commanded : bool
        Whether the torque comes from commands.
    """
    order = np.argsort(-each)[: np.count_nonzero(np.isfinite(each))]  # the worst first
    sizes = each * variations
    found = []
    for count in range(1, len(order) // 3 + 1):
        odd, others = order[:count], np.median(each[order[count:]])
        factor = RULES.uneven ** (1 / np.sqrt(count))
        errs_more = sizes[odd].min() > min(2, factor) * np.median(sizes[order[count:]])
        least = float(each[odd].min())
        if errs_more and least > factor * others and grade_of(least) != "very-good":
            names = [logs[k] for k in np.sort(odd)]
            errors = {"error": float(np.median(each[odd])), "others": float(others)}
            found = [Finding("uneven_log", logs=names, commanded=commanded, **errors)]
    return found


def errs_unevenly(error: float, own: float) -> bool:
    """Return whether one joint's error is so large that the error of all joints misleads.

    A joint with a very good error never counts, even if the error of all joints is smaller.
    """
    if grade_of(own) == "very-good":
        return False
    poor = TONES[grade_of(error)] == "green" and TONES[grade_of(own)] == "vermilion"
    return poor or own > RULES.uneven * error


def advise_motion(families: Sequence[str]) -> str:
    """Return the motion that would tell families of effects apart."""
    motions = [find_family(name).told_by for name in families]
    known = join(list(dict.fromkeys(filter(None, motions))))
    return known or sentence("diagnosis.doubts", "motion")


def answer_trust(
    notes: Sequence[Note],
    doubt: str,
    missing: str,
    warnings: Sequence[str],
    in_doubt: str,
) -> Answer:
    """Return whether the result may be trusted, and why not.

    Parameters
    ----------
    notes : sequence of Note
    doubt : str
        Why no value is reliable; empty where something is.
    missing : str
        That the model lacks effects, with their probability (`MissingEffects.statement`).
    warnings : sequence of str
        What changes a decision.
    in_doubt : str
        Which values an effect that may be missing changes.
    """
    if doubt:
        return answer("trust", "no", doubt=doubt)
    usual = WORDS["note.hint"]["title"]
    grave = [n for n in notes if n.level == "warning"]
    checks = [n.text for n in grave if n.title == usual]
    others = [n for n in grave if n.title != usual]
    doubted = sentence("trust", "in_doubt", what=in_doubt) if in_doubt else ""
    if missing:
        # The only check stands here alone, so that no note repeats it.
        told = list_points(doubted, *checks * (len(checks) == 1))
        return answer("trust", "if_nothing", told, missing=missing)
    titles = list(dict.fromkeys(after_colon(n.title) for n in others))
    if warnings:
        titles.insert(0, sentence("trust", "warnings", warnings=warnings))
    # What leads is told in full; a note below the answers has all of the other checks.
    lead = "" if warnings or not others else others[0].text
    head = after_colon(checks[0]) if checks and not titles else _head_check(checks)
    titles += filter(None, [head])
    if len(checks) > 1:
        titles.append(sentence("trust", "checks", count=checks[1:]))
    if not titles and not in_doubt:
        return answer("trust", "yes", sentence("trust", "nothing"))
    if not titles:
        titles, doubted = [sentence("trust", "leaves", what=in_doubt)], ""
    second = f"{capital('; '.join(titles[1:]))}." if titles[1:] else ""
    return answer("trust", "care", list_points(lead, second, doubted), grave=titles[0])


def _head_check(checks: Sequence[str]) -> str:
    """Return the first check in short: a note below the answers has all of several sentences."""
    first = first_sentence(*checks)
    return first.partition(": ")[0] if ". " in "".join(checks[:1]) else first


def kind_columns(robot: Robot, kinds: Sequence[str]) -> list[Column]:
    """Return the columns of a table of joints: their names, then values of some kinds."""
    rotor = "screw" if {*robot.torque_units} == {"N"} else "rotor"
    known = ("moved", "m", *JOINT_KINDS)
    titles = (sentence("values", kind if kind in known else rotor) for kind in kinds)
    return [Column(sentence("values", "joint")), *(Column(title, "badge") for title in titles)]


def state_contradicted(result: Laddered[Any]) -> list[Finding]:
    """Return the bodies of the robot file that the logs contradict, the surest and largest first.

    If no body stands out, combinations of masses, moments and inertias are stated: files rarely
    state rotors and friction. Differences within the error of an identifiable parameter alone are
    no doubt.
    """
    fit, submodel, verdicts = result.fit, result.full.submodel, result.full.verdicts
    values = np.array([v.value for v in verdicts])
    stated = np.array([np.nan if x is None else x for x in stated_values(result, result.full)])
    sigma = np.array([v.sigma_label for v in verdicts])
    sigma[[Flag.NEGLIGIBLE in v.flags for v in verdicts]] = np.inf
    base = fit.structure.base
    wrong = find_wrong_bodies(fit)
    for change in wrong.springs.values():
        sigma = np.hypot(sigma, submodel.inverse @ change / REACH)
    off = np.abs(values - stated)
    size = np.maximum(np.abs(values), np.abs(stated))
    with np.errstate(divide="ignore", invalid="ignore"):
        sigmas = np.nan_to_num(off / sigma, posinf=0.0)
    # From percent.
    matters = off > Thresholds().sigma_percent / 100 * size
    reach = _list_reach(fit.structure, submodel)
    far = _of_bodies(base, submodel) & (sigmas > RULES.contradicted)
    if base.ambiguous:  # rounded numbers of the file make such columns
        far &= ROUNDED * np.abs(values) < reach
    each = [_state_wrong_bodies(wrong)] if wrong.hypotheses else []
    listed = np.flatnonzero(far) if (far & matters).any() else np.empty(0, int)
    # A value that the file states as zero is small beside its body.
    share = off[listed] / np.maximum(size, reach)[listed]
    for k in listed[np.argsort(-sigmas[listed] * share)].tolist():
        both = [stated_text(float(x[k]), float(sigma[k])) for x in (stated, values)]
        each.append(f"{_state_both(submodel, base, k, both)} ({sigmas[k]:.0f} σ)")
    if not each:
        return []
    lacked = [t for t in result.missing.ordered if t.group.family in LIKE_WEIGHT]
    large = np.abs(values) > RULES.contradicted * reach
    springs = [place for place, kind in wrong.hypotheses if kind == "spring"]
    impossible = bool((far & matters & large).any())
    compared = np.where(np.isin(np.arange(len(off)), listed), sigma, np.inf)
    apart = np.nan_to_num(values - stated)
    zero = find_wrong_zero(fit.structure, submodel, apart, compared)
    effects = [*map(describe_term, lacked)]
    advice = _advise(wrong, zero, last_bodies(fit.robot), effects, impossible=impossible)
    if play := joints_with_play(result.hints):
        advice = phrase("contradicted", "play", joints=play)
    floats = wrong.change <= 0 and bool((np.abs(values) < np.abs(stated))[listed].all())
    where = "at" if springs else "floats" if floats else "anywhere"
    look = phrase("contradicted", where, joints=springs)
    commanded = bool(fit.servo)
    return [Finding("contradicted", values=each, advice=advice, look=look, commanded=commanded)]


def _advise(
    wrong: WrongBodies,
    zero: tuple[str, float],
    last: Sequence[str],
    effects: Sequence[str],
    *,
    impossible: bool,
) -> str:
    """Return what to do before bodies are corrected: the model may lack an effect instead."""
    if effects:
        return phrase("contradicted", "lacks", effects=effects)
    joint, size = zero
    if joint:
        degrees = float(np.degrees(size))
        return phrase("contradicted", "zero", joint=joint, degrees=abs(degrees), large=size > 0)
    heavier = wrong.hypotheses[0][0] if wrong.change > 0 else ""
    if heavier in last:  # a tool has values that the body alone cannot have
        return phrase("contradicted", "tool", body=heavier)
    if impossible or wrong.change < -1:
        return phrase("contradicted", "impossible")
    sprung = any(kind == "spring" for _, kind in wrong.hypotheses)
    return phrase("contradicted", "sprung") if sprung else "Correct"


def _state_both(submodel: Submodel, base: BaseParameters, k: int, both: Sequence[str]) -> str:
    """Return a parameter in words, with its values by the file and by the logs."""
    file, logs = both
    name = submodel.columns[k]
    rows = [row for row in range(len(base)) if submodel.M[row, k]]
    terms = dict.fromkeys(p.name for row in rows for _, p in base.terms(row))
    members = [term for term in terms if term != name]
    if members:
        name += f" (combined with {listing(members, 1, things='parameters')})"
    return f"{name} = {file} {submodel.units[k]} in the file, {logs} by the logs"


#: Torque that acts as the weight of bodies does: along the position alone.
LIKE_WEIGHT = (
    JointStiffness.name,
    FreeSpring.name,
    GravitySpring.name,
    PositionTorque.name,
    "function_of_position",
)


def _list_reach(structure: Structure, submodel: Submodel) -> Array:
    """Return the size that each value may have by bodies of the file: of m, m·r and m·r², (k,)."""
    at = structure.inertial
    sizes = np.zeros(len(structure.columns))
    sizes[at] = entry_scale(*natural_scale(structure.nominal[at]))
    return np.abs(submodel.inverse @ structure.G) @ sizes


def _state_wrong_bodies(wrong: WrongBodies) -> str:
    """Return which body has wrong values, and by how much its mass is wrong."""
    named = dict[tuple[str, bool], str]()
    for place, kind in wrong.hypotheses:
        part: str = "other" if kind == "mass" else kind
        if kind == "mass" and not named and wrong.sd < np.inf:
            lighter = "lighter" if wrong.change > -1 else "negative"
            part = "heavier" if wrong.change > 0 else lighter
        holes = {"place": place, "share": abs(wrong.change), "sd": wrong.sd}
        # The likeliest error of a body stands for its others; a joint may share its name.
        named.setdefault((place, kind == "spring"), phrase("contradicted", part, **holes))
    return " or ".join(named.values())


def _of_bodies(base: BaseParameters, submodel: Submodel) -> Array:
    """Return which parameters combine numbers of bodies alone, (k,) bool."""
    others = np.zeros(len(base), bool)
    for row in range(len(base)):
        kinds = {parameter.kind for _, parameter in base.terms(row)}
        others[row] = not kinds <= {*INERTIAL_KINDS}
    uses = submodel.M != 0
    mixed: Array = (uses & others[:, None]).any(0)
    return ~mixed
