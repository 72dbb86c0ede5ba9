"""Every verb gives the same bits wherever it works."""

import joblib
import pytest

from identifiability import analyze, calibrate, diagnose, excite, prune
from identifiability.foundation.engines import Processes, choose_engine

distributed = pytest.importorskip("distributed")


VERBS = {
    "analyze": lambda log, engine: analyze("two-link", log, replicates=50, engine=engine),
    "prune": lambda log, engine: prune("two-link", log, replicates=10, seed=1, engine=engine),
    "diagnose": lambda log, engine: diagnose("two-link", log, quick=True, engine=engine),
    "calibrate": lambda log, engine: calibrate(
        analyze("two-link", log, replicates=0),
        replicates=16, refits=10, engine=engine,
    ),
    "excite": lambda _, engine: excite("two-link", samples=40, evaluations=60, engine=engine),
}  # fmt: skip


@pytest.mark.everything
@pytest.mark.parametrize("verb", VERBS)
def test_engines_and_workers_change_no_bit(verb, arm_log):
    def bits(engine):
        return joblib.hash(VERBS[verb](arm_log, engine).to_dict())

    expected = bits(None)
    for engine in (Processes(1), Processes(2)):
        with engine:
            assert bits(engine) == expected
    with (
        distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None) as workers,
        choose_engine(scheduler=workers.scheduler_address) as engine,
    ):
        assert bits(engine) == expected
