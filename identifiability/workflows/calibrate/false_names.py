"""How often does `diagnose` name what is not there, on this robot and this motion?

The whole path is repeated from the raw log on: tests alone would miss false names by filters.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from identifiability.effects import bring, find_families
from identifiability.estimation.noise import JointRuns, find_runs, fit_residual_noise
from identifiability.foundation.engines.mapping import Engine, Steps
from identifiability.foundation.numbers import Share, exact_share
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import prepare_log
from identifiability.robot.closure import known_torque
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.diagnose import diagnose
from identifiability.workflows.opening import in_memory


@frozen
class FalseNames:
    """Names given to simulated logs in which nothing is missing: one for every trial with some."""

    trials: int
    named: tuple[str, ...]

    @property
    def rate(self) -> Share:
        """Share of trials with a false name, with its 95 % interval [Clopper & Pearson 1934]."""
        return exact_share(len(self.named), self.trials)

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        rate, counts = self.rate, {"trials": self.trials, "false_names": len(self.named)}
        told = {"rate": rate.value, "interval95": [rate.low, rate.high]}
        return {**counts, **told, "named": list(self.named), "statement": self.statement}

    def to_frame(self) -> pd.DataFrame:
        """Return one row: trials, false names, and their rate with its interval."""
        return pd.DataFrame([{"trials": self.trials, **vars(self.rate)}])

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        value, low, high = (100 * x for x in vars(self.rate).values())
        return (
            f"In {self.trials} simulated repetitions of these logs with nothing missing, "
            f"{len(self.named)} {'was' if len(self.named) == 1 else 'were'} given a name "
            f"({value:.0f} %, 95 %: {low:.0f} … {high:.0f} %){': ' if self.named else ''}"
            f"{'; '.join(self.named)}."
        )


def measure_false_names(
    analysis: Analysis, trials: int, seed: int, engine: Engine, steps: Steps
) -> FalseNames:
    """Diagnose logs of the same motion whose torque is that of the model and like noise.

    The model is fitted beside the effects that a diagnosis names, which are left out.
    """
    robot, logs = analysis.robot, in_memory(analysis.recordings)
    how: Any = analysis.settings["preparation"]
    judge = partial(diagnose, robot, preparation=how, quick=True)
    found = judge(logs, model=analysis.effects, seed=seed)
    samples = [prepare_log(robot, x, replace(how, decimate=1)) for x in logs]
    moves = [s.weight > 0 for s in samples]
    data, tau = np.concatenate(moves), np.concatenate([s.tau for s in samples])
    W = np.concatenate([found.model.regressor(robot, s.motion) for s in samples])
    runs = find_runs(samples)
    noise = fit_residual_noise(tau, W, JointRuns.of(runs, data))
    # Joints weigh by their torque, and where one sticks torque is what it was.
    rows = data / np.maximum(np.sqrt(np.mean(tau**2 * data, axis=0)), 1e-12)
    A, b = (W * rows[:, :, None]).reshape(data.size, -1), (tau * rows).ravel()
    base, value = len(found.structure.parameters), np.linalg.lstsq(A, b, rcond=None)[0]
    each = np.split(W[:, :, :base] @ value[:base], np.cumsum([len(m) for m in moves])[:-1])
    whole = [
        (log.select(robot.joints), s.motion.kept, part + known_torque(robot, s.motion), m)
        for log, s, part, m in zip(logs, samples, each, moves, strict=True)
    ]
    again = partial(judge, model=found.structure.model)
    named = partial(_name, again, find_families(None), whole, partial(noise.simulate, runs))
    items = [(seed + k, s) for k, s in enumerate(np.random.SeedSequence(seed).spawn(trials))]
    return FalseNames(trials, tuple(filter(None, engine.map(named, items, progress=steps))))


def _name(judge: Any, families: Any, logs: Any, simulate: Any, item: Any) -> str:
    """Return the names that one repetition is given, if any."""
    seed, stream = item
    noise, at, fake = simulate(np.random.default_rng(stream)), 0, []
    for log, kept, exact, moves in logs:
        tau = np.array(log.tau)
        tau[kept] = np.where(moves, exact + noise[at : at + len(exact)], tau[kept])
        fake.append(replace(log, tau=tau))
        at += len(exact)
    d = judge(fake, effects=bring(families), seed=seed)  # workers do not know plugins
    return "; ".join(f"{e.name} in {', '.join(e.joints)}" for e in d.effects)
