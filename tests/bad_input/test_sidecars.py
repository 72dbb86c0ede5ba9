"""A sidecar that does not fit its robot is refused with the file, the key and the near match."""

import pytest

from identifiability.foundation.errors import RobotError
from identifiability.robot import Robot

LOOP = 'actuated = ["shoulder"]\n[[loops]]\nbody1 = "link2"\nbody2 = '
COUPLING = 'actuated = ["shoulder"]\n[[couplings]]\njoint = "elbow"\n'
GEAR = '[transmission]\nmotors = ["m1", "m2"]\ncoupling = '

SQUARE = "needs at least 2 motors that move all .* together of rank 2"
AXIS = '[[axes]]\nname = "both"\njoints = '
BAD = {
    "no TOML": ("actuated = ", "is not valid TOML: Invalid value"),
    "binary": (bytes(range(256)), r"is not a sidecar file \(TOML\): 'utf-8' codec"),
    "deep": ("name = " + "[" * 100_000, "is not valid TOML: it is nested too deeply"),
    "long number": ("name = " + "9" * 5000, "is not valid TOML: Exceeds the limit"),
    "unknown key": ("actuatd = []", "'actuatd' is not a key .* did you mean 'actuated'"),
    "unknown inner key": (
        "[limits]\nelbow = {q = [0, 1], vel = 2}",
        r"'limits\.elbow\.vel' .* known here\. The keys are q, v, a, tau, power\.",
    ),
    "unknown actuated joint": (
        'actuated = ["shoulde"]',
        "'shoulde' cannot be actuated, .* did you mean 'shoulder'",
    ),
    "no actuated joint": (
        "actuated = []",
        r"actuated joints that are not locked are \[\]; name each",
    ),
    "actuated twice": ('actuated = ["elbow", "elbow"]', "name each one once"),
    "unknown home joint": ("[home]\nelbw = 1", "names 'elbw', .* did you mean 'elbow'"),
    "home in words": ('[home]\nelbow = "up"', r"'home\.elbow': input should be a valid number"),
    "home nan": ("[home]\nelbow = nan", r"'home\.elbow': input should be a finite number"),
    "unknown symbol": ('[symbols]\nlink9 = "1"', "names 'link9', .* did you mean 'link"),
    "unknown body": ('[base_parameters]\nbodies = ["linc1"]', "did you mean 'link1'"),
    "body twice": ('[base_parameters]\nbodies = ["link1", "link1"]', "name each one once"),
    "unknown limit": ("[limits]\nelbo = {v = 1}", "names 'elbo', .* did you mean 'elbow'"),
    "limits upside down": ("[limits]\nelbow = {q = [2, 1]}", "lower limit must be below the upper"),
    "negative speed": ("[limits]\nelbow = {v = -1}", "input should be greater than 0"),
    "unknown nominal": ('[nominal]\n"elbo.Fv" = 1', r"\[nominal\] names 'elbo', .* mean 'elbow'"),
    "unknown tie": (
        '[[symmetry]]\ntie = {"l.m" = ["link1.m", "linkk2.m"]}',
        r"\[symmetry\] names 'linkk2', which .* did you mean 'link2'",
    ),
    "no inertia parts": ("inertia_parts = []", "'inertia_parts': list should have at least 1"),
    "inertia parts twice": ('inertia_parts = ["Ia", "Ia"]', "name each one once"),
    "unknown loop body": (LOOP + '"bas"', "names 'bas', .* did you mean 'base'"),
    "loop without equations": (
        LOOP + '"link2"',
        "only 0 independent equations; name the missing actuated",
    ),
    "unknown coupled joint": (COUPLING + 'of = "sholder"', "'sholder', did you mean 'shoulder'"),
    "coupled to itself": (COUPLING + 'of = "elbow"', "cannot be coupled to itself"),
    "no polynomial": (COUPLING + "polynomial = []", "list should have at least 1 item"),
    "overflowing polynomial": (
        COUPLING + 'of = "shoulder"\npolynomial = [1e308, 1e308]',
        r"the loops are open by 1e\+308 m at the home position",
    ),
    "ragged gear": (GEAR + "[[1, 0], [1]]", SQUARE),
    "singular gear": (GEAR + "[[1, 1], [1, 1]]", SQUARE),
    "gear without ratio": (
        GEAR + "[[1, 0], [0, 1]]\nratio = [0, 1]",
        "a ratio that is not zero for each motor",
    ),
    "axis of nothing": (AXIS + "{}", "should have at least 1 item"),
    "axis of an unknown joint": (AXIS + "{elbo = 1}", "names 'elbo', .* mean 'elbow'"),
    "axis without a part": (AXIS + "{elbow = 0, shoulder = 1}", "zero would leave nothing"),
    "axis called as a joint": (
        AXIS.replace("both", "elbow") + "{elbow = 1, shoulder = 1}",
        "has the name of a body",
    ),
    "axis twice": (2 * (AXIS + "{elbow = 1, shoulder = 1}\n"), "name each once"),
    "motor twice": ('[transmission]\nmotors = ["m", "m"]\ncoupling = []', "name each one once"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_sidecar_is_refused(case, write):
    content, sentence = BAD[case]
    with pytest.raises(RobotError, match=sentence):
        Robot.load("two-link", write("side.toml", content))


def test_a_missing_sidecar_is_refused(refuses, arm, write):
    folder = write("x", "").parent
    assert "There is no sidecar file 'no.toml'" in refuses("two-link", arm, "--sidecar", "no.toml")
    assert "cannot be read: Is a directory" in refuses("two-link", arm, "--sidecar", folder)


def test_windows_line_endings_and_marks_are_no_matter(write):
    side = write("side.toml", "\ufeffname = 'arm'\r\n[limits]\r\nelbow = {v = 1}\r\n")
    assert Robot.load("two-link", side).title == "arm"
