"""How many effective draws a second do the posteriors give, beside emcee's default move?

The 3-RPS at the paper's noise: Model 1 (37 parameters with signs, flat prior) and all standard
parameters on the cone of bodies that can exist; the semidefinite program, first and again; and
what ``analyze(…, posterior=True)`` takes beside the rest of `analyze`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import emcee
import numpy as np
import pandas as pd
from arviz_stats.base.array import array_stats
from threadpoolctl import threadpool_limits

from identifiability.foundation.engines.mapping import Serial
from identifiability.foundation.output import write_json
from identifiability.physical.fitted_model import FittedModel, LeastSquares, physical_set
from identifiability.physical.project import Projection, project
from identifiability.posterior.ensemble import sample_posterior
from identifiability.posterior.exact import build_sampler, interior
from identifiability.posterior.target import Prior, Target
from identifiability.report import Check, Section, frame_table, write_page
from identifiability.robot import Robot
from identifiability.simulation import (
    PAPER_NOISE,
    Noise,
    PrescribedMotion,
    shipped_trajectory,
    simulate,
)
from identifiability.workflows.analyze import Analysis, analyze
from identifiability.workflows.analyze.belief import START_MARGIN, state_prior
from identifiability.workflows.calibrate.outcome import build_target

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

Array = Any

#: Effective draws a second that are asked for, and seconds for the semidefinite program.
ASKED = {"Model 1 with signs": 10_000.0, "All bodies": 300.0}
FIRST, AGAIN = 0.1, 0.020


#: Robots of which the whole is timed, and a trajectory of each.
ROBOTS = {"two-link": "a", "five-bar": "a", "3-rps": "601", "six-dof-arm": "a", "six-ups": "a"}


#: Steps of the exact sampler alone before its draws count.
WARMUP = 20

#: Steps of the stretch move a kept draw; its draws are correlated over hundreds.
THIN = 20


@dataclass(frozen=True)
class Speed:
    """A sampler of one posterior, measured.

    Attributes
    ----------
    posterior, sampler : str
    parameters, draws : int
    seconds : float
        Of one processor, with the warm-up.
    ess : float
        Fewest effective draws of a parameter, in the bulk.
    rhat : float
        Largest nested R-hat; between walkers for the stretch move.
    """

    posterior: str
    sampler: str
    parameters: int
    draws: int
    seconds: float
    ess: float
    rhat: float

    @property
    def rate(self) -> float:
        """Effective draws a second."""
        return self.ess / self.seconds


def analyse(seed: int, samples: int | None = None) -> Analysis:
    """Return the analysis of one simulated log of the 3-RPS."""
    robot = Robot.load("3-rps")
    motion = PrescribedMotion.of(shipped_trajectory(robot, "601"), samples)
    log = simulate(robot, motion, noise=PAPER_NOISE, rng=np.random.default_rng(seed))
    return analyze(robot, log, replicates=0, seed=seed)


def sign_target(analysis: Analysis) -> tuple[Target, Array]:
    """Return the posterior of Model 1 with signs and a flat prior, and a point inside."""
    full = analysis.full
    target, start = build_target(full, full.submodel.reduce(analysis.information))
    flat = Prior.flat(len(full.submodel))
    return Target(target.data, flat, target.region, target.iact), start


def full_model(analysis: Analysis) -> FittedModel:
    """Return the unpruned model as it was fitted."""
    full = analysis.full
    return FittedModel.of(
        analysis.structure, full.submodel, analysis.information, full.estimate.estimator
    )


def body_target(analysis: Analysis) -> tuple[Target, Array]:
    """Return the posterior of all standard parameters on the cone, and a point inside."""
    structure = analysis.structure
    model = full_model(analysis)
    data, prior = model.data, state_prior(model)
    region = physical_set(structure)
    start = project(data, region, margin=START_MARGIN, reference=structure.nominal).phi
    return Target(data, prior, region), start


def measure(
    posterior: str, sampler: str, draw: Callable[[], Array], members: Callable[[int], Array]
) -> tuple[Speed, Array]:
    """Time a sampler that returns chains (C, N, p); `members` says which ensemble a chain is of."""
    begin = time.process_time()
    chains = draw()
    seconds = time.process_time() - begin
    stats, axes = array_stats, {"chain_axis": 0, "draw_axis": 1}
    ess = np.asarray(stats.ess(chains, method="bulk", **axes)).min()
    ids = members(len(chains))
    rhat = np.asarray(stats.rhat_nested(chains, superchain_ids=ids, **axes)).max()
    count, length, p = chains.shape
    speed = Speed(posterior, sampler, p, count * length, seconds, float(ess), float(rhat))
    return speed, chains


def measure_posterior(
    name: str, target: Target, start: Array, draws: int, walkers: int, budget: float, seed: int
) -> list[Speed]:
    """Return the speed of emcee with exact proposals, of the exact sampler, and of emcee alone."""
    rngs = np.random.default_rng(seed).spawn(3)

    def ours() -> Array:
        found = sample_posterior(target, start, rngs[0], draws=draws, walkers=walkers)
        return found.draws.reshape(-1, draws, target.size)

    def exact() -> Array:
        sampler = build_sampler(target)
        sampler, centre = sampler.centred(interior(target, sampler, start))
        eta = np.repeat(centre[None], 4 * walkers, axis=0)
        kept = []
        for _ in range(WARMUP + draws):
            eta = sampler.step(eta, rngs[1])
            kept.append(target.to_phi(eta))
        return np.stack(kept[WARMUP:], axis=1)

    def quarters(count: int) -> Array:
        return np.arange(count) * 4 // count

    first, chains = measure(name, "emcee, exact proposals", ours, quarters)
    second, _ = measure(name, "exact sampler alone", exact, quarters)
    last = chains[:, -1]
    third, _ = measure(
        name,
        "emcee, default stretch move",
        lambda: stretch(target, last, budget, rngs[2]),
        quarters,
    )
    return [first, second, third]


def stretch(target: Target, points: Array, budget: float, rng: np.random.Generator) -> Array:
    """Draw with emcee's default move for some seconds, from points that are draws already.

    It starts where others must first find to, and its density is vectorised: all in its favour.
    """
    sampler = build_sampler(target)

    def density(eta: Array) -> Array:
        return np.where(sampler.contains(eta), sampler.model.log_density(eta), -np.inf)

    walkers = 4 * target.size
    first = target.to_eta(points[rng.integers(len(points), size=walkers)])
    # Walkers that start at one point would never part.
    first = np.unique(first, axis=0)
    while len(first) < walkers:
        more = sampler.step(first, rng)
        first = np.concatenate([first, more])[:walkers]
    engine = emcee.EnsembleSampler(walkers, target.size, density, vectorize=True)
    state = emcee.State(
        first, random_state=np.random.RandomState(int(rng.integers(2**32))).get_state()
    )
    end, kept = time.process_time() + budget, []
    for now in engine.sample(
        state, iterations=10**9, thin_by=THIN, skip_initial_state_check=True, store=False
    ):
        kept.append(now.coords.copy())
        if time.process_time() > end and len(kept) >= 8:
            break
    chains: Array = target.to_phi(np.stack(kept, 1))
    return chains


def measure_program(analysis: Analysis, repeats: int) -> dict[str, float]:
    """Return times of the semidefinite program [s]: compiled and solved, and solved again."""
    structure = analysis.structure
    region, nominal = physical_set(structure), structure.nominal
    data = full_model(analysis).data
    Projection(region, reference=nominal).solve(data)  # imports are not the program's
    firsts, agains, rng = [], [], np.random.default_rng(0)
    for _ in range(repeats):
        begin = time.process_time()
        program = Projection(region, reference=nominal)
        program.solve(data)
        firsts.append(time.process_time() - begin)
        z = data.z + data.unit * rng.standard_normal(data.z.shape)
        other = LeastSquares(data.R, z, data.rss_min, data.dof)
        begin = time.process_time()
        program.solve(other)
        agains.append(time.process_time() - begin)
    return {
        "samples": float(analysis.information.samples),
        "parameters": float(region.size),
        "first": float(np.median(firsts)),
        "again": float(np.median(agains)),
    }


def measure_whole(name: str, seed: int) -> dict[str, str | float]:
    """Return what `analyze` of three short logs takes without posteriors and with [s]."""
    robot = Robot.load(name)
    motion = PrescribedMotion.of(shipped_trajectory(robot, ROBOTS[name]), 400)
    rngs = np.random.default_rng(seed).spawn(3)
    logs = [simulate(robot, motion, noise=Noise(torque=0.03), rng=rng) for rng in rngs]
    analyze(robot, logs[0], replicates=0)  # imports are not the posterior's
    row: dict[str, str | float] = {"robot": name}
    for key, posterior in (("without [s]", False), ("with [s]", True)):
        begin = time.process_time()
        found = analyze(robot, logs[:2], logs[2], posterior=posterior, seed=seed, engine=Serial())
        row[key] = time.process_time() - begin
    row["parameters"] = len(found.chosen.submodel)
    row["posterior / rest"] = float(row["with [s]"]) / float(row["without [s]"]) - 1
    return row


def speed_frame(speeds: Sequence[Speed]) -> pd.DataFrame:
    """Return one row a sampler, with what is asked of ours."""
    rows = []
    for s in speeds:
        asked = ASKED[s.posterior] if s.sampler.endswith("proposals") else None
        rate = spaced(s.rate)
        text = "" if asked is None else f"at least {spaced(asked)}"
        rows.append(
            {
                "posterior": s.posterior,
                "sampler": s.sampler,
                "parameters": s.parameters,
                "draws": s.draws,
                "seconds": s.seconds,
                "least effective draws": round(s.ess),
                "a second": rate if asked is None else Check(rate, s.rate >= asked, text),
                "nested R-hat": f"{s.rhat:.3f}",
            }
        )  # fmt: skip
    return pd.DataFrame(rows)


def spaced(x: float) -> str:
    """Return a whole number with thin spaces between thousands."""
    return f"{x:,.0f}".replace(",", "\u2009")


def program_frame(programs: Sequence[dict[str, float]]) -> pd.DataFrame:
    """Return one row a log."""
    return pd.DataFrame(
        [
            {
                "samples": int(p["samples"]),
                "parameters": int(p["parameters"]),
                "first [ms]": Check(f"{1e3 * p['first']:.0f}", p["first"] <= FIRST, "at most 100"),
                "again [ms]": Check(f"{1e3 * p['again']:.1f}", p["again"] <= AGAIN, "at most 20"),
            }
            for p in programs
        ]
    )


def state(speeds: Sequence[Speed], programs: Sequence[dict[str, float]]) -> str:
    """Return the answer in plain words."""
    texts = []
    for name in ASKED:
        ours, _, theirs = (s for s in speeds if s.posterior == name)
        texts.append(
            f"{name} ({ours.parameters} parameters): {spaced(ours.rate)} effective draws a second, "
            f"{spaced(ours.rate / theirs.rate)} times emcee's default move"
        )
    p = programs[-1]
    return (
        f"{'; '.join(texts)}. The semidefinite program takes {1e3 * p['first']:.0f} ms at first "
        f"and {1e3 * p['again']:.0f} ms again, however many samples there are."
    )


def write(
    speeds: Sequence[Speed],
    programs: Sequence[dict[str, float]],
    whole: Sequence[dict[str, str | float]],
    out: Path,
) -> None:
    """Write the page and the numbers, and print where."""
    lead = (
        "One process, one thread; seconds of the processor, with the warm-up. The stretch move "
        "starts from draws of the posterior, so it needs none; every twentieth of its steps is "
        "kept. Effective draws are the least of all parameters [Vehtari et al. 2021]; where R-hat "
        "is far from 1 they are overestimated."
    )
    sections = (
        Section("samplers", "Samplers", lead, (frame_table(speed_frame(speeds), digits=3),)),
        Section(
            "program", "The semidefinite program", "The nearest real robot, median of repetitions.",
            (frame_table(program_frame(programs)),),
        ),
        Section(
            "whole", "Beside the rest of analyze", "Three logs of 400 samples, in one process.",
            (frame_table(pd.DataFrame(whole), digits=3),),
        ),
    )  # fmt: skip
    out.parent.mkdir(parents=True, exist_ok=True)
    rows = [vars(s) | {"rate": s.rate} for s in speeds]
    text = state(speeds, programs)
    data = {"schema": "identifiability/study/posterior_speed/1", "statement": text}
    print(text)
    print(
        write_json(out, data | {"samplers": rows, "program": list(programs), "whole": list(whole)})
    )
    print(pd.DataFrame(whole).to_string(index=False, float_format="%.2f"))
    page = out.with_suffix(".html")
    subtitle = "3-RPS, trajectory 601, the paper's noise"
    print(
        write_page(
            "How fast are the posteriors?",
            text,
            sections,
            page,
            overline="Study",
            subtitle=subtitle,
        )
    )


def main(argv: Sequence[str] | None = None) -> list[Speed]:
    """Run the study."""
    parser = argparse.ArgumentParser(
        prog="posterior_speed", description=str(__doc__).partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "posterior_speed.json")
    parser.add_argument("--quick", action="store_true", help="a tenth of the draws")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    part = 0.1 if given.quick else 1.0
    with threadpool_limits(1):
        analysis = analyse(given.seed)
        signs, bodies = sign_target(analysis), body_target(analysis)
        speeds = measure_posterior(
            "Model 1 with signs", *signs, max(20, int(200 * part)), 64, 60 * part, given.seed
        )
        speeds += measure_posterior(
            "All bodies", *bodies, max(20, int(80 * part)), 64, 60 * part, given.seed
        )
        logs = [analyse(given.seed, samples) for samples in (100, 10_000 if part == 1 else 1000)]
        repeats = 3 if given.quick else 15
        programs = [measure_program(a, repeats) for a in (analysis, *logs)]
        whole = [measure_whole(name, given.seed) for name in ROBOTS]
    write(speeds, programs, whole, given.out)
    return speeds


if __name__ == "__main__":
    main()
