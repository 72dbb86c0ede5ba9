"""However a command ends: nothing half or lost, nothing that a terminal or sheet would run."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from identifiability.cli.options import Outputs
from identifiability.foundation import output
from identifiability.foundation.errors import OutputError
from identifiability.foundation.output import csv_text, write_text
from identifiability.foundation.quoting import for_terminal


def test_control_characters_are_shown_and_not_obeyed():
    shown = for_terminal("a\x1b[2Jb\nc\td\u202ee\x9b", keep="\n\t")
    assert shown == "a\\x1b[2Jb\nc\td\\u202ee\\x9b"
    assert for_terminal("Gelenk_ä 控制 é", keep="\n\t") == "Gelenk_ä 控制 é"


@pytest.mark.parametrize("name", ["=cmd|'/C calc'!A0.q", "+1.q", "-x.q", "@sum.q", "\tx.q"])
def test_a_name_that_a_sheet_would_run_is_no_header(name, rejected):
    with rejected("would be run as a formula"):
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


def test_a_result_that_cannot_be_written_is_written_elsewhere(tmp_path, monkeypatch, rejected):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    gone = tmp_path / "gone"
    with rejected(r"No space left.*is not lost: it is in '") as said:
        Outputs(json=gone / "result.json").write(Found(gone), lambda *_: None)
    assert Path(str(said.value).split("'")[-2]).read_text() == "{}"


def hear():
    """Let the command hear Ctrl-C, to which programs in the background of a shell are deaf."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
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
    time.sleep(3.0)  # while it imports, or works
    process.send_signal(getattr(signal, name))
    said = process.communicate(timeout=600)[1]
    number = getattr(signal, name)
    assert process.returncode in (130, 128 + number, -number)  # -2: Python heard it first
    assert "Traceback" not in said
    assert list(out.iterdir()) == []
    assert [p.name for p in tmp_path.iterdir()] == ["work"]


def test_half_files_that_nobody_has_touched_for_long_are_swept(tmp_path):
    long_ago = time.time() - 40 * 86400
    new = tmp_path / ".identifiability-1.tmp"
    old = tmp_path / ".identifiability-0.tmp"
    for path in (new, old):
        path.write_text("half")
    os.utime(old, (long_ago, long_ago))
    output.write_text(tmp_path / "result.txt", "whole")
    assert set(tmp_path.iterdir()) == {new, tmp_path / "result.txt"}
