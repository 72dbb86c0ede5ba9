"""Would the laws notice? Faults are put into a copy of the package, one at a time.

    python tests/mutants.py [--only WORD] [--jobs 2] [--list]

Each file in ``tests/mutants/`` declares some::

    tests = ["laws/numbers"]             # run for each, below tests/

    [[mutants]]
    name = "the paper's factor is 20"
    old = "PAPER_FACTOR = 10.0"          # stands exactly once in the package, wherever it is
    new = "PAPER_FACTOR = 20.0"
    tests = ["laws/numbers/test_x.py"]   # optional: instead of the file's
    survives = "Why no test can see it." # optional: the mutant is allowed to survive

A mutant dies if a test fails (or does not end); one that cannot be imported is a mistake of the
list. The exit code is 1 if a mutant survives unexplained, dies although it is said to survive, or
cannot be applied.
"""

from __future__ import annotations

import argparse
import importlib
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

# Read when NumPy is imported: its threads would neither survive a fork nor help.
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

import pytest

TESTS = Path(__file__).resolve().parent
ROOT = TESTS.parent
PACKAGE = "identifiability"

#: What a copy needs.
PARTS = (PACKAGE, "models", "studies", "tests", "pyproject.toml")

#: What the package and its tests import and takes seconds.
HEAVY = ("numpy", "scipy.stats", "scipy.signal", "pandas", "clarabel", "pinocchio", "pydantic")

#: A mutant whose tests compute longer than this does not end; one that sleeps waits longer [s].
PATIENCE, ASLEEP = 300, 3000.0


@dataclass(frozen=True)
class Mutant:
    """One fault: a text of the package and what stands there instead."""

    name: str
    old: str
    new: str
    tests: tuple[str, ...]
    survives: str = ""


def read_mutants(folder: Path = TESTS / "mutants") -> list[Mutant]:
    """Return the mutants of all lists."""
    found = []
    for path in sorted(folder.glob("*.toml")):
        entry = tomllib.loads(path.read_text(encoding="utf-8"))
        found += [
            Mutant(**{**item, "tests": tuple(item.get("tests", entry["tests"]))})
            for item in entry["mutants"]
        ]
    return found


def find_anchor(text: str, sources: dict[Path, str]) -> Path:
    """Return the file of the package in which a text stands, once and nowhere else."""
    counts = {path: source.count(text) for path, source in sources.items() if text in source}
    if sum(counts.values()) != 1:
        where = ", ".join(f"{n} × in {path}" for path, n in counts.items()) or "nowhere"
        raise LookupError(f"its text stands {where}; give one that stands exactly once")
    return next(iter(counts))


def read_sources(root: Path = ROOT) -> dict[Path, str]:
    """Return the text of every module of the package, by its path below the root."""
    files = sorted((root / PACKAGE).rglob("*.py"))
    return {path.relative_to(root): path.read_text(encoding="utf-8") for path in files}


def find_mistakes(mutants: Sequence[Mutant], sources: dict[Path, str]) -> list[str]:
    """Return what is wrong with the lists: names, texts, tests."""
    out, names = [], set[str]()
    for mutant in mutants:
        try:
            find_anchor(mutant.old, sources)
        except LookupError as error:
            out.append(f"{mutant.name}: {error}")
        if mutant.name in names:
            out.append(f"{mutant.name}: two mutants have this name")
        if mutant.old == mutant.new:
            out.append(f"{mutant.name}: it changes nothing")
        names.add(mutant.name)
        gone = [t for t in mutant.tests if not (TESTS / t.partition("::")[0]).exists()]
        out += [f"{mutant.name}: there is no {t} in tests/" for t in gone]
    return out


def copy_checkout(folder: Path) -> Path:
    """Return a copy of what the tests need."""
    for part in PARTS:
        source, target = ROOT / part, folder / part
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, target)
    return folder


@dataclass
class Trial:
    """A process that tests one copy of the package, with a mutant in it or none."""

    mutant: Mutant | None
    copy: Path
    tests: Sequence[str]
    clean: tuple[Path, str] | None = None
    ended: str = ""
    said: str = ""

    def start(self) -> Trial:
        """Put the mutant into the copy and begin."""
        if self.mutant is not None:
            sources = read_sources(self.copy)
            path = find_anchor(self.mutant.old, sources)
            self.clean = (self.copy / path, sources[path])
            self.times = self.clean[0].stat()
            changed = sources[path].replace(self.mutant.old, self.mutant.new)
            self.clean[0].write_text(changed, encoding="utf-8")
        self.began, self.output = time.monotonic(), self.copy / "output.txt"
        self.pid = os.fork()
        if not self.pid:
            # Bytecode of what is never mutated is kept, that of mutants not written.
            sys.dont_write_bytecode = self.mutant is not None
            if self.mutant is not None:  # time of its own: other work makes nothing endless
                resource.setrlimit(resource.RLIMIT_CPU, (PATIENCE, PATIENCE + 10))
            test_here(self.copy, self.tests, self.output)
        return self

    def finished(self) -> bool:
        """Whether it has ended; then its mutant is out of the copy again."""
        pid, status = os.waitpid(self.pid, os.WNOHANG)
        asleep = not pid and time.monotonic() - self.began > ASLEEP
        if asleep:
            os.kill(self.pid, signal.SIGKILL)
            _, status = os.waitpid(self.pid, 0)
        elif not pid:
            return False
        ends = {0: "passed", 1: "failed", -signal.SIGXCPU: "endless", -signal.SIGKILL: "endless"}
        self.ended = ends.get(os.waitstatus_to_exitcode(status), "broken")
        self.said = self.output.read_text(encoding="utf-8")
        if self.clean is not None:
            self.clean[0].write_text(self.clean[1], encoding="utf-8")
            os.utime(self.clean[0], ns=(self.times.st_atime_ns, self.times.st_mtime_ns))
        return True


def test_here(copy: Path, tests: Sequence[str], output: Path) -> NoReturn:
    """Run tests of a copy in this process, a fork, and end it."""
    code = 3
    try:
        with output.open("w", encoding="utf-8") as file:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
        os.chdir(copy)
        sys.path.insert(0, str(copy))
        where = [f"tests/{t}" for t in tests]
        code = int(pytest.main(["-x", "-q", "--no-header", "--tb=line", "-p", "no:xdist", *where]))
        sys.stdout.flush()
    finally:
        os._exit(code)


def try_all(mutants: Sequence[Mutant], jobs: int) -> Iterator[Trial]:
    """Yield the trial of each mutant as it ends; each job has a copy of its own.

    What takes long to import is imported here, once, and the package itself never.
    """
    for module in HEAVY:
        importlib.import_module(module)
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        first = copy_checkout(Path(folder) / "0")
        every = sorted({t for m in mutants for t in m.tests})
        without = Trial(None, first, every).start()
        while not without.finished():
            time.sleep(0.01)
        if without.ended != "passed":
            raise SystemExit(f"The tests fail without a mutant ({without.ended}):\n{without.said}")
        copies = [shutil.copytree(first, Path(folder) / str(k)) for k in range(1, jobs)] + [first]
        left, running = list(reversed(mutants)), list[Trial]()
        while left or running:
            while left and copies:
                mutant = left.pop()
                running.append(Trial(mutant, copies.pop(), mutant.tests).start())
            for trial in running.copy():
                if trial.finished():
                    running.remove(trial)
                    copies.append(trial.copy)
                    yield trial
            time.sleep(0.01)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the mutants and say which survive."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="only mutants whose name has this")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time")
    parser.add_argument("--list", action="store_true", help="print the names and end")
    options = parser.parse_args(arguments)
    mutants = [m for m in read_mutants() if options.only in m.name]
    mistakes = find_mistakes(mutants, read_sources())
    if options.list:
        print(*(m.name for m in mutants), *mistakes, sep="\n")
        return int(bool(mistakes))
    if mistakes or not mutants:
        print(*(mistakes or ["no mutant has such a name"]), sep="\n")
        return 1
    start, wrong, survived = time.monotonic(), 0, 0
    for trial in try_all(mutants, options.jobs):
        mutant, ended = trial.mutant, trial.ended
        lives = ended == "passed"
        survived += lives
        if ended == "broken":
            wrong += 1
            print(f"BROKEN    {mutant.name}\n{trial.said[-2000:]}", flush=True)
        elif lives != bool(mutant.survives):
            wrong += 1
            what = "SURVIVES " if lives else "DIES (but is said to survive) "
            print(f"{what} {mutant.name}", flush=True)
        else:
            print(f"{'survives' if lives else 'dies'}  {mutant.name}", flush=True)
            if lives:
                print(f"          {mutant.survives}")
    spent = time.monotonic() - start
    print(f"{len(mutants)} mutants, {survived} survive, {wrong} unexplained; {spent:.0f} s")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
