"""However a command ends: nothing half or lost, nothing that a terminal or sheet would run."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from time import time

import pandas as pd
import pytest

from identifiability.cli.common import harmless
from identifiability.cli.options import RESCUED, RESCUED_FOR, Outputs
from identifiability.foundation import output
from identifiability.foundation.errors import OutputError
from identifiability.foundation.output import csv_text, write_text


def test_control_characters_are_shown_and_not_obeyed():
    assert harmless("a\x1b[2Jb\nc\td\u202ee\x9b") == "a\\x1b[2Jb\nc\td\\u202ee\\x9b"
    assert harmless("Gelenk_ä 控制 é") == "Gelenk_ä 控制 é"


@pytest.mark.parametrize("name", ["=cmd|'/C calc'!A0.q", "+1.q", "-x.q", "@sum.q", "\tx.q"])
def test_a_name_that_a_sheet_would_run_is_no_header(name):
    with pytest.raises(OutputError, match="would be run as a formula"):
        csv_text(pd.DataFrame({"t": [0.0], name: [1.0]}))
    assert csv_text(pd.DataFrame({"t": [0.0], f"j{name[1:]}": [1.0]})).startswith("t,j")


class Found:
    """A result whose folder is gone when it is written."""

    def __init__(self, gone):
        self.gone = gone

    def to_json(self, path):
        if path.parent == self.gone:
            raise OutputError(f"'{path}' cannot be written: No space left on device.")
        return write_text(path, "{}")


def test_a_result_that_cannot_be_written_is_written_elsewhere(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    gone, old, new = (tmp_path / n for n in ("gone", f"{RESCUED}old", f"{RESCUED}new"))
    for folder, days in ((old, RESCUED_FOR + 1), (new, 1)):
        folder.mkdir()
        os.utime(folder, (time() - 86400 * days,) * 2)
    with pytest.raises(OutputError, match=r"No space left.*is not lost: it is in '") as said:
        Outputs(json=gone / "result.json").write(Found(gone), lambda *_: None)
    place = str(said.value).split("'")[-2]
    assert Path(place).read_text() == "{}"
    assert (old.exists(), new.exists()) == (False, True)


def hear():
    """Let the command hear Ctrl-C, to which programs in the background of a shell are deaf."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.everything) for n in ("SIGTERM", "SIGHUP")] + ["SIGINT"],
)
def test_a_command_that_is_ended_leaves_nothing_and_prints_no_traceback(name, tmp_path):
    out = tmp_path / "work"
    out.mkdir()
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    command = [sys.executable, "-m", "identifiability", "excite", "3-rps", "--out"]
    process = subprocess.Popen(
        [*command, str(out / "m.json")],
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        preexec_fn=hear,  # noqa: PLW1509 - it touches no lock
    )
    begun = process.stderr.readline()  # however long imports take beside other work
    process.send_signal(getattr(signal, name))
    said = begun + process.communicate(timeout=600)[1]
    number = getattr(signal, name)
    assert process.returncode in (130, 128 + number, -number)  # -2: Python heard it first
    assert "Traceback" not in said
    assert list(out.iterdir()) == []
    assert [p.name for p in tmp_path.iterdir()] == ["work"]


#: A program of another container that shares folder and host name: its number says nothing here.
BEGINS = """
import sys, time
from pathlib import Path
from time import time
from identifiability.foundation import output
folder = output.temporary_folder()
begun = output._beside(Path(sys.argv[1], "result.json"))
held = output._fill(begun, b"half", begun.with_name("result.json"))
for path in (Path(folder.name), begun):
    path.rename(path.with_name(path.name.replace(f"-{output.os.getpid()}-", "-999999999-")))
print("begun", flush=True)
sys.stdin.read()
output.os._exit(9)
"""


def test_what_killed_programs_left_is_swept_and_what_others_work_on_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    saved = tmp_path / f"identifiability-{output.host_mark()}"  # a result
    saved.mkdir()
    with subprocess.Popen(
        [sys.executable, "-c", BEGINS, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"TMPDIR": str(tmp_path)},
    ) as other:
        assert other.stdout.readline() == b"begun\n"
        theirs = set(tmp_path.iterdir())
        assert len(theirs) == 3
        with output.temporary_folder() as mine, output.temporary_folder() as more:
            output.write_text(tmp_path / "mine.txt", "whole")
            new = {tmp_path / "mine.txt", Path(mine), Path(more)}
            assert set(tmp_path.iterdir()) == theirs | new
        other.stdin.close()
    assert other.returncode == 9
    output.write_text(tmp_path / "mine.txt", "whole")
    output.temporary_folder().cleanup()
    assert set(tmp_path.iterdir()) == {saved, tmp_path / "mine.txt"}
