"""Another distribution with the package `identifiability`: one sentence says what to uninstall."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import identifiability

PACKAGE = Path(identifiability.__file__).parent
COMMAND = (
    "import sys; from robot_identifiability import main; sys.argv = ['identifiability', {}]; main()"
)


@pytest.fixture
def site(tmp_path):
    """A site directory in which our distribution is installed, as a wheel does it."""
    shutil.copytree(PACKAGE, tmp_path / "identifiability", ignore=shutil.ignore_patterns("models"))
    shutil.copy(PACKAGE.parent / "robot_identifiability.py", tmp_path)
    record(tmp_path, "robot_identifiability-0.1.0", "identifiability/__init__.py")
    return tmp_path


def record(site, name, *files):
    folder = site / f"{name}.dist-info"
    folder.mkdir()
    (folder / "RECORD").write_text("".join(f"{file},sha256=x,1\n" for file in files))


def install_other(site, *, over):
    """Install the other distribution; over ours, or before it."""
    (site / "identifiability/profile.py").write_text("x = 1\n")
    if over:
        (site / "identifiability/__init__.py").write_text("raise ImportError('no pesto')\n")
    record(
        site, "identifiability-0.5.0", "identifiability/__init__.py", "identifiability/profile.py"
    )


def run(site, *, word="--version", module=False, alone=False):
    """Run the command in a site directory that goes before every other one, or is alone."""
    code = ["-m", "identifiability", word] if module else ["-c", COMMAND.format(repr(word))]
    return subprocess.run(
        [sys.executable, *(["-S"] if alone else []), *code],
        cwd=site, env={"PYTHONPATH": str(site)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_package_that_was_replaced_is_refused_with_what_to_uninstall(site):
    install_other(site, over=True)
    done = run(site)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("Error: The distribution 'identifiability' has replaced files")
    assert "'pip uninstall identifiability', then install robot-identifiability again." in line


@pytest.mark.parametrize("module", [False, True])
def test_another_owner_that_replaced_nothing_is_told_and_the_command_runs(site, module):
    install_other(site, over=False)
    done = run(site, module=module)
    assert done.returncode == 0
    assert done.stdout.startswith("identifiability ")
    (line,) = done.stderr.splitlines()
    assert line.startswith("Note: The distribution 'identifiability' also owns the package")
    assert "'pip uninstall identifiability'" in line


def test_an_owner_of_another_name_is_told_by_its_files(site):
    (site / "identifiability/profile.py").write_text("x = 1\n")
    record(site, "pesto_tools-1.0", "identifiability/__init__.py")
    assert "The distribution 'pesto_tools' also owns" in run(site).stderr


def test_what_an_uninstalled_other_leaves_behind_is_told(site):
    (site / "identifiability/__init__.py").unlink()
    done = run(site, alone=True)
    assert done.returncode == 2
    assert "lacks its __init__.py" in done.stderr
    assert "install robot-identifiability again." in done.stderr
    assert "Traceback" not in done.stderr


def test_a_distribution_that_stands_before_the_checkout_is_refused(tmp_path):
    """An editable install is found last; the other package hides all of ours."""
    (tmp_path / "identifiability").mkdir()
    (tmp_path / "identifiability/__init__.py").write_text("")
    record(tmp_path, "identifiability-0.5.0", "identifiability/__init__.py")
    shutil.copy(PACKAGE.parent / "robot_identifiability.py", tmp_path / "robot_identifiability.py")
    done = run(tmp_path)
    assert done.returncode == 2
    assert "The distribution 'identifiability' has replaced files" in done.stderr
