"""A file is written whole or not at all; whatever happens, the old one is intact."""

import os
import stat

import pytest

from identifiability.__main__ import main
from identifiability.foundation import output
from identifiability.foundation.output import check_apart, write_text


@pytest.fixture
def old(write):
    return write("out.csv", "old")


def alone(path):
    """Whether nothing else lies beside a file: no temporary one is left."""
    return list(path.parent.iterdir()) == [path]


def test_ctrl_c_ends_a_command_with_130_and_the_old_file(old, command, monkeypatch):
    def stop(*_args):
        raise KeyboardInterrupt

    monkeypatch.setattr(output.os, "fsync", stop)
    out = command("simulate", "two-link", "a", "--samples", 30, "--out", old)
    assert out.exit_code == 130
    assert out.stderr == "Stopped; no file was left half-written.\n"
    assert old.read_text() == "old"
    assert alone(old)


def test_paths_that_cannot_be_written_are_refused_before_the_work(refuses, refused, arm, tmp_path):
    missing = tmp_path / "no" / "out.html"
    folder = f"The folder '{tmp_path / 'no'}' does not exist; create it or choose another."
    assert refuses("two-link", arm, "--report", missing) == folder
    assert "is a folder; give a file name" in refuses("two-link", arm, "--report", tmp_path)
    words = ["simulate", "two-link", "a", "--out"]
    assert refused(*words, missing) == folder
    assert "is a folder; give a file name" in refused(*words, tmp_path)
    assert "cannot be written: File name too long." in refused(*words, tmp_path / ("a" * 300))


def test_pipes_and_devices_are_not_replaced_by_files(tmp_path, rejected):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with rejected("is no regular file"):
        write_text(pipe, "text")
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_link_stays_a_link_and_a_file_keeps_its_rights(old, tmp_path):
    old.chmod(0o600)
    link = tmp_path / "link.csv"
    link.symlink_to(old)
    write_text(link, "new")
    assert link.is_symlink()
    assert old.read_text() == "new"
    assert stat.S_IMODE(old.stat().st_mode) == 0o600


def test_a_new_file_gets_the_rights_that_the_user_gives_files(tmp_path):
    before = os.umask(0o027)
    try:
        path = write_text(tmp_path / "new.txt", "text")
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_results_of_other_verbs_are_not_written_over(refuses, command, write, arm, tmp_path):
    page = tmp_path / "out.html"
    data = tmp_path / "out.json"
    words = ["inspect", "two-link", "--report", page, "--json", data]
    assert [command(*words).exit_code for _ in range(2)] == [0, 0]
    for name, path in (("--report", page), ("--json", data)):
        said = refuses("two-link", arm, name, path)
        assert said.startswith(
            f"'{path}' is there and holds the result of another verb (inspection);"
        )
    other = write("mine.html", "<p>mine</p>")
    assert "holds no such result; give another name" in refuses("two-link", arm, "--report", other)


def test_inputs_are_not_written_over(refuses, refused, write, arm, rejected):
    log = write("log.csv", arm)
    sentence = f"'{log}' is an input or another output; give it its own name."
    assert refuses("two-link", log, "--report", log) == sentence
    assert refused("analyze", "two-link", "x.csv", "--validate", log, "--json", log) == sentence
    assert refused("simulate", "two-link", log, "--out", log) == sentence
    check_apart([log.with_name("a"), log.with_name("b")], [log])
    with rejected("another output"):
        check_apart(["a", "./a"], [])


@pytest.mark.parametrize(
    "reason, code", [(KeyboardInterrupt(), 130), (SystemExit(143), 143), (None, None)]
)
def test_what_interrupts_a_library_while_it_is_loaded_is_no_error_of_it(
    reason, code, monkeypatch, capsys
):
    def load():
        raise ImportError("initialization failed") from reason

    monkeypatch.setattr("identifiability.cli.main", load)
    with pytest.raises(ImportError if code is None else SystemExit) as told:
        main()
    assert code is None or told.value.code == code
    assert capsys.readouterr().err == ("Stopped.\n" if code == 130 else "")
