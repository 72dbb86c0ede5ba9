"""An option that is none of the valid ones is named in one sentence, in every public function."""

import numpy as np
import pytest

import identifiability
from identifiability import (
    IdentifiabilityError,
    Log,
    Model,
    Noise,
    Preparation,
    Robot,
    analyze,
    diagnose,
    estimate,
    excite,
    export,
    find_base_parameters,
    prune,
    simulate,
)
from identifiability.foundation.options import checked
from identifiability.simulation import shipped_trajectory

LOGS = np.zeros((3, 3))
SHIPPED = {"robot": "two-link"}
MOTION = SHIPPED | {"motion": shipped_trajectory(Robot.load("two-link"), "a")}
#: Whatever a verb of logs is given beside them is checked before they are read.
READ = SHIPPED | {"logs": "no.csv"}

#: What is called, with which bad option beside which good ones.
BAD = [
    *((verb, READ, {"robot": 3}) for verb in (analyze, prune, diagnose)),
    *((verb, SHIPPED, {"logs": LOGS}) for verb in (analyze, prune, diagnose)),
    *((verb, READ, {"seed": -1}) for verb in (analyze, prune, diagnose)),
    *((verb, READ, {"preparation": {"cutoff": 3}}) for verb in (analyze, prune, diagnose)),
    (analyze, READ, {"method": "OLS"}),
    (analyze, READ, {"replicates": 1}),
    (analyze, READ, {"cad_prior": float("nan")}),
    (prune, READ, {"forbid": "link1.mx"}),
    (diagnose, READ, {"effects": "payload"}),
    (excite, SHIPPED, {"harmonics": 0}),
    (simulate, MOTION, {"hide": "payload"}),
    (export, SHIPPED | {"result": "result.json"}, {"out": None}),
    (Robot.load, {}, {"source": 3}),
    (Log.from_frame, {}, {"frame": 3}),
    (Preparation, {}, {"derivatives": "buterworth"}),
    (Noise, {}, {"correlation": 1}),
    (find_base_parameters, {"model": Model.of("rigid_body")}, {"robot": "two-link"}),
    (estimate, {}, {"information": LOGS}),
]


@pytest.mark.parametrize("function, good, bad", BAD)
def test_an_option_that_is_none_is_named_in_one_sentence(function, good, bad):
    ((name, _),) = bad.items()
    with pytest.raises(IdentifiabilityError) as caught:
        function(**good | bad)
    sentence = str(caught.value)
    assert name in sentence
    assert "\n" not in sentence
    assert sentence.count(". ") <= 1, "one sentence, perhaps one with a remedy"


def test_every_public_function_is_checked():
    functions = [
        value
        for value in (getattr(identifiability, name) for name in identifiability.__all__)
        if callable(value) and not isinstance(value, type)
    ]
    assert len(functions) > 8
    assert all(hasattr(f, "__wrapped__") for f in functions)


def test_numbers_of_numpy_and_generators_pass_as_they_are():
    @checked
    def echo(count: int, level: float, names: list[str]):
        return count, level, names

    given = np.int64(3), np.float32(0.5), (name for name in "ab")
    assert all(a is b for a, b in zip(echo(*given), given, strict=True))
    with pytest.raises(TypeError, match=r"echo\(\).*'levle'"):
        echo(1, levle=2)
