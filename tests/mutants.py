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
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

TESTS = Path(__file__).resolve().parent
ROOT = TESTS.parent
PACKAGE = "identifiability"

#: What a copy needs.
PARTS = (PACKAGE, "models", "tests", "pyproject.toml")

#: A test run that takes longer than this does not end [s].
PATIENCE = 180.0


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


def run_tests(copy: Path, tests: Sequence[str]) -> tuple[str, str]:
    """Return how a test run ended ("passed", "failed", "broken" or "endless"), and its output."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "--tb=line", "-p",
               "no:xdist", *(f"tests/{t}" for t in tests)]  # fmt: skip
    # Bytecode is told by size and second of its source: two mutants may look alike.
    env = os.environ | {
        "PYTHONPATH": str(copy), "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"
    }  # fmt: skip
    try:
        done = subprocess.run(
            command, cwd=copy, env=env, capture_output=True, text=True, timeout=PATIENCE,
            check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "endless", ""
    return {0: "passed", 1: "failed"}.get(done.returncode, "broken"), done.stdout + done.stderr


def try_mutant(copy: Path, mutant: Mutant) -> tuple[str, str]:
    """Put a mutant into a copy, run its tests and take it out again."""
    sources = read_sources(copy)
    path = find_anchor(mutant.old, sources)
    try:
        changed = sources[path].replace(mutant.old, mutant.new)
        (copy / path).write_text(changed, encoding="utf-8")
        return run_tests(copy, mutant.tests)
    finally:
        (copy / path).write_text(sources[path], encoding="utf-8")


def try_all(mutants: Sequence[Mutant], jobs: int) -> Iterator[tuple[Mutant, str, str]]:
    """Yield each mutant with how its tests ended, in order; each job has a copy of its own."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        free: SimpleQueue[Path] = SimpleQueue()
        for k in range(jobs):
            free.put(copy_checkout(Path(folder) / str(k)))

        def work(mutant: Mutant) -> tuple[str, str]:
            copy = free.get()
            try:
                return try_mutant(copy, mutant)
            finally:
                free.put(copy)

        copy = free.get()
        every = sorted({t for m in mutants for t in m.tests})
        ended, said = run_tests(copy, every)
        free.put(copy)
        if ended != "passed":
            raise SystemExit(f"The tests do not pass without a mutant ({ended}):\n{said}")
        with ThreadPoolExecutor(jobs) as pool:
            found = pool.map(work, mutants)
            for mutant, (how, text) in zip(mutants, found, strict=True):
                yield mutant, how, text


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
    for mutant, ended, said in try_all(mutants, options.jobs):
        lives = ended == "passed"
        survived += lives
        if ended == "broken":
            wrong += 1
            print(f"BROKEN    {mutant.name}\n{said[-2000:]}", flush=True)
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
