"""What a fit keeps in memory: its answer instead of its rows."""

from peers.running import STUDIES, make_samples, run_contender


def test_a_hundred_thousand_samples_of_the_arm_are_fitted_in_300_mb():
    with make_samples(100_000, 0) as folder:
        found = run_contender("ours", folder, 100_000, 1, 300.0)
    assert found.ran, found.why
    assert found.evidence["rank"] == 48
    assert found.peak <= 300.0, f"{found.peak:.0f} MB"


def test_what_does_not_fit_in_memory_is_not_run_and_said_so(monkeypatch):
    monkeypatch.setattr("peers.running.free_memory", lambda: 100.0)
    found = run_contender("cvxpy, all rows", STUDIES, 100_000, 1, 1.0)
    assert not found.ran
    assert "it would need about" in found.why
