"""What is unpickled comes from folders that nobody else can write to."""

import os
import stat
import sys

import pytest
from typer.testing import CliRunner

from identifiability.cli import app
from identifiability.foundation.engines.local import Resumed, Serial
from identifiability.foundation.errors import OutputError

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="users cannot be told apart")


def work(item):
    return item + 1


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "work"
    made.mkdir(mode=0o700)
    return made


@pytest.fixture
def another(monkeypatch):
    """This process runs as a user who owns nothing here."""
    monkeypatch.setattr(os, "getuid", lambda: 54_321)


def test_a_folder_is_made_for_the_user_alone_whatever_the_mask(tmp_path):
    before = os.umask(0)
    try:
        list(Resumed(Serial(), tmp_path / "new" / "work").map(work, [1]))
    finally:
        os.umask(before)
    made = [tmp_path / "new", *(tmp_path / "new").rglob("*")]
    assert {mode(p) for p in made if p.is_dir()} == {0o700}
    assert [mode(p) for p in made if p.is_file()] == [0o600]
    again = Resumed(Serial(), tmp_path / "new" / "work")
    assert list(again.map(work, [1])) == [2]
    assert again.found == 1


def test_a_folder_that_others_can_write_to_is_refused_and_its_remedy_helps(folder):
    folder.chmod(0o777)
    with pytest.raises(OutputError, match=r"work' can be written to by others.*run 'chmod 700 "):
        Resumed(Serial(), folder)
    folder.chmod(0o700)
    assert list(Resumed(Serial(), folder).map(work, [1])) == [2]


def test_the_folder_of_a_group_of_several_is_refused(folder, monkeypatch):
    grp = pytest.importorskip("grp")
    folder.chmod(0o770)
    group = grp.getgrgid(folder.stat().st_gid)
    several = grp.struct_group((group.gr_name, "x", group.gr_gid, ["somebody"]))
    monkeypatch.setattr(grp, "getgrgid", lambda _: several)
    with pytest.raises(OutputError, match="can be written to by others"):
        Resumed(Serial(), folder)


@pytest.mark.usefixtures("another")
def test_the_folder_of_another_user_is_refused(folder):
    with pytest.raises(OutputError, match=r"belongs to another user.*give a folder of your own\."):
        Resumed(Serial(), folder)


def test_a_folder_that_others_can_replace_is_refused(tmp_path):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    with pytest.raises(OutputError, match=r"replaced by others, who can write to '.*shared'"):
        Resumed(Serial(), shared / "work")
    shared.chmod(0o1777)  # as /tmp: what is there can be removed by its owner alone
    assert list(Resumed(Serial(), shared / "work").map(work, [1])) == [2]


def test_a_link_is_followed_once_and_judged_by_where_it_leads(tmp_path, folder):
    link = tmp_path / "link"
    link.symlink_to(folder)
    assert Resumed(Serial(), link).folder == folder.resolve()
    folder.chmod(0o777)
    with pytest.raises(OutputError, match="can be written to by others"):
        Resumed(Serial(), link)


def test_what_others_left_there_is_done_again(folder):
    first = Resumed(Serial(), folder)
    list(first.map(work, range(3)))
    planted, linked, _ = sorted(folder.rglob("*.result"))
    planted.chmod(0o666)
    whole = linked.read_bytes()
    linked.rename(folder / "elsewhere")
    linked.symlink_to(folder / "elsewhere")
    (folder / "elsewhere").write_bytes(b"mine")
    again = Resumed(Serial(), folder)
    assert list(again.map(work, range(3))) == [1, 2, 3]
    assert (again.found, again.done) == (1, 2)
    assert (folder / "elsewhere").read_bytes() == b"mine"  # nothing is written through a link
    assert linked.read_bytes() == whole


def test_users_that_cannot_be_told_apart_are_no_error(folder, monkeypatch):
    folder.chmod(0o777)
    monkeypatch.delattr(os, "getuid")
    list(Resumed(Serial(), folder).map(work, [1]))
    again = Resumed(Serial(), folder)
    assert list(again.map(work, [1])) == [2]
    assert again.found == 1


def test_the_command_says_it_in_one_sentence(folder):
    folder.chmod(0o777)
    log = folder.parent / "run.csv"
    columns = [f"slider{k}.{what}" for k in (1, 2, 3) for what in ("q", "tau")]
    log.write_text(f"t,{','.join(columns)}\n{'0,' * 6}0\n")
    done = CliRunner().invoke(app, ["analyze", "3-rps", str(log), "--resume", str(folder)])
    assert done.exit_code == 2
    assert "chmod 700" in done.stderr
    assert "Traceback" not in done.output


def test_what_is_no_file_is_done_again_and_not_waited_for(folder):
    list(Resumed(Serial(), folder).map(work, [1]))
    (kept,) = folder.rglob("*.result")
    kept.unlink()
    os.mkfifo(kept, 0o600)
    again = Resumed(Serial(), folder)
    assert list(again.map(work, [1])) == [2]
    assert again.done == 1
