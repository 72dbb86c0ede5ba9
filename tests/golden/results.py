"""Golden results: the JSON of every verb, each on another shipped robot, kept as numbers.

``python tests/golden/results.py write`` makes them anew, and refuses cases that lie near a
threshold. ``check`` holds today's results against them, with ``--exact`` to the last bit (on the
machine that wrote them), with ``--plain`` on the plainest x86-64 processor. ``thresholds`` says
which rules a tenth or a nat would move across. A change of a golden result is a change of what
users are told: say why in the commit.

Processors sum in another order, so numbers are compared in units of their own standard error, or
of a tolerance that is stated here. Verdicts and sentences are compared exactly; numbers in a
sentence may differ by one unit of their last digit.
"""

import argparse
import json
import math
import os
import re
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np

from identifiability import (
    Noise,
    Robot,
    analyze,
    calibrate,
    compare,
    diagnose,
    excite,
    payload,
    prune,
    simulate,
)
from identifiability.foundation.output import plain
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.wording import at_terminal
from identifiability.simulation import PrescribedMotion, shipped_trajectory
from identifiability.workflows.analyze.belief import EFFORT

HERE = Path(__file__).resolve().parent
#: Each verb, and its robot.
VERBS = {
    "analyze": "two-link",
    "prune": "two-link",
    "diagnose": "five-bar",
    "calibrate": "two-link",
    "excite": "six-ups",
    "payload": "six-dof-arm",
    "compare": "six-dof-arm",
}
#: Seeds of cases that would lie near a threshold with seed 0.
SEEDS = {"prune": 3, "excite": 1, "diagnose": 11}
NOISE = Noise(torque=0.03)
#: Draws a walker: chains of other processors are other chains, and all of them must converge.
DRAWS = 400

#: Keys whose values say where a result was made, not what it is,
#: or repeats, to be read back, what other keys tell (the fitted model).
UNTOLD = ("provenance", "seconds", "preparation", "fit")

#: How far another processor may move a number: in standard errors of the number, in nats, and
#: as a share of the number, or of the largest of its list or kind.
OF_ERROR, OF_NATS, OF_NUMBER = 0.02, 0.02, 1e-3

#: The same share where a search ends by a tolerance of its own.
OF_SEARCH = {"excite": 0.01}

#: What was sampled, in standard deviations over the root of the effective sample size: two chains
#: differ by √2 of these, and 22 means and deviations are compared.
OF_SAMPLED = 8.0

#: Smaller numbers are rounding.
ROUNDING = 1e-9

#: Keys of rows whose numbers have the unit of the row's value.
IN_UNIT = {
    "value",
    "used",
    "standard_error",
    "projected",
    "nominal",
    "file",
    "low",
    "high",
    "terms",
}

#: Keys of log odds and of log predictive densities [nat].
IN_NATS = {"log_odds", "log_odds_after", "density", "density_se"}

#: Keys by which rows are known, so that rows that change places are still compared.
IDENTITY = ("name", "effect", "family", "place", "joint", "body", "log", "kind")

#: A number of a sentence (names have digits too), and one that was rounded: with a point, or in
#: percent. Other whole numbers are counts.
NUMBER = re.compile(r"(?<![\w.])[−-]?(?:\d[\d,]*(?:\.\d+)?|\.\d+)(?:e[+-]?\d+|·10[⁻⁰¹²³⁴-⁹]+)?")
ROUNDED = re.compile(
    r"(?<![\w.])([−-]?(?:\d[\d,]*)?\.\d+|[−-]?\d[\d,]*(?= ?%))(e[+-]?\d+|·10[⁻⁰¹²³⁴-⁹]+)?"
)


def logs_of(robot, hide=(), seed=0):
    """Return two simulated logs of a robot: short, with noise on the torque."""
    rngs = np.random.default_rng(seed).spawn(2)
    motions = [PrescribedMotion.of(shipped_trajectory(robot, name), 400) for name in "ab"]
    return [
        simulate(robot, motion, noise=NOISE, rng=rng, hide=[*hide])
        for motion, rng in zip(motions, rngs, strict=True)
    ]


def make(verb):
    """Return the JSON of one verb."""
    robot = Robot.load(VERBS[verb])
    seed = SEEDS.get(verb, 0)
    if verb == "excite":
        return json_of(excite(robot, evaluations=200, samples=200, seed=seed))
    if verb == "diagnose":
        logs = logs_of(robot, ["joint_stiffness=0.12"], seed)
        return json_of(diagnose(robot, logs[:1], logs[1:], quick=True))
    fitted, unseen = logs_of(robot, seed=seed)
    if verb == "prune":
        return json_of(prune(robot, fitted, unseen, replicates=20))
    if verb == "compare":
        return json_of(compare(robot, fitted, unseen))
    if verb == "payload":
        return json_of(payload(robot, analyze(robot, fitted, "none", replicates=20), unseen))
    with patch.dict(EFFORT, draws=DRAWS):
        result = analyze(robot, fitted, unseen, replicates=200, posterior=verb == "analyze")
    return json_of(result if verb == "analyze" else calibrate(result, replicates=16, refits=50))


def json_of(result):
    """Return what the result writes, without what another machine may say differently."""
    with at_terminal():
        told = json.loads(json.dumps(plain(result.to_dict())))
    return {key: value for key, value in told.items() if key not in UNTOLD}


def stored(verb):
    """Return where a golden result is kept."""
    return HERE / f"{verb}.json"


@dataclass(frozen=True)
class Comparison:
    """How two results are compared.

    Attributes
    ----------
    share : float
        How far apart numbers may be that have no standard error, relative to their size.
    exact : bool
        Whether the last bit counts, and the order of rows.
    decisions : bool
        Whether only decisions are compared: words, counts and truths, but no other number.
    """

    share: float = OF_NUMBER
    exact: bool = False
    decisions: bool = False

    def differences(self, old, new, at="", within=None):
        """Return where two results differ by more than they may.

        Parameters
        ----------
        old, new
            Parsed JSON.
        at : str
            Where in the result.
        within : float, optional
            How far numbers may be apart here; by default a share of their size.
        """
        if isinstance(old, dict) and isinstance(new, dict):
            return self._keyed(old, new, at, within)
        if isinstance(old, list) and isinstance(new, list):
            return self._listed(old, new, at, within)
        if isinstance(old, float) and _is_number(new):
            same = self._near(old, new, within)
        elif isinstance(old, str) and isinstance(new, str) and not self.exact:
            same = self._says(old, new)
        else:
            same = old == new
        return [] if same else [f"{at}: {old!r} and {new!r}"]

    def _keyed(self, old, new, at, within):
        found = [f"{at}.{key}: only in one" for key in sorted(old.keys() ^ new.keys())]
        for key in sorted(old.keys() & new.keys()):
            before = old[key]
            after = new[key]
            here = f"{at}.{key}"
            if key == "posterior" and not self.exact:
                found += self._sampled(before, after, here)
                continue
            allowed = tolerance_of(old, key, self.share)
            found += self.differences(before, after, here, within if allowed is None else allowed)
        return found

    def _listed(self, old, new, at, within):
        rows = _by_identity(old), _by_identity(new)
        if all(rows) and not self.exact:
            return self._keyed(*rows, at, within)
        if len(old) != len(new):
            return [f"{at}: {len(old)} and {len(new)} entries"]
        if within is None and all(map(_is_number, old)):
            within = self.share * max(map(abs, old), default=0.0)
        found = []
        for k, (before, after) in enumerate(zip(old, new, strict=True)):
            found += self.differences(before, after, f"{at}[{k}]", within)
        return found

    def _near(self, old, new, within):
        if self.exact or self.decisions:
            return self.decisions or old == new
        if not (math.isfinite(old) and math.isfinite(new)):
            return str(old) == str(new)
        allowed = self.share * abs(old) if within is None else within
        return abs(old - new) <= max(allowed, ROUNDING)

    def _says(self, old, new):
        """Return whether two sentences have the same words, and numbers as near as printed."""
        pattern = NUMBER if self.decisions else ROUNDED
        if pattern.sub("#", old) != pattern.sub("#", new):
            return False
        pairs = zip(ROUNDED.findall(old), ROUNDED.findall(new), strict=False)
        return self.decisions or all(_prints_like(a, b) for a, b in pairs)

    def _sampled(self, old, new, at):
        """Return where posteriors differ by more than their Monte-Carlo error."""
        before, after = (chain and chain["physical"] for chain in (old, new))
        if not before or not after:
            return self.differences(before, after, at)
        words = [{k: c[k] for k in ("trustworthy", "reasons")} for c in (before, after)]
        found = self.differences(*words, at)
        error = OF_SAMPLED / math.sqrt(min(before["ess"], after["ess"]))
        old, new = (_by_identity(chain["parameters"]) for chain in (before, after))
        for name in old.keys() & new.keys():
            a, b = old[name], new[name]
            within = error * a["sd"]
            for key in ("mean", "sd"):
                found += self.differences(a[key], b[key], f"{at}.{name}.{key}", within)
        return found


def tolerance_of(row, key, share):
    """Return how far numbers under a key of a row may be apart; None for a share of their size.

    Parameters
    ----------
    row : mapping
        A dictionary of a result, such as the row of a parameter.
    key : str
    share : float
        Of the largest number of the same kind, for values of bodies and joints.
    """
    if key in IN_NATS:
        return OF_NATS
    if key.startswith("seen_from") and row[key] is not None:
        limit = row[key]["size"] if isinstance(row[key], dict) else row[key]
        return OF_ERROR * abs(limit)  # a limit is a multiple of a standard error
    if "order" in row and key in ("covariance", "estimate", "parameters"):
        errors = np.sqrt(np.diag(row["covariance"]))
        return OF_ERROR * float(errors.min() ** (2 if key == "covariance" else 1))
    error = standard_error(row)
    if error is not None and key.endswith("percent"):
        percent = abs(row[key]) if _is_number(row[key]) else 0.0
        return OF_ERROR * percent * (1 + percent / 100)  # of σ, and of the value it is a share of
    if error is not None and key == "sigmas":
        return OF_ERROR * (1 + abs(row[key]))
    if error is not None and (key in IN_UNIT or key.startswith("sigma") or "interval95" in key):
        return OF_ERROR * error
    if "." in key and _is_number(row[key]):
        alike = [abs(x) for name, x in row.items() if _kind(name) == _kind(key) and _is_number(x)]
        return share * max(alike)
    return None


def standard_error(row):
    """Return the standard error of a row's value, in its unit; None where it has none."""
    if _is_number(row.get("sigma_robust_percent")) and _is_number(row.get("value")):
        return abs(row["value"]) * row["sigma_robust_percent"] / 100
    if _is_number(row.get("sigma")):
        return float(row["sigma"])
    if _is_number(row.get("low")) and _is_number(row.get("high")):
        return (row["high"] - row["low"]) / 4
    return None


def _kind(name):
    """Return what a parameter is, without its place and its axes: ``link1.Ixy`` is an ``I``."""
    return name.rpartition(".")[2].rstrip("xyz")


def _by_identity(rows):
    """Return rows by what they are called; nothing where they have no names of their own."""
    if not all(isinstance(row, dict) for row in rows):
        return {}
    names = [
        " ".join(row[key] for key in IDENTITY if isinstance(row.get(key), str)) for row in rows
    ]
    return dict(zip(names, rows, strict=True)) if all(names) and len(names) == len({*names}) else {}


def _prints_like(a, b):
    """Return whether two printed numbers, (digits, exponent), differ by one unit at most."""
    digits = [text.replace("−", "-").replace(",", "") for text in (a[0], b[0])]
    decimals = min(len(text.partition(".")[2]) for text in digits)
    apart = abs(float(digits[0]) - float(digits[1]))
    return a[1] == b[1] and apart <= 1.001 * 10.0**-decimals


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def check(verb, *, exact=False):
    """Return where today's result differs from the golden one."""
    old = json.loads(stored(verb).read_text())
    compared = Comparison(OF_SEARCH.get(verb, OF_NUMBER), exact)
    return compared.differences(old, make(verb), verb)


# `find_near`: which rules a case lies near.

#: A number of a rule table: its table and its name.
Rule = tuple[type[RuleTable], str]

#: How far from a rule a case must lie: this share of it, or so many nats.
SHARE, NATS = 0.1, 1.0

#: A width of a window, which moves every number a little and decides nothing.
NO_THRESHOLD = {"memories"}

#: Where such a share is counted from, if not from zero: R-hat is never below 1.
COUNTED_FROM = {"rhat": 1.0}


def all_rules():
    """Return every number by which a room decides."""
    tables = RuleTable.__subclasses__()
    rules = [(table, name) for table in tables for name in table.__annotations__]
    return [(table, name) for table, name in rules if name not in NO_THRESHOLD]


def moved_value(rule, sign):
    """Return a rule's number, a tenth or a nat higher (sign 1) or lower (sign -1)."""
    table, name = rule
    value = getattr(table, name)
    text = str(table.__annotations__[name])
    if isinstance(value, tuple):
        return tuple(x * (1 + sign * SHARE) for x in value)
    if "nat" in re.findall(r"nats?\b|log odds", text.replace("log odds", "nat")):
        return value + sign * NATS
    if isinstance(value, int):
        return value + sign * max(1, round(SHARE * value))
    start = COUNTED_FROM.get(name, 0.0)
    return start + (value - start) * (1 + sign * SHARE)


@contextmanager
def moved(rules, sign):
    """Move some rules while the context lasts."""
    values = {rule: moved_value(rule, sign) for rule in rules}

    def read(self, name):
        given = object.__getattribute__(self, name)
        return values.get((type(self), name), given)

    with patch.object(RuleTable, "__getattribute__", read, create=True):
        yield


def find_near(verb):
    """Return the rules that change a word, a count or a truth of a case if they are moved.

    Rules are moved together, and halved where something changes.
    """
    usual = make(verb)
    found = []
    for sign in (-1, 1):
        groups = [all_rules()]
        while groups:
            rules = groups.pop()
            changed = _changes(verb, usual, rules, sign)
            if not changed:
                continue
            if len(rules) == 1:
                table, name = rules[0]
                found.append(f"{table.__module__}.{name} {'+' if sign > 0 else '−'}: {changed[0]}")
            else:
                half = len(rules) // 2
                groups += [rules[:half], rules[half:]]
    return found


def _changes(verb, usual, rules, sign):
    try:
        with moved(rules, sign):
            made = make(verb)
    except Exception as error:  # noqa: BLE001 - whatever it is, a rule decides on it
        return [repr(error)]
    return Comparison(decisions=True).differences(usual, made)


# The plainest x86-64 processor.


def plain_environment():
    """Return the environment in which BLAS and NumPy use no AVX, as an old processor would."""
    from numpy._core import _multiarray_umath as built

    there = [name for name in built.__cpu_dispatch__ if built.__cpu_features__.get(name)]
    already = os.environ.get("NPY_DISABLE_CPU_FEATURES", "").split()
    disabled = " ".join([*already, *there])
    return {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": disabled}


def main():
    """Write or check all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("write", "check", "thresholds"))
    parser.add_argument("verbs", nargs="*", choices=[[], *VERBS], metavar="VERB")
    parser.add_argument("--exact", action="store_true", help="to the last bit")
    parser.add_argument("--plain", action="store_true", help="as the plainest processor does")
    asked = parser.parse_args()
    if asked.plain:
        again = [word for word in sys.argv if word != "--plain"]
        return subprocess.run(
            [sys.executable, *again], env=os.environ | plain_environment(), check=False
        ).returncode
    changed = 0
    for verb in asked.verbs or VERBS:
        lost = check(verb, exact=asked.exact) if asked.what == "check" else find_near(verb)
        changed += bool(lost)
        good = "as before" if asked.what == "check" else "far from every threshold"
        print(verb, good if not lost else f"{len(lost)} differences: {lost[:5]}", flush=True)
        if asked.what == "write" and not lost:
            text = json.dumps(make(verb), sort_keys=True, indent=0)
            stored(verb).write_text(text + "\n")
    return int(changed > 0)


if __name__ == "__main__":
    sys.exit(main())
