"""The lists of mutants fit the package as it is; `make mutants` tries all of them."""

from pathlib import Path

import pytest

import identifiability

from . import mutants

SCRIPT = Path(__file__).with_name("mutants.py")


def test_every_mutant_can_be_applied_and_has_its_own_name():
    sources = mutants.read_sources(Path(identifiability.__file__).parents[1])
    assert mutants.find_mistakes(mutants.read_mutants(), sources) == []
    assert not mutants.is_there("test_mutants.py::test_gone")


def test_a_text_that_stands_twice_or_nowhere_is_a_mistake():
    sources = {Path("a.py"): "x = 1\ny = 1\n", Path("b.py"): "x = 2\n"}
    assert mutants.find_anchor("x = 2", sources) == Path("b.py")
    for text, said in (("x = ", "1 × in a.py, 1 × in b.py"), ("= 1", "2 × in a.py"),
                       ("z", "stands nowhere")):  # fmt: skip
        with pytest.raises(LookupError, match=said):
            mutants.find_anchor(text, sources)
