"""The exam scores the truth with full marks, and lists a refusal with its reason."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from exam import contract
from exam.score import Case, score

from identifiability.workflows.case_file import CaseFile

WRITE = "import sys, pathlib\npathlib.Path(sys.argv[2], 'result.json').write_text({!r})\n"


@pytest.fixture
def case(tmp_path):
    t = np.linspace(0.0, 4.0, 401)
    frame = pd.DataFrame({"t": t, "shoulder.q": np.sin(t), "shoulder.tau": np.cos(3 * t)})
    frame.to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "truth.toml").write_text(
        'effects = ["stribeck_friction shoulder"]\n[parameters]\n"shoulder.Fv" = 2.0\n'
    )
    (tmp_path / "case.toml").write_text(
        'robot = "two-link"\nlogs = ["log.csv"]\nvalidate = ["log.csv"]\n[exam]\ntitle = "law"\n'
        'source = "none"\nlicence = "none"\nkind = "torque"\ntruth = "truth.toml"\n'
    )
    return Case.read(tmp_path)


def run(case, **answer):
    adapter = case.folder / "adapter.py"
    adapter.write_text(WRITE.format(json.dumps({"tool": "law", **answer})))
    return score(case, contract.run_tool(adapter, case.folder, case.folder), case.folder)


def test_the_truth_has_no_error_and_full_marks(case):
    value = {"terms": {"shoulder.Fv": 1.0}, "value": 2.0, "low": 1.9, "high": 2.1, "called": True}
    beside = value | {"value": 3.0, "low": 2.5, "high": 3.5}
    names = ["stribeck_friction shoulder", "hysteresis shoulder"]
    row = run(case, predictions=["log.csv"], values=[value], effects=names[:1])
    assert row["status"] == "answered"
    assert (row["error [%]"], row["coverage"], row["called right"]) == (0, 1, 1)
    assert (row["named right"], row["named wrong"]) == (1, 0)
    wrong = run(case, values=[value, beside], effects=names)
    assert (wrong["error [%]"], wrong["coverage"], wrong["called right"]) == (np.inf, 0.5, 0.5)
    assert wrong["named wrong"] == 1


def test_a_refusal_is_listed_with_its_reason_and_a_broken_answer_fails(case):
    row = run(case, refused="no torque")
    assert (row["status"], row["why"]) == ("refused", "no torque")
    assert row["processor [s]"] > 0
    assert run(case, guess=1)["status"] == "failed"


def test_a_truth_of_a_joint_that_the_robot_lacks_is_refused(case, two_link, rejected):
    assert CaseFile.read(case.folder).read_truth(two_link).parameters == {"shoulder.Fv": 2.0}
    (case.folder / "truth.toml").write_text('[parameters]\n"joint_9.Fv" = 2.0\n')
    with rejected(r"joint_9\.Fv"):
        CaseFile.read(case.folder).read_truth(two_link)


def test_the_schema_is_that_of_the_contract():
    path = Path(contract.__file__).with_name("result.schema.json")
    assert path.read_text() == contract.schema_text()
