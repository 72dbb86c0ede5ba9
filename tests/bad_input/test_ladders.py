"""A ladder that does not fit its robot is refused with the model, the name and the near match."""

import pytest

FIRST = '[[models]]\nname = "a"\n'
SECOND = '[[models]]\nname = "b"\n'

BAD = {
    "no TOML": ("models = [", "is not valid TOML"),
    "unknown effect": (
        FIRST + 'effects = ["rigid_bdy"]',
        "There is no effect 'rigid_bdy', did you mean 'rigid_body'?",
    ),
    "unknown parameter": (
        FIRST + 'zero = ["elbw.Fv"]',
        "The model 'a' names the parameter 'elbw.Fv'",
        "did you mean 'elbow.Fv'?",
        "It has link1.Iyy",
    ),
    "part of another": (FIRST + 'hold = {"link2.m" = 1}', "in combination, as part of link1.Iyy"),
    "unknown model": (
        '[[models]]\nname = "Model 1"\n' + SECOND + 'from = "Modle 1"',
        "The model 'b' starts from 'Modle 1', which does not stand before it",
        "did you mean 'Model 1'?",
    ),
    "tie across units": (
        FIRST + 'tie = {"x.F" = ["elbow.Fc", "elbow.Fv"]}',
        "of the units N·m, N·m·s/rad; only parameters of one unit can be equal",
    ),
    "hold nan": (FIRST + 'hold = {"elbow.Fv" = nan}', "give a finite number in SI units"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_ladder_is_refused(case, refuses, write, arm):
    content, *parts = BAD[case]
    sentence = refuses("two-link", arm, "--ladder", write("ladder.toml", content))
    assert all(part in sentence for part in parts)


def test_a_missing_ladder_is_refused(refuses, arm):
    assert "There is no ladder file 'no.toml'" in refuses("two-link", arm, "--ladder", "no.toml")
