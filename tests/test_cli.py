"""The command line does what the README says."""

import json
import subprocess
import sys
from types import SimpleNamespace

import pandas as pd
import pytest
from typer.testing import CliRunner

import identifiability
from identifiability.cli import app
from identifiability.cli.common import print_result, print_table
from identifiability.foundation.answers import Column, Table


@pytest.fixture
def run():
    runner = CliRunner()
    return lambda *words: runner.invoke(app, list(map(str, words)))


def test_simulate_then_analyze_writes_report_and_json(run, few_draws, tmp_path):
    train, test = tmp_path / "train.csv", tmp_path / "test.parquet"
    for path, name, seed in ((train, "601", 1), (test, "595", 2)):
        out = run("simulate", "3-rps", name, "--noise", "paper", "--seed", seed, "--out", path)
        assert out.exit_code == 0, out.output
    assert len(pd.read_csv(train)) == 750
    report, result = tmp_path / "report.html", tmp_path / "result.json"
    words = ["--validate", test, "--report", report, "--json", result]
    with few_draws():
        out = run("analyze", "3-rps", train, *words)
    assert out.exit_code == 0, out.output
    assert "Model 4" in out.output
    assert str(report) in out.output
    assert json.loads(result.read_text())["selected"].startswith("Model")
    assert "<html" in report.read_text()


@pytest.mark.everything
def test_demo_writes_its_report_and_ends_with_the_path(run, tmp_path):
    out = run("demo", "--quick", "--folder", tmp_path / "reports")
    assert out.exit_code == 0, out.output
    opens = out.stdout.strip().splitlines()[-1].split("python -m webbrowser ")[1]
    assert opens == (tmp_path / "reports" / "demo.html").as_uri()
    assert (tmp_path / "reports" / "demo.html").stat().st_size > 10_000


def test_hidden_effects_are_in_the_data_and_not_in_the_robot(run, tmp_path):
    plain, hidden = tmp_path / "plain.csv", tmp_path / "hidden.csv"
    assert run("simulate", "3-rps", "601", "--out", plain).exit_code == 0
    out = run("simulate", "3-rps", "601", "--hide", "stribeck_friction=0.1", "--out", hidden)
    assert out.exit_code == 0, out.output
    a, b = pd.read_csv(plain), pd.read_csv(hidden)
    for joint in ("slider1", "slider2", "slider3"):
        difference = b[f"{joint}.tau"] - a[f"{joint}.tau"]
        share = (difference**2).mean() ** 0.5 / (a[f"{joint}.tau"] ** 2).mean() ** 0.5
        assert share == pytest.approx(0.1, rel=1e-6)
        pd.testing.assert_series_equal(a[f"{joint}.q"], b[f"{joint}.q"])


def test_a_random_trajectory_stays_within_the_limits(run, tmp_path):
    out = run(
        "simulate", "six-ups", "random", "--seed", 3, "--samples", 60, "--out", tmp_path / "r.csv"
    )
    assert out.exit_code == 0, out.output
    log = pd.read_csv(tmp_path / "r.csv")
    positions = log[[c for c in log if c.endswith(".q")]]
    assert positions.min().min() >= 0.71
    assert positions.max().max() <= 0.83


def test_help_is_quick_and_names_the_commands():
    code = (
        "import sys; import identifiability.cli; "
        "heavy = {'numpy', 'pandas', 'pinocchio', 'matplotlib', 'mujoco'} & set(sys.modules); "
        "sys.exit(f'heavy imports at start: {heavy}' if heavy else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_an_analysis_without_a_report_neither_draws_nor_simulates_and_none_loads_other_commands():
    code = (
        "import sys; import identifiability.workflows.analyze.result; "
        "heavy = {'matplotlib', 'mujoco', 'scipy.stats', 'scipy.signal'} & set(sys.modules); "
        "import identifiability.report.analysis; "
        "others = [f'identifiability.workflows.{name}' for name in ('prune', 'diagnose')]; "
        "heavy |= {'scipy.stats', 'scipy.signal', *others} & set(sys.modules); "
        "sys.exit(f'heavy imports of an analysis: {heavy}' if heavy else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_module_runs_as_a_command():
    out = subprocess.run(
        [sys.executable, "-m", "identifiability", "--help"],
        check=True,
        capture_output=True,
        text=True,
    )
    for command in ("demo", "analyze", "simulate"):
        assert command in out.stdout


def test_the_version_is_printed(run):
    said = run("--version")
    assert (said.exit_code, said.output) == (0, f"identifiability {identifiability.__version__}\n")


def test_names_are_whole_where_no_terminal_cuts_them(capsys):
    columns = (Column("joint"), Column("error", "number"))
    rows = [("a_joint_of_a_very_long_name" * 5, "1 %")]
    print_table("title", Table.of("", columns, rows))
    assert "a_joint_of_a_very_long_name" * 5 in capsys.readouterr().out


def test_a_table_that_is_cut_says_how_many_rows_are_left_out(capsys):
    table = Table.of("thirty", (Column("joint"),), [(f"joint_{k}",) for k in range(30)])
    print_result(SimpleNamespace(tables=lambda: (table,), next=lambda: ()))
    text = capsys.readouterr().out
    assert text.count("joint_") == 12
    assert "18 rows below them: --report shows them all." in text


@pytest.mark.parametrize(
    ("option", "name", "ending"),
    [
        (["analyze", "two-link", "log.csv", "--report"], "out.pdf", ".html or .htm"),
        (["analyze", "two-link", "log.csv", "--json"], "out.txt", ".json"),
        (["simulate", "two-link", "rest", "--out"], "out.xlsx", ".csv, .parquet or .pq"),
        (["excite", "two-link", "--out"], "out.xml", ".json, .csv, .mcap or .npz"),
        (["inspect", "two-link", "--template"], "out.xlsx", ".csv"),
    ],
)
def test_an_ending_of_another_format_is_refused_before_the_work(
    run, option, name, ending, tmp_path
):
    path = tmp_path / name
    said = run(*option, path)
    assert said.exit_code == 2
    assert f"'{path}' does not end in {ending}, as what is written there does." in said.output
    assert not path.exists()
