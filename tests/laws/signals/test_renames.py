"""Names in logs become names of the robot by rules that are literal or regular."""

from identifiability.foundation.names import Renames


def test_a_rule_fits_a_whole_name_and_the_first_that_fits_decides():
    rules = Renames.of({r"fer_joint(\d)": r"panda_joint\1", "fer_joint1": "other", "a.b": "c"})
    assert [rules.apply(n) for n in ("fer_joint1", "fer_joint12", "xfer_joint1", "a.b", "axb")] == [
        "panda_joint1", "fer_joint12", "xfer_joint1", "c", "c",
    ]  # fmt: skip
    assert Renames.of({"q[0]": "x"}).apply("q[0]") == "x"
    assert Renames.of({"a": "b"}).before(rules).apply("fer_joint3") == "panda_joint3"
