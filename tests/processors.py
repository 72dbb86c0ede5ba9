"""Does another processor say the same? The demo and the tests under every core type of OpenBLAS.

    python tests/processors.py [--demo-only] [--cores Haswell,Zen] [pytest arguments …]

OpenBLAS chooses its kernels by processor, and their sums differ in the last digit. Each core type
runs the demo and the tests; core types that this processor cannot run are listed as not run. What
the demo's JSON may differ by from that of the first core type:

- words, verdicts, counts and decisions: not at all;
- estimates and their σ: 1e-6 of σ;
- errors: 1e-6 of themselves;
- the nearest real robot, which an iterative solver finds: 1e-4 of its kind of values;
- sampled numbers: five standard errors of the difference of two samples of their size.

Hashes of logs that were simulated on the way differ with their last digits and are not compared.
The exit code is 1 if something differs more or a test fails.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
CORES = ("Haswell", "SkylakeX", "Nehalem", "Zen")

#: Share of σ, or of an error, that may differ.
CLOSE = 1e-6

#: The same of margins of certificates, and of how bodies share what the data do not part, which a
#: solver bounds no more tightly than that.
MARGIN = 1e-4

#: Last digits of stated numbers of a study that may differ: values on the edge of their rounding.
HANDFUL = 5

#: Standard errors that two samples may be apart: among a thousand numbers none is by chance.
APART = 5.0

#: Standard error of the 2.5 % quantile of a normal sample, in units of that of its mean.
QUANTILE = 2.7

ASK = """
import numpy, scipy.linalg, threadpoolctl
a = numpy.ones((40, 40)) + numpy.eye(40)
scipy.linalg.solve(a, a @ a)
found = [x["architecture"] for x in threadpoolctl.threadpool_info() if "architecture" in x]
print(" ".join(found))
"""


def environment(core: str) -> dict[str, str]:
    """Return the environment in which OpenBLAS takes the kernels of a core type."""
    return os.environ | {"OPENBLAS_CORETYPE": core, "OMP_NUM_THREADS": "1"}


def find_kernels(core: str) -> str:
    """Return the kernels that OpenBLAS takes for a core type.

    Raises
    ------
    RuntimeError
        If they cannot be run here, with the reason.
    """
    done = subprocess.run(
        [sys.executable, "-c", ASK], env=environment(core), capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"its kernels stop with code {done.returncode}")
    if not done.stdout.split():
        raise RuntimeError("NumPy is built without OpenBLAS")
    return " and ".join(sorted(set(done.stdout.split())))


def run_demo(core: str, folder: Path) -> dict[str, Any]:
    """Return the JSON of the demo under a core type."""
    command = [sys.executable, "-m", "identifiability", "demo", "--folder", str(folder)]
    subprocess.run(command, cwd=ROOT, env=environment(core), check=True, stdout=subprocess.DEVNULL)
    content: dict[str, Any] = json.loads((folder / "demo.json").read_text(encoding="utf-8"))
    return content


def run_study(core: str, folder: Path) -> dict[str, Any]:
    """Return what the first study states under a core type, by verb."""
    program, env = (sys.executable, "-m", "identifiability"), environment(core)
    env["PYTHONPATH"] = str(ROOT)
    subprocess.run([*program, "new", str(folder)], env=env, check=True, capture_output=True)
    logs = ("robot.urdf", "run1.csv", "run2.csv", "--validate", "run3.csv")
    out = {}
    for verb, *options in (("analyze",), ("prune", "--quick"), ("diagnose",)):
        command = [*program, verb, *logs, *options, "--json", f"{verb}.json"]
        subprocess.run(command, cwd=folder, env=env, check=True, capture_output=True)
        out[verb] = json.loads((folder / f"{verb}.json").read_text(encoding="utf-8"))
    return out


def leaves(content: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield every value of a result with the way to it."""
    if isinstance(content, dict | list):
        items = content.items() if isinstance(content, dict) else enumerate(content)
        for key, value in items:
            yield from leaves(value, (*path, key))
    else:
        yield path, content


def at(content: Any, path: tuple[Any, ...]) -> Any:
    """Return what stands at the end of a way."""
    for key in path:
        content = content[key]
    return content


def allowed(content: dict[str, Any], path: tuple[Any, ...], value: float) -> float:
    """Return how far a number may be from that of another processor; infinite if at all."""
    kind, last = path[0], path[-1]
    if kind == "posterior":
        return _allowed_of_samples(content, path)
    if kind in ("parameters", "full_parameters"):
        row = content[kind][path[1]]
        drawn = content["posterior"] is not None and row["interval95"] != row["data_interval95"]
        sampled = path[2] == "interval95" and drawn
        if sampled:
            low, high = row["data_interval95"]
            sd = (high - low) / 3.92
            return APART * QUANTILE * sd / math.sqrt(_effective(content) / 2)
        if path[2] == "bias_sigma":
            return 2 * CLOSE  # of estimates that are each so close
        if path[2] in ("value", "interval95", "data_interval95", "nominal", "sigma", "projected"):
            sigma = row["sigma"]
            return CLOSE * (sigma if sigma is not None else abs(value))
    if "margin" in str(last):
        return MARGIN * abs(value)
    if path[:2] == ("physical", "parameters"):
        # Where nothing holds a value it is rounding; the kind says what is small.
        suffix = str(last).rpartition(".")[2]
        known = content["physical"]["parameters"].items()
        return MARGIN * max(abs(v) for k, v in known if k.endswith(f".{suffix}"))
    if path == ("structure", "gap", 1):
        return 1e-12  # of the largest singular value: it is zero
    return CLOSE * abs(value)


def _allowed_of_samples(content: dict[str, Any], path: tuple[Any, ...]) -> float:
    last = path[-1]
    if last in ("ess", "rhat", "acceptance", "sway"):
        return math.inf  # of these chains; whether they may be shown is compared
    row = at(content, path[: 4 if path[1] != "standard" else 3])
    if last in ("prior_mean", "prior_sd"):
        return CLOSE * abs(row["prior_sd"])
    error = row["sd"] / math.sqrt(_effective(content, path[1]) / 2)
    return APART * error * (QUANTILE if "interval95" in path else 1.0)


def _effective(content: dict[str, Any], posterior: str = "physical") -> float:
    """Return the fewest effective draws of any parameter of a posterior."""
    name = "physical" if posterior == "standard" else posterior
    draws: float = content["posterior"][name]["ess"]
    return draws


def compare(ours: dict[str, Any], theirs: dict[str, Any]) -> list[str]:
    """Return what differs by more than it may, one line each."""
    mine, other = dict(leaves(ours)), dict(leaves(theirs))
    out = [
        f"{_name(path)} stands in one of them only" for path in sorted(mine.keys() ^ other, key=str)
    ]
    for path in mine.keys() & other.keys():
        a, b = mine[path], other[path]
        if path[0] == "provenance" or path[-1] in ("determined_by", "reason", "statement"):
            continue  # sentences repeat the numbers, rounded
        if isinstance(a, bool | str | int) or a is None or not isinstance(b, float):
            if a != b:
                out.append(f"{_name(path)}: {a} and {b}")
            continue
        most = allowed(ours, path, a)
        if abs(a - b) > most:
            out.append(
                f"{_name(path)}: {a!r} and {b!r} are {abs(a - b):.2g} apart, allowed {most:.2g}"
            )
    return out


def _name(path: tuple[Any, ...]) -> str:
    return ".".join(str(key) for key in path)


def main() -> int:
    """Run every core type; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--demo-only", action="store_true", help="leave the tests out")
    parser.add_argument("--cores", default=",".join(CORES), help="core types, separated by commas")
    asked, arguments = parser.parse_known_args()
    failed, first = False, None
    ran: set[str] = set()
    for core in asked.cores.split(","):
        try:
            kernels = find_kernels(core)
        except RuntimeError as error:
            sys.stdout.write(f"{core}: not run, {error}\n")
            continue
        if kernels in ran:
            sys.stdout.write(f"{core}: not run again, OpenBLAS takes the kernels of {kernels}\n")
            continue
        ran.add(kernels)
        with tempfile.TemporaryDirectory() as folder:
            result = run_demo(core, Path(folder))
        first = first or (core, result)
        differences = compare(first[1], result)
        said = f"the demo agrees with {first[0]}" if core != first[0] else "the demo ran"
        sys.stdout.write(f"{core}: {f'{len(differences)} differences' if differences else said}\n")
        sys.stdout.write("".join(f"  {line}\n" for line in differences))
        failed |= bool(differences)
        if not asked.demo_only:
            command = [sys.executable, "-m", "pytest", "-q", *arguments]
            done = subprocess.run(command, cwd=ROOT, env=environment(core), check=False)
            sys.stdout.write(f"{core}: the tests {'fail' if done.returncode else 'pass'}\n")
            failed |= bool(done.returncode)
        sys.stdout.flush()
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
