"""The inner work gives the answers of its naive forms, and is faster."""

import pytest
from inside import elimination, program, refits, scores
from posterior_speed import analyse
from threadpoolctl import threadpool_limits

from identifiability.estimation.bootstrap import draw_blocks, merge_blocks
from identifiability.estimation.least_squares import refit
from identifiability.posterior.ensemble import sample_posterior


@pytest.fixture(scope="module")
def analysis():
    with threadpool_limits(1):
        return analyse(0)


# What was measured is three times these or more.
@pytest.mark.everything
@pytest.mark.parametrize(
    ("measure", "least"),
    [
        (lambda a: refits.measure(a, 100, 0), 3.0),
        (lambda a: elimination.measure(a, 5), 7.0),
        (lambda a: program.measure(a, 3), 1.2),
        (lambda _: scores.measure(5, 20, 0), 10.0),
    ],
    ids=["bootstrap", "pruning", "semidefinite program", "diagnosis"],
)
def test_same_answers_in_less_time(measure, least, analysis):
    with threadpool_limits(1):
        pair = measure(analysis)
    assert pair.agree, f"{pair.gap:.2g} ({pair.measure}) is above {pair.most:g}"
    assert pair.ratio >= least, f"{pair.ratio:.2f} times faster"


def test_bootstrap_refits(benchmark, analysis):
    import numpy as np

    full = analysis.full
    merged = merge_blocks(full.submodel.reduce(analysis.information), full.uncertainty.block)
    counts = draw_blocks(len(merged.counts), 1000, np.random.default_rng(0))
    part = merged.select(full.estimate.kept)
    with threadpool_limits(1):
        values = benchmark.pedantic(
            refit, args=(part, full.estimate.weights, counts), rounds=3, warmup_rounds=1
        )
    assert values.shape == (1000, len(full.estimate.kept))


def test_semidefinite_program_again(benchmark, analysis):
    from identifiability.physical.fitted_model import FittedModel, physical_set
    from identifiability.physical.project import Projection

    full, structure = analysis.full, analysis.structure
    data = FittedModel.of(
        structure, full.submodel, analysis.information, full.estimate.estimator
    ).data
    compiled = Projection(physical_set(structure), reference=structure.nominal)
    with threadpool_limits(1):
        found = benchmark.pedantic(compiled.solve, args=(data,), rounds=5, warmup_rounds=1)
    # What the data leave free lets some processors' solvers stop early; the certificate says so.
    assert found.gap < 1.0, "less than one squared standard deviation from the optimum"


def test_posterior_with_signs(benchmark, analysis):
    import numpy as np
    from posterior_speed import sign_target

    target, start = sign_target(analysis)
    with threadpool_limits(1):
        found = benchmark.pedantic(
            lambda: sample_posterior(
                target, start, np.random.default_rng(0), draws=20, walkers=32, warmup=5
            ),
            rounds=2,
        )
    assert found.acceptance > 0.9
