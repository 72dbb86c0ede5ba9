"""Would the laws notice? Faults are put into a copy of the package, one at a time.

    python tests/mutants.py [--only WORD] [--draw N --seed S] [--jobs 2]

Each file in ``tests/mutants/`` declares some::

    tests = ["laws/numbers"]             # run for each, below tests/

    [[mutants]]
    name = "the paper's factor is 20"
    old = "PAPER_FACTOR = 10.0"          # stands exactly once in the package, wherever it is
    new = "PAPER_FACTOR = 20.0"
    tests = ["laws/numbers/test_x.py"]   # optional: instead of the file's; slow laws by their names

A mutant dies if a test fails (or does not end). The exit code is 1 if a mutant survives or cannot
be applied.
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

TESTS = Path(__file__).resolve().parent
ROOT = TESTS.parent
PACKAGE = "identifiability"

#: What a copy needs.
PARTS = (PACKAGE, "models", "studies", "tests", "docs", "pyproject.toml")

#: How a mutant ended, if its tests did not fail.
WORDS = {"passed": "survives", "broken": "broken"}

#: A mutant whose tests take longer than this does not end [s].
PATIENCE = 1500


@dataclass(frozen=True)
class Mutant:
    """One fault: a text of the package and what stands there instead."""

    name: str
    old: str
    new: str
    tests: tuple[str, ...]


def read_mutants():
    """Return the mutants of all lists."""
    found = []
    for path in sorted(TESTS.glob("mutants/*.toml")):
        entry = tomllib.loads(path.read_text())
        found += [
            Mutant(**{**item, "tests": tuple(item.get("tests", entry["tests"]))})
            for item in entry["mutants"]
        ]
    return found


def find_anchor(text, sources):
    """Return the file of the package in which a text stands, once and nowhere else."""
    counts = {path: source.count(text) for path, source in sources.items() if text in source}
    if sum(counts.values()) != 1:
        where = ", ".join(f"{n} × in {path}" for path, n in counts.items()) or "nowhere"
        raise LookupError(f"its text stands {where}; give one that stands exactly once")
    return next(iter(counts))


def read_sources(root=ROOT):
    """Return the text of every module and table of the package, by its path below the root."""
    files = [f for ending in ("py", "toml") for f in sorted((root / PACKAGE).rglob(f"*.{ending}"))]
    return {path.relative_to(root): path.read_text() for path in files}


def find_mistakes(mutants, sources):
    """Return what is wrong with the lists: names, texts, tests."""
    out = []
    names = set[str]()
    for mutant in mutants:
        try:
            find_anchor(mutant.old, sources)
        except LookupError as error:
            out.append(f"{mutant.name}: {error}")
        if mutant.name in names:
            out.append(f"{mutant.name}: two mutants have this name")
        names.add(mutant.name)
        gone = [t for t in mutant.tests if not is_there(t)]
        out += [f"{mutant.name}: there is no {t} in tests/" for t in gone]
    return out


def is_there(test):
    """Return whether there is a folder, a file or a test of this name below tests/."""
    file, _, name = test.partition("::")
    path = TESTS / file
    if not name:
        return path.exists()
    start = f"def {name.partition('[')[0]}("
    return path.is_file() and start in path.read_text()


def copy_checkout(folder):
    """Return a copy of what the tests need."""
    for part in PARTS:
        source = ROOT / part
        target = folder / part
        if source.is_dir():
            shutil.copytree(source, target)
        else:
            shutil.copy2(source, target)
    return folder


def run(copy, tests, *, write):
    """Return how the tests of a copy end, and what they print."""
    words = ["-x", "-q", "--no-header", "--tb=line", *(f"tests/{t}" for t in tests)]
    environment = {"PYTHONPATH": str(copy), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    # Bytecode of what is never mutated is kept, that of mutants not written.
    flags = [] if write else ["-B"]
    try:
        done = subprocess.run(
            [sys.executable, *flags, "-m", "pytest", *words],
            cwd=copy, env=os.environ | environment, capture_output=True, text=True, check=False,
            timeout=PATIENCE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "endless", ""
    ends = {0: "passed", 1: "failed"}
    return ends.get(done.returncode, "broken"), done.stdout + done.stderr


def try_one(mutant, copies):
    """Put a mutant into a copy that nobody uses, test it, and take it out again."""
    copy = copies.get()
    path = copy / find_anchor(mutant.old, read_sources(copy))
    clean = path.read_text()
    times = path.stat()
    path.write_text(clean.replace(mutant.old, mutant.new))
    ended, said = run(copy, mutant.tests, write=False)
    path.write_text(clean)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    copies.put(copy)
    return mutant, ended, said


def try_all(mutants, jobs):
    """Say of each mutant how it ends; return how many do not die."""
    copies = SimpleQueue[Path]()
    survived = 0
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, ThreadPoolExecutor(jobs) as pool:
        for k in range(jobs):
            copies.put(copy_checkout(Path(folder) / str(k)))
        every = sorted({t for m in mutants for t in m.tests})
        ended, said = run(Path(folder) / "0", every, write=True)
        if ended != "passed":
            raise SystemExit(f"The tests fail without a mutant ({ended}):\n{said}")
        for mutant, how, said in pool.map(lambda m: try_one(m, copies), mutants):
            survived += how in {"passed", "broken"}
            print(f"{WORDS.get(how, 'dies'):8}  {mutant.name}", flush=True)
            if how == "broken":
                print(said)
    print(f"{len(mutants)} mutants, {survived} survive")
    return survived


def main(arguments=None):
    """Run the mutants and say which survive."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="only mutants whose name has this")
    parser.add_argument("--draw", type=int, metavar="N", help="only so many, drawn at random")
    parser.add_argument("--seed", type=int, default=0, help="of the draw")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time")
    options = parser.parse_args(arguments)
    mutants = [m for m in read_mutants() if options.only in m.name]
    if options.draw is not None:
        mutants = random.Random(options.seed).sample(mutants, min(options.draw, len(mutants)))
    mistakes = find_mistakes(mutants, read_sources())
    if mistakes or not mutants:
        print(*(mistakes or ["no mutant has such a name"]), sep="\n")
        return 1
    return int(try_all(mutants, options.jobs) > 0)


if __name__ == "__main__":
    sys.exit(main())
