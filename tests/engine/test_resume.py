"""What was finished is not done again; what is damaged or different is."""

from functools import partial

import numpy as np
import pytest

from identifiability import IdentifiabilityError
from identifiability.foundation import engines as prints
from identifiability.foundation.engines import Resumed, Serial

calls = []


def square(item):
    calls.append(item)
    return np.array([item, item**2])


def power(exponent, item):
    calls.append(item)
    return item**exponent


@pytest.fixture(autouse=True)
def forget():
    calls.clear()


@pytest.fixture
def run(tmp_path):
    """A function (function, items) -> results and the items that were really worked on."""

    def go(function, items):
        calls.clear()
        results = list(Resumed(Serial(), tmp_path / "work").map(function, items))
        return results, list(calls)

    return go


def files(tmp_path):
    return sorted((tmp_path / "work").rglob("*.result"))


def test_an_error_leaves_what_was_finished_before_it(run):
    def fail(item):
        if item == 3:
            raise KeyboardInterrupt
        return square(item)

    with pytest.raises(KeyboardInterrupt):
        run(fail, range(6))
    with pytest.raises(KeyboardInterrupt):
        run(fail, range(6))
    assert calls == []  # 0, 1 and 2 were there, 3 fails again


def test_a_damaged_file_is_done_again(run, tmp_path):
    run(square, range(4))
    victim = files(tmp_path)[2]
    whole = victim.read_bytes()
    victim.write_bytes(whole[:-1])
    results, worked = run(square, range(4))
    assert len(worked) == 1
    assert [int(x[1]) for x in results] == [0, 1, 4, 9]
    assert victim.read_bytes() == whole


def test_different_work_is_not_mixed_up(run):
    assert run(partial(power, 2), [3])[0] == [9]
    assert run(partial(power, 3), [3]) == ([27], [3])
    assert run(partial(power, 2), [4]) == ([16], [4])
    assert run(partial(power, 2), [3]) == ([9], [])
    found = [run(lambda item, k=k: power(k, item), [3])[0][0] for k in (1, 2, 3)]
    assert found == [3, 9, 27]
    offset = np.zeros(3)
    assert run(partial(np.add, offset), [1])[0][0].tolist() == [1, 1, 1]
    assert run(partial(np.add, offset + 1), [1])[0][0].tolist() == [2, 2, 2]


def test_another_program_is_new_work(run, monkeypatch):
    run(square, range(2))
    text = prints.source_digest
    monkeypatch.setattr(prints, "source_digest", lambda name: "changed" + text(name))
    assert run(square, range(2))[1] == [0, 1]
    monkeypatch.setattr(prints, "source_digest", text)
    monkeypatch.setattr(prints, "find_version", lambda name: "9")
    assert run(square, range(2))[1] == [0, 1]


def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(
        IdentifiabilityError, match=r"file' cannot keep finished work: .*; give a folder\."
    ):
        Resumed(Serial(), tmp_path / "file")


def test_a_folder_that_everybody_can_write_to_is_refused(tmp_path):
    folder = tmp_path / "work"
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.raises(IdentifiabilityError, match="everybody can write to it"):
        Resumed(Serial(), folder)
