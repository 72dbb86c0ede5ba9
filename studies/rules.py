"""Which numbers by hand decide anything? Each is halved and doubled, and all answers are compared.

Answers are those to the corpus of foreign and spoilt logs (`foreign_logs`), to good logs with noise
of many kinds, and those of quick verbs on shipped robots. An answer is all that is said, and how
many rows are left. Numbers that change nothing are tried together; where a group does, it is
halved until single ones are left. A share above one half is halved and doubled in what lacks to
one, a factor below two in what is beyond one, a range in how far its ends are apart.

All answers take about a quarter of an hour of
processor time; ``--every 7`` asks each seventh.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any
from unittest.mock import patch

import foreign_logs
import numpy as np
import pandas as pd
from foreign import CASES, good
from foreign.tables import CONTAINERS, NAMES, TEXT
from shared import study_parser, write_answer

import identifiability
from identifiability import Robot, analyze, compare, diagnose, excite, payload, prune
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.output import plain
from identifiability.foundation.rules import Rule, RuleTable
from identifiability.regression.structure import Structure
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory, simulate
from identifiability.workflows.session import Session

#: One number: the room of its table, that table, and what it is.
Number = tuple[str, RuleTable, Rule]

#: Bases of the numbers that are varied.
OWN = ("by hand",)

#: Numbers that are tried together at first.
TOGETHER = 32

#: How a number is told that was halved, and doubled.
SIGNS = ("÷2", "×2")

#: Samples of good logs.
SAMPLES = 400


def numbers() -> Iterator[Number]:
    """Yield every number that has no other basis."""
    package = Path(identifiability.__file__).parent
    for path in sorted(package.rglob("rules.py")):
        room = ".".join(path.parent.relative_to(package).parts)
        if room == "foundation":
            continue
        module = import_module(f"identifiability.{room}.rules")
        tables = [t for t in vars(module).values() if isinstance(t, RuleTable)]
        kinds = [t for t in vars(module).values() if isinstance(t, type)]
        for kind in kinds:
            if kind.__module__ == module.__name__:
                table = next((t for t in tables if type(t) is kind), None) or kind()
                yield from ((room, table, r) for r in table.rows() if r.basis in OWN)


def scaled(value: Any, factor: float) -> Any:
    """Return a number halved or doubled."""
    if isinstance(value, tuple):
        low, high = value[0], value[-1]
        if len(value) == 2:
            return (low / factor, high * factor)
        return tuple(factor * x for x in value)
    if isinstance(value, int):
        return max(round(factor * value), 1)
    if 0.5 < value < 1:
        return 1 - (1 - value) / factor
    return 1 + factor * (value - 1) if 1 < value < 2 else factor * value


@dataclass(frozen=True)
class Job:
    """What is asked: its name, the answer, and what must be said of it (nothing of good logs)."""

    name: str
    ask: Callable[[], tuple[str, ...]]
    words: tuple[str, ...] = ()
    good: bool = False

    def answer(self) -> tuple[str, ...]:
        """Return all that is said."""
        try:
            return self.ask()
        except IdentifiabilityError as error:
            return (f"refused: {error}",)
        except Exception as error:  # noqa: BLE001 - a traceback is an answer
            return (f"traceback: {type(error).__name__}: {error}",)

    def named(self, said: Sequence[str]) -> bool:
        """Whether its fault is named."""
        text = "\n".join(said).casefold()
        return any(w.casefold() in text for w in self.words)


def opened(robot: Robot, log: Any, *, read: bool = False) -> tuple[str, ...]:
    """Return what is said of a log that is read, and opened."""
    session = Session.read(Structure.of(robot, good.MODEL), log)
    said = session.recordings.hints
    if read:
        return (*said, f"{[len(x) for x in session.recordings.fitted]} rows")
    opening = session.open()
    samples = opening.samples
    rows = [f"{s.survey.rows.tolist()} rows" for s in samples]
    return (*opening.hints, *(n for s in samples for n in s.notes), *rows)


def foreign_jobs(folder: Path) -> Iterator[Job]:
    """Yield the corpus; of text and containers it is only asked how they are read."""
    for k, case in enumerate(CASES):
        own = folder / str(k)
        own.mkdir()
        rng = np.random.default_rng(foreign_logs.SEED)
        path = case.write(foreign_logs.good_log(case.robot, case.lock).to_frame(), own, rng)
        try:
            robot = foreign_logs._robot(case, own)
        except IdentifiabilityError:
            continue
        read = case in (*TEXT, *CONTAINERS, *NAMES)
        yield Job(case.name, partial(opened, robot, path, read=read), case.words, case.quiet)


def good_jobs() -> Iterator[Job]:
    """Yield good logs with noise of many kinds."""
    for name, trajectory in good.ROBOTS.items():
        robot = Robot.load(name)
        motion = PrescribedMotion.of(shipped_trajectory(robot, trajectory), SAMPLES)
        clean = simulate(robot, motion, noise=Noise(), rng=np.random.default_rng(0))
        for what, noise in good.NOISES.items():
            log = good.noisy(clean, noise, np.random.default_rng(1), derivatives=False)
            yield Job(f"{name}, noise: {what}", partial(opened, robot, log), (), True)


def verb_jobs() -> Iterator[Job]:
    """Yield quick verbs on shipped robots."""
    for name in ("two-link", "five-bar"):
        robot = Robot.load(name)
        logs = []
        for k, rng in enumerate(np.random.default_rng(0).spawn(3)):
            motion = PrescribedMotion.of(shipped_trajectory(robot, "ab"[k % 2]), SAMPLES)
            logs.append(simulate(robot, motion, noise=Noise(torque=0.03), rng=rng))
        a, b, c = logs
        heavy = replace(c, tau=1.1 * c.tau)
        bare = [replace(x, dq=None, ddq=None) for x in logs]
        verbs: dict[str, Callable[[], Any]] = {
            "analyze": partial(analyze, robot, a, b, replicates=20),
            "analyze positions": partial(analyze, robot, bare[0], bare[1], replicates=0),
            "prune": partial(prune, robot, a, b, replicates=5),
            "compare": partial(compare, robot, [a], [b]),
            "compare changed": partial(compare, robot, [a], [heavy]),
            "excite": partial(excite, robot, evaluations=20, samples=50),
        }
        if name == "two-link":
            verbs["diagnose"] = partial(diagnose, robot, [a], [heavy], quick=True)
            known = analyze(robot, a, b, replicates=0)
            verbs["payload"] = partial(payload, robot, known, heavy)
        for verb, run in verbs.items():
            yield Job(f"{verb} {name}", partial(whole, run))


def whole(run: Callable[[], Any]) -> tuple[str, ...]:
    """Return all that an answer says, its numbers to two digits."""
    told = {k: v for k, v in run().to_dict().items() if k not in ("provenance", "seconds", "fit")}
    text = re.sub(r"-?\d+\.\d+(e[+-]?\d+)?", lambda m: f"{float(m[0]):.2g}", str(plain(told)))
    return tuple(text.split(", '"))


def vary(
    job: Job, all_of: Sequence[Number], first: set[str]
) -> Iterator[tuple[Number, float, str]]:
    """Yield each number that changes an answer, by how much it was multiplied, and what changes."""
    read: set[tuple[int, str]] = set()
    look = object.__getattribute__

    def watch(table: RuleTable, name: str) -> Any:
        read.add((id(table), name))
        return look(table, name)

    with patch.object(RuleTable, "__getattribute__", watch, create=True):
        before = job.answer()
    reached = [n for n in all_of if (id(n[1]), n[2].name) in read]
    for factor in (0.5, 2.0):

        def other(some: Sequence[Number], factor: float = factor) -> tuple[str, ...]:
            for _, table, rule in some:
                object.__setattr__(table, rule.name, scaled(rule.value, factor))
            try:
                return job.answer()
            finally:
                for _, table, rule in some:
                    object.__setattr__(table, rule.name, rule.value)

        rest = [n for n in reached if n[2].name not in first]
        groups = [[n] for n in reached if n[2].name in first]
        groups += [rest[k : k + TOGETHER] for k in range(0, len(rest), TOGETHER)]
        while groups:
            group = groups.pop()
            after = other(group)
            if after == before:
                continue
            if len(group) > 1:
                groups += [group[: len(group) // 2], group[len(group) // 2 :]]
                continue
            first.add(group[0][2].name)
            yield group[0], factor, what_changes(job, before, after)
    for n in reached:
        yield n, 1.0, ""


def what_changes(job: Job, before: tuple[str, ...], after: tuple[str, ...]) -> str:
    """Return what another answer does: to a fault, to a good log, to sentences or numbers."""
    if after[0].startswith("traceback"):
        return "traceback"
    if job.named(before) != job.named(after):
        return "named" if job.named(after) else "missed"
    mute = (
        [re.sub(r"[\d.]+(e[+-]\d+)?", "#", x) for x in before],
        [re.sub(r"[\d.]+(e[+-]\d+)?", "#", x) for x in after],
    )
    if mute[0] == mute[1]:
        return "numbers"
    return "false alarm" if job.good and len(after) > len(before) else "sentences"


def tell(name: str, own: dict[str, Any]) -> str:
    """Return what halving and doubling a number does, in a line."""
    told = []
    for sign in SIGNS:
        kinds = Counter(what.partition(":")[0] for what in own[sign])
        counts = ", ".join(f"{n} {kind}" for kind, n in kinds.most_common())
        told.append(f"{sign}: {counts or 'nothing'}" + "".join(f" ({w})" for w in own[sign][:1]))
    return f"{name:45s} {own['value']!s:12.12s} {own['reached']:4d}  {'  '.join(told)}"


def sensitivity(own: dict[str, Any]) -> str:
    """Return which of the answers that reach a number change with it, in brackets."""
    told = [
        f"{sign} changes {len(own[sign])}" + "".join(f" ({w})" for w in own[sign][:1])
        for sign in SIGNS
        if own[sign]
    ]
    of = f"of {own['reached']} answers that reach it"
    return f"[{', '.join(told)} {of}]" if told else f"[÷2 and ×2 change none {of}]"


def show(out: Path, asked: int, found: dict[str, dict[str, Any]]) -> None:
    """Write what was found so far."""
    reached = {name: own for name, own in found.items() if own["reached"]}
    deciding = [n for n, own in reached.items() if any(own[s] for s in SIGNS)]
    table = pd.DataFrame(
        [{"number": n, "value": str(own["value"]), "found": sensitivity(own)}
         for n, own in reached.items()], columns=["number", "value", "found"],
    )  # fmt: skip
    statement = (
        f"{asked} answers reach {len(reached)} of {len(found)} numbers by hand, of which "
        f"{len(deciding)} change an answer when they are halved or doubled."
    )
    more = {"answers": asked, "numbers": found}
    write_answer(out, "Which numbers decide?", statement, {"Numbers": table}, __doc__, more)


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the study."""
    parser = study_parser("rules", __doc__, "four answers")
    parser.add_argument("--every", type=int, default=1, help="ask each n-th answer only")
    parser.add_argument("--start", type=int, default=0, help="from this one on")
    parser.add_argument("--jobs", default="foreign,good,verbs", help="kinds of answers")
    parser.add_argument("--known", type=Path, help="what was found before, to tell")
    given = parser.parse_args(argv)
    given.every = 40 if given.quick else given.every
    warnings.simplefilter("ignore")
    every, first, asked = list(numbers()), set[str](), 0
    found: dict[str, dict[str, Any]] = {
        f"{room}.{r.name}": {"value": plain(r.value), "reached": 0, **{s: [] for s in SIGNS}}
        for room, _, r in every
    }
    if given.known:
        found, given.jobs = json.loads(given.known.read_text(encoding="utf-8"))["numbers"], ""
    with tempfile.TemporaryDirectory() as folder:
        kinds = {"foreign": partial(foreign_jobs, Path(folder)), "good": good_jobs}
        kinds["verbs"] = verb_jobs
        jobs = (job for kind in filter(None, given.jobs.split(",")) for job in kinds[kind]())
        for job in islice(jobs, given.start, None, given.every):
            asked += 1
            for (room, _, rule), factor, what in vary(job, every, first):
                own = found[f"{room}.{rule.name}"]
                if factor == 1:
                    own["reached"] += 1
                else:
                    own[SIGNS[factor > 1]].append(f"{what}: {job.name}")
            print(f"asked: {job.name}", flush=True)
            show(given.out, asked, found)
    for name, own in found.items():
        print(tell(name, own))
    return {"answers": asked, "numbers": found}


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
