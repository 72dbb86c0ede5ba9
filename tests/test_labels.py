"""A label says what it stands for: on the shipped closed chain no number bears a wrong name."""

import pytest

from identifiability import Robot, analyze, new_study
from identifiability.workflows import case

#: Whose friction the file states as it was planted.
SLIDERS = [f"slider{k}.Fv" for k in (1, 2, 3)]


@pytest.fixture(scope="module", params=[case.COMPLETED, ()], ids=["named", "missing"])
def found(request, tmp_path_factory):
    """The shipped 3-RPS with friction in passive joints, which is named, or of no model."""
    made = new_study(tmp_path_factory.mktemp("3-rps") / "study", "3-rps")
    logs = [made.folder / f"run{k}.csv" for k in (1, 2)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(case, "COMPLETED", request.param)
        return analyze(made.folder / "robot.xml", logs, made.folder / "run3.csv", replicates=20)


def test_what_is_called_identifiable_holds_what_was_planted(found):
    planted = Robot.load("3-rps").nominal
    held = {}
    for v in found.chosen.verdicts:
        if v.name in SLIDERS and v.verdict.value == "identifiable":
            held[v.name] = v.interval95[0] <= planted[v.name] <= v.interval95[1]
    assert held
    assert all(held.values())


def test_a_value_that_is_no_parameters_own_is_told_with_what_it_stands_for(found):
    planted = Robot.load("3-rps").nominal
    rows = found.to_dict()["parameters"]
    (use, *_), tables = found.answers(), found.tables()
    (page,) = (t for t in tables if "used" in [c.title for c in t.columns])
    for v, row in zip(found.chosen.verdicts, rows, strict=True):
        if v.name not in SLIDERS:
            continue
        near = abs(row["used"] - planted[v.name]) < 2 * v.sigma_robust
        assert near or row["used_stands_for"].startswith(v.name)
        if not near:
            assert f"{v.name} (" in use.text
            assert row["used_stands_for"] in found.statement
    used = [c.title for c in page.columns].index("used")
    far = any(row["used_stands_for"] for row in rows)
    assert page.columns[used].detail is not far
    notes = {row[0].text: row[used].note for row in page.rows}
    assert notes == {row["name"]: row["used_stands_for"] for row in rows}
