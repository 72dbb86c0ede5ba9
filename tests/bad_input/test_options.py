"""Every public function names the valid choices when an option is none of them."""

import numpy as np
import pytest

import identifiability
from identifiability import (
    IdentifiabilityError,
    Log,
    Model,
    Noise,
    Preparation,
    Regression,
    Robot,
    analyze,
    calibrate,
    diagnose,
    estimate,
    excite,
    export,
    find_base_parameters,
    gather_information,
    prepare_samples,
    prune,
    simulate,
)
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.engines.local import choose_engine
from identifiability.foundation.options import checked
from identifiability.simulation import shipped_trajectory

SEED = "seed must be a whole number of at least 0, not -1"
METHOD = "method must be 'ols' or 'wls', not 'OLS', did you mean 'ols'?"
LOGS = (
    "must be a log (the path of a file, a DataFrame, arrays by name or a Log) or a list of logs, "
    "not"
)
ROBOT = "robot must be a Robot, the path of a robot file or a shipped robot's name, not 3"
REPLICATES = "replicates must be 0 (none) or a whole number of at least 2 or None, not"

#: What is called, with which bad option, and a part of the sentence.
BAD_LOG_VERBS = {
    "method": ({"method": "OLS"}, METHOD),
    "another estimator": ({"method": "iv"}, "method must be 'ols' or 'wls', not 'iv'"),
    "robot": ({"robot": 3}, ROBOT),
    "logs": ({"logs": np.zeros((3, 3))}, f"logs {LOGS} a ndarray"),
    "list of logs": ({"logs": [3]}, f"logs {LOGS} [3]"),
    "validate": ({"validate": 3}, f"validate {LOGS} 3"),
    "replicates": ({"replicates": -5}, f"{REPLICATES} -5"),
    "one replicate": ({"replicates": 1}, f"{REPLICATES} 1"),
    "half a replicate": ({"replicates": 20.5}, f"{REPLICATES} 20.5"),
    "seed": ({"seed": -1}, SEED),
    "seed as a word": ({"seed": "1"}, "seed must be a whole number of at least 0, not '1'"),
    "preparation": ({"preparation": {"cutoff": 3}}, "a Preparation or None, not a dict"),
    "progress": ({"progress": True}, "a function that takes a text and the share done"),
    "engine": ({"engine": "dask"}, "engine must be an Engine or None, not 'dask'"),
    "ladder": ({"ladder": 3}, "ladder must be the path of a ladder file"),
}
ANALYZE = {
    "posterior": ({"posterior": "yes"}, "posterior must be True or False, not 'yes'"),
    "prior": ({"cad_prior": -1.0}, "cad_prior must be a number of at least 0 or None, not -1.0"),
    "nan": (
        {"cad_prior": float("nan")},
        "cad_prior must be a number of at least 0 or None, not nan",
    ),
}
PRUNE = {
    "forbid": ({"forbid": "link1.mx"}, "forbid must be a list of names, not 'link1.mx'"),
}
DIAGNOSE = {
    "model": (
        {"model": 3},
        "model must be a Model, a list of effects, the path of a model file or",
    ),
    "effects": ({"effects": "payload"}, "effects must be a list of names or None, not 'payload'"),
    "fixed": ({"fixed": 2}, "may be off by a share above 0 and up to 1, 2 was given"),
}
OF_LOGS = {
    name: case
    for name, case in BAD_LOG_VERBS.items()
    if name in ("robot", "logs", "validate", "seed", "preparation", "progress")
}
CALIBRATE = {
    "analysis": ({"analysis": 3}, "analysis must be an Analysis, not 3"),
    "model": ({"model": "fll model"}, "model must be 'full model' or 'no torque offset', not"),
    "replicates": ({"replicates": 1}, "a whole number of at least 2 or None, not 1"),
    "seed": ({"seed": -1}, SEED),
}
EXCITE = {
    "robot": ({"robot": 3}, ROBOT),
    "harmonics": ({"harmonics": 0}, "harmonics must be a whole number between 1 and 50, not 0"),
    "duration": (
        {"duration": -1},
        "duration must be a number between 0.001 and 1e+06 or None, not -1",
    ),
    "samples": ({"samples": "many"}, "samples must be a whole number"),
    "evaluations": ({"evaluations": 0}, "evaluations must be a whole number of at least 1, not 0"),
    "time limit": ({"time_limit": 9}, "'time_limit' of excite is called 'evaluations' now"),
    "seed": ({"seed": -1}, SEED),
    "parameters": ({"parameters": "link1.mx"}, "parameters must be a list of names or None"),
}
SIMULATE = {
    "robot": ({"robot": 3}, ROBOT),
    "motion": ({"motion": "a"}, "motion must be a PrescribedMotion or a Trajectory"),
    "noise": ({"noise": "papr"}, "'papr' is not understood, did you mean 'paper'?"),
    "noise as a number": ({"noise": 3}, "noise must be a Noise, 'paper', 'none' or levels such as"),
    "hide": ({"hide": "payload"}, "hide must be a list of names, not 'payload'"),
    "rng": ({"rng": 3}, "rng must be a random generator, such as numpy.random.default_rng(0)"),
    "derivatives": ({"derivatives": "no"}, "derivatives must be True or False, not 'no'"),
}
EXPORTED = {"robot": "two-link", "result": "result.json", "out": "fit.xml"}
EXPORT = {
    "robot": ({"robot": 3}, ROBOT),
    "result": ({"result": 3}, "result must be the path of a file, not 3"),
    "out": ({"out": None}, "out must be the path of a file, not None"),
}
OTHERS = {
    "robot file": (
        Robot.load,
        {"source": 3},
        "source must be the path of a robot file or a shipped",
    ),
    "log file": (Log.read, {"path": 3}, "path must be the path of a file, not 3"),
    "frame": (Log.from_frame, {"frame": 3}, "frame must be a DataFrame, not 3"),
    "derivatives": (
        Preparation,
        {"derivatives": "buterworth"},
        "'butterworth' or 'fourier', not 'buterworth', did you mean 'butterworth'?",
    ),
    "cut-off": (Preparation, {"cutoff": -1}, "cutoff must be a number above 0 or None, not -1"),
    "noise level": (
        Noise,
        {"correlation": 1},
        "correlation must be a number of at least 0 and below 1, not 1",
    ),
    "threshold": (
        Thresholds,
        {"contraction": 9},
        "contraction must be a number between 0 and 1, not",
    ),
    "engine": (
        choose_engine,
        {"engine": "procesess"},
        "engine must be 'serial', 'processes', 'dask' or None, not 'procesess', did you mean",
    ),
    "workers": (choose_engine, {"workers": 0}, "workers must be a whole number of at least 1"),
    "robot of a stage": (
        find_base_parameters,
        {"robot": "two-link", "model": Model.of("rigid_body")},
        "robot must be a Robot; Robot.load reads one, not 'two-link'",
    ),
}


@pytest.fixture(scope="module")
def log():
    return simulate("two-link", shipped_trajectory(Robot.load("two-link"), "a"), noise="paper")


@pytest.fixture(scope="module")
def analysis(log):
    return analyze("two-link", log, replicates=0)


def refuses(function, options, part):
    with pytest.raises(IdentifiabilityError) as caught:
        function(**options)
    sentence = str(caught.value)
    assert part in sentence
    assert "\n" not in sentence
    assert sentence.count(". ") <= 1, "one sentence, perhaps one with a remedy"


@pytest.mark.parametrize(("options", "part"), [*BAD_LOG_VERBS.values(), *ANALYZE.values()])
def test_analyze_names_what_is_valid(log, options, part):
    refuses(analyze, {"robot": "two-link", "logs": log, **options}, part)


@pytest.mark.parametrize(("options", "part"), [*BAD_LOG_VERBS.values(), *PRUNE.values()])
def test_prune_names_what_is_valid(log, options, part):
    refuses(prune, {"robot": "two-link", "logs": log, **options}, part)


@pytest.mark.parametrize(("options", "part"), [*OF_LOGS.values(), *DIAGNOSE.values()])
def test_diagnose_names_what_is_valid(log, options, part):
    refuses(diagnose, {"robot": "two-link", "logs": log, **options}, part)


@pytest.mark.parametrize(("options", "part"), CALIBRATE.values())
def test_calibrate_names_what_is_valid(analysis, options, part):
    refuses(calibrate, {"analysis": analysis, **options}, part)


@pytest.mark.parametrize(("options", "part"), EXCITE.values())
def test_excite_names_what_is_valid(options, part):
    refuses(excite, {"robot": "two-link", **options}, part)


@pytest.mark.parametrize(("options", "part"), SIMULATE.values())
def test_simulate_names_what_is_valid(options, part):
    motion = shipped_trajectory(Robot.load("two-link"), "a")
    refuses(simulate, {"robot": "two-link", "motion": motion, **options}, part)


@pytest.mark.parametrize(("options", "part"), EXPORT.values())
def test_export_names_what_is_valid(options, part):
    refuses(export, {**EXPORTED, **options}, part)


@pytest.mark.parametrize(("function", "options", "part"), OTHERS.values())
def test_other_public_functions_name_what_is_valid(function, options, part):
    refuses(function, options, part)


def test_stages_name_what_is_valid(analysis, log):
    robot, model = analysis.robot, Model.of("rigid_body")
    regression = Regression(robot, model, analysis.samples)
    refuses(estimate, {"information": analysis.information, "method": "OLS"}, METHOD)
    refuses(estimate, {"information": regression}, "information must be an Information, not a Re")
    refuses(gather_information, {"regression": regression, "blocks": 0}, "of at least 1, not 0")
    refuses(prepare_samples, {"robot": robot, "log": "run.csv"}, "log must be a Log, not 'run.csv'")
    refuses(find_base_parameters, {"robot": robot, "model": "rigid_body"}, "model must be a Model")
    refuses(lambda: Model.of(["rigid_body"]), {}, "the name of an effect, such as 'rigid_body'")
    refuses(lambda: Model.of(3), {}, "the name of an effect, such as 'rigid_body', not 3")


def test_results_name_what_is_valid(analysis):
    models = "model must be 'full model' or 'no torque offset', not 'x'"
    refuses(analysis.to_frame, {"model": "x"}, models)
    refuses(analysis.to_json, {"path": 3}, "path must be the path of a file, not 3")
    refuses(analysis.write_report, {"path": None}, "path must be the path of a file, not None")
    refuses(analysis.to_arviz, {"posterior": "real"}, "posterior must be 'physical' or 'signs'")


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
