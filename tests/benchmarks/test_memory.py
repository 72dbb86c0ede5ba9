"""What a fit keeps in memory: its answer instead of its rows."""

from peers.running import make_samples, run_contender


def test_a_hundred_thousand_samples_of_the_arm_are_fitted_in_300_mb():
    with make_samples(100_000, 0) as folder:
        found = run_contender("ours", folder, 100_000, 1, 300.0)
    assert found.ran, found.why
    assert found.evidence["rank"] == 48
    assert found.peak <= 300.0, f"{found.peak:.0f} MB"
