"""A ladder that does not fit its robot is refused with the model, the name and the near match."""

import pytest

FIRST = '[[models]]\nname = "a"\n'
SECOND = '[[models]]\nname = "b"\n'

BAD = {
    "empty": ("", "'models': field required"),
    "no TOML": ("models = [", "is not valid TOML"),
    "deep": ("models = " + "[" * 5000, "is not valid TOML: it is nested too deeply"),
    "no models": ("models = []", "'models': list should have at least 1 item"),
    "unknown key": (FIRST + "zerro = []", "'models.0.zerro' is not a key", "did you mean 'zero'?"),
    "unknown effect": (
        FIRST + 'effects = ["rigid_bdy"]',
        "There is no effect 'rigid_bdy', did you mean 'rigid_body'?",
    ),
    "no effect": (FIRST + "effects = []", "name at least one, such as rigid_body"),
    "effects in a later model": (
        FIRST + SECOND + 'effects = ["rigid_body"]',
        "The model 'b' names effects, but a ladder reduces one model",
    ),
    "unknown parameter": (
        FIRST + 'zero = ["elbw.Fv"]',
        "The model 'a' names the parameter 'elbw.Fv'",
        "did you mean 'elbow.Fv'?",
        "It has link1.Iyy",
    ),
    "unknown parameter kept": (FIRST + 'keep = ["elbow.Fw"]', "did you mean 'elbow.F"),
    "unknown model": (
        '[[models]]\nname = "Model 1"\n' + SECOND + 'from = "Modle 1"',
        "The model 'b' starts from 'Modle 1', which does not stand before it",
        "did you mean 'Model 1'?",
    ),
    "later model": (FIRST + 'from = "b"\n' + SECOND, "which does not stand before it"),
    "model twice": (FIRST + FIRST, "two models named 'a'; give each its own"),
    "no name": ('[[models]]\nname = ""', "'models.0.name': string should have at least 1"),
    "tie of one": (
        FIRST + 'tie = {"x.Fc" = ["elbow.Fc"]}',
        "The model 'a' ties 'x.Fc' = ['elbow.Fc']; give two or more different parameters",
    ),
    "tie of one twice": (FIRST + 'tie = {"x.F" = ["elbow.Fv", "elbow.Fv"]}', "give two or more"),
    "tie with a taken name": (
        FIRST + 'tie = {"elbow.Fv" = ["elbow.Fc", "shoulder.Fc"]}',
        "a name that no other parameter has",
    ),
    "tie across units": (
        FIRST + 'tie = {"x.F" = ["elbow.Fc", "elbow.Fv"]}',
        "of the units N·m, N·m·s/rad; only parameters of one unit can be equal",
    ),
    "hold in words": (
        FIRST + 'hold = {"elbow.Fv" = "nom"}',
        "'models.0.hold.elbow.Fv': give a finite number in SI units, or 'nominal'",
    ),
    "hold nan": (FIRST + 'hold = {"elbow.Fv" = nan}', "give a finite number in SI units"),
    "hold overflow": (FIRST + 'hold = {"elbow.Fv" = 1e300}', "give a finite number in SI units"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_ladder_is_refused(case, refuses, write, arm):
    content, *parts = BAD[case]
    sentence = refuses("two-link", arm, "--ladder", write("ladder.toml", content))
    assert all(part in sentence for part in parts), sentence


def test_a_missing_ladder_is_refused(refuses, arm):
    assert "There is no ladder file 'no.toml'" in refuses("two-link", arm, "--ladder", "no.toml")
