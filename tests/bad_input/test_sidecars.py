"""A sidecar that does not fit its robot is refused with the file, the key and the near match."""

import pytest

from identifiability import Robot

LOOP = 'actuated = ["shoulder"]\n[[loops]]\nbody1 = "link2"\nbody2 = '
COUPLING = 'actuated = ["shoulder"]\n[[couplings]]\njoint = "elbow"\n'
GEAR = '[transmission]\nmotors = ["m1", "m2"]\ncoupling = '

SQUARE = "needs at least 2 motors that move all .* together of rank 2"
AXIS = '[[axes]]\nname = "both"\njoints = '
BAD = {
    "no TOML": ("actuated = ", "is not valid TOML: Invalid value"),
    "unknown inner key": (
        "[limits]\nelbow = {q = [0, 1], vel = 2}",
        r"'limits\.elbow\.vel' .* known here\. The keys are q, v, a, tau, power\.",
    ),
    "unknown actuated joint": (
        'actuated = ["shoulde"]',
        "'shoulde' cannot be actuated, .* did you mean 'shoulder'",
    ),
    "limits upside down": ("[limits]\nelbow = {q = [2, 1]}", "lower limit must be below the upper"),
    "unknown tie": (
        '[[symmetry]]\ntie = {"l.m" = ["link1.m", "linkk2.m"]}',
        r"\[symmetry\] names 'linkk2', which .* did you mean 'link2'",
    ),
    "loop without equations": (
        LOOP + '"link2"',
        "only 0 independent equations; name the missing actuated",
    ),
    "overflowing polynomial": (
        COUPLING + 'of = "shoulder"\npolynomial = [1e308, 1e308]',
        r"the loops are open by 1e\+308 m at the home position",
    ),
    "singular gear": (GEAR + "[[1, 1], [1, 1]]", SQUARE),
    "gear that is stated twice": (
        GEAR + "[[1, 0], [1, 1]]\nratio = [2, 3]\n[torque]\nratio = {m2 = 3}",
        r"both \[torque\] ratio and \[transmission\] ratio are stated for m2",
    ),
    "gain of a joint beside motors": (
        GEAR + "[[1, 0], [1, 1]]\n[torque]\ngain = {m1 = 2, m2 = 2, elbow = 3}",
        r"names the joints elbow beside motors\. .* under the names of motors \(m1, m2\)",
    ),
    "axis called as a joint": (
        AXIS.replace("both", "elbow") + "{elbow = 1, shoulder = 1}",
        "has the name of a body",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_sidecar_is_refused(case, write, rejected):
    content, sentence = BAD[case]
    with rejected(sentence):
        Robot.load("two-link", write("side.toml", content))


def test_a_missing_sidecar_is_refused(refuses, arm, write):
    folder = write("x", "").parent
    assert "There is no sidecar file 'no.toml'" in refuses("two-link", arm, "--sidecar", "no.toml")
    assert "cannot be read: Is a directory" in refuses("two-link", arm, "--sidecar", folder)


def test_windows_line_endings_and_marks_are_no_matter(write):
    side = write("side.toml", "\ufeffname = 'arm'\r\n[limits]\r\nelbow = {v = 1}\r\n")
    assert Robot.load("two-link", side).title == "arm"
