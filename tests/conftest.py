"""Shared by all tests: robots, simulated logs, and skips that cannot hide."""

import hashlib
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial, wraps
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import joblib
import mujoco
import numpy as np
import pytest
from markupsafe import Markup
from matplotlib.figure import Figure
from typer.main import get_command
from typer.testing import CliRunner

from identifiability import IdentifiabilityError, Log, Model, Noise, Robot, report, simulate
from identifiability.cli import app
from identifiability.logs import rows, tables
from identifiability.report import blocks, figures
from identifiability.simulation import (
    PAPER_NOISE,
    Campaign,
    MujocoRobot,
    PrescribedMotion,
    shipped_trajectory,
)
from identifiability.workflows.analyze.belief import EFFORT

from . import skips

#: Scripts beside the package, whose modules tests import.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "studies"))

ROBOTS = ("3-rps", "six-ups", "five-bar", "two-link", "six-dof-arm")
#: Further mechanisms, which `make check-all` puts to the same laws.
MECHANISMS = ("delta", "3-rrr", "palletizer", "six-actuators")
#: Files with tests of ten seconds.
LONGEST = {"test_readme.py", "test_commands.py", "test_plugin.py", "test_ur10.py", "test_kuka.py"}
#: The variable that says where runners leave simulated torque for each other.
SIMULATED = "IDENTIFIABILITY_TESTS_SIMULATED"
PAPER_EFFECTS = ("rigid_body", "viscous_friction", "coulomb_asymmetry", "actuator_inertia")


def pytest_addoption(parser):
    parser.addoption(
        "--everything", action="store_true", help="Also run what takes too long for make test."
    )


def pytest_configure(config):
    config.pluginmanager.register(skips, "skips")
    config.addinivalue_line("markers", "everything: takes too long for make test")
    config.addinivalue_line("markers", "pictures: looks at what is drawn on a page")
    # Else each runner rewrites every test, and each process that tests start compiles the package.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
    if not hasattr(config, "workerinput"):  # runners, which begin later, find it there
        os.environ[SIMULATED] = tempfile.mkdtemp(prefix="simulated-")
    # Tests that run at the same time share the cores: else each starts processes for all of them.
    runners = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if runners > 1:
        cores = max(1, joblib.cpu_count() // runners)
        os.environ.setdefault("LOKY_MAX_CPU_COUNT", str(cores))


def pytest_unconfigure(config):
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ.pop(SIMULATED, ""), ignore_errors=True)


def pytest_collection_modifyitems(config, items):
    """Leave out, and do not skip, what takes long: skips are failures in CI.

    Of what stays the files with the longest tests begin, lest one runner waits for another's.
    """
    items.sort(key=lambda item: item.path.name not in LONGEST)
    if config.getoption("--everything"):
        return
    slow = {item for item in items if item.get_closest_marker("everything")}
    left = {item for item in slow if item.nodeid not in config.args}  # whose name was given stays
    config.hook.pytest_deselected(items=[item for item in items if item in left])
    items[:] = [item for item in items if item not in left]


@cache
def load(name):
    return Robot.load(name)


_compute = MujocoRobot.inverse_dynamics
_torques = {}


def _remember(simulator, *motion):
    """Simulate the same motion of the same robot once: tests add other noise to the same few.

    What one runner of this run has simulated the others read.
    """
    robot = simulator.robot
    model = np.empty(mujoco.mj_sizeModel(simulator.model), np.uint8)
    mujoco.mj_saveModel(simulator.model, None, model)
    parts = (robot.joints, robot.loops, robot.couplings, robot.cables, robot.locked)
    known = hashlib.sha256(f"{robot.sha256} {parts} {[len(x) for x in motion]}".encode())
    for array in (model, robot.home, robot.dependent, *motion):
        known.update(np.ascontiguousarray(array).tobytes())
    key = known.hexdigest()
    if key not in _torques:
        path = Path(os.environ[SIMULATED], key)
        if path.exists():
            _torques[key] = pickle.loads(path.read_bytes())
        else:
            _torques[key] = _compute(simulator, *motion)
            half = path.with_suffix(f".{os.getpid()}")
            half.write_bytes(pickle.dumps(_torques[key]))
            half.rename(path)
    return _torques[key]


MujocoRobot.inverse_dynamics = _remember


#: Folders of tests that look at pages as they are; elsewhere their pictures are empty frames.
PICTURED = ("browser", "paper", "benchmarks")

_looks = {"now": True}


def pytest_runtest_setup(item):
    pictured = item.path.parent.name in PICTURED or item.get_closest_marker("pictures")
    _looks["now"] = bool(pictured)


def _leave_out(draw, nothing):
    """Draw only where a test looks at it: pictures take most of a page's time."""
    return wraps(draw)(lambda *args, **named: draw(*args, **named) if _looks["now"] else nothing)


_drawn = figures.drawn(Figure).__code__
for _found in iter_modules(report.__path__, "identifiability.report."):
    _module = import_module(_found.name)
    for _name, _draw in list(vars(_module).items()):
        if getattr(_draw, "__code__", None) is _drawn:
            setattr(_module, _name, _leave_out(_draw, Figure()))
blocks.svg = _leave_out(blocks.svg, Markup('<svg role="img"></svg>'))


@pytest.fixture(scope="session")
def at_once():
    """A context whose work must end before a loop of fifty million additions would (about 6 s).

    A ratio in one run, not seconds: other machines, and this one under load, are slower at both.
    The longest work takes an eighth of it.
    """

    def spend(turns):
        start = time.process_time()
        total = 0
        for turn in range(turns):
            total += turn
        return time.process_time() - start

    @contextmanager
    def measured():
        before = spend(250_000)
        start = time.process_time()
        yield
        spent = time.process_time() - start
        loops = spent / max(before, spend(250_000))
        assert loops < 200, f"took as long as {loops:.0f} loops of 250,000 additions"

    return measured


@pytest.fixture(
    params=[*ROBOTS, *(pytest.param(name, marks=pytest.mark.everything) for name in MECHANISMS)]
)
def robot(request):
    return load(request.param)


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def rps():
    return load("3-rps")


@pytest.fixture(scope="session")
def two_link():
    return load("two-link")


@pytest.fixture
def paper_model():
    return Model.of(*PAPER_EFFECTS)


def shipped_log(robot, trajectory, samples=None, *, like=None, **options):
    """Simulate a motion that is shipped with a robot, or with the one that it is like."""
    motion = PrescribedMotion.of(shipped_trajectory(like or robot, trajectory), samples)
    return simulate(robot, motion, **options)


@cache
def simulated_log(name, trajectory, seed=0, noise=PAPER_NOISE, samples=None):
    return shipped_log(load(name), trajectory, samples, noise=noise, seed=seed)


def write_robot(folder, text, suffix="xml", sidecar=None, lock=None):
    """Write a robot file, with a sidecar beside it if one is given, and read it."""
    path = folder / f"robot.{suffix}"
    path.write_text(text)
    if sidecar is not None:
        path.with_suffix(".toml").write_text(sidecar)
    return Robot.load(path, lock=lock)


@pytest.fixture
def load_text(tmp_path):
    """A function (text, suffix, sidecar, lock) -> the robot of a file of this test."""
    return partial(write_robot, tmp_path)


@cache
def both_motions(name, scale=1.0, *, samples):
    """Both shipped motions of a robot, so many times as wide."""
    robot = load(name)
    moves = [PrescribedMotion.of(shipped_trajectory(robot, m), samples) for m in ("a", "b")]
    wider = [replace(m, q=scale * m.q, dq=scale * m.dq, ddq=scale * m.ddq) for m in moves]
    return Campaign.of(robot, wider)


def cell(frame, row, column, value):
    """The table with one cell replaced, row counted from 1 as in the sentences."""
    frame = frame.astype(object)
    frame.loc[row - 1, column] = value
    return frame


@pytest.fixture(scope="session")
def process():
    """A function (words, options of `subprocess.run`) -> the ended process with what it printed."""
    return partial(subprocess.run, capture_output=True, text=True, check=False)


@pytest.fixture(scope="session")
def rejected():
    """A function (pattern) -> context that is refused with a sentence that matches."""
    return lambda pattern: pytest.raises(IdentifiabilityError, match=pattern)


@pytest.fixture(scope="session")
def noisy_log():
    return simulated_log("3-rps", "601")


@pytest.fixture(scope="session")
def arm_log():
    """A log of the two-link arm."""
    return simulated_log("two-link", "a")


@pytest.fixture
def exact_log():
    return simulated_log("3-rps", "601", noise=Noise())


@pytest.fixture(scope="session")
def few_draws():
    """A context in which `analyze` samples short posteriors, for what claims nothing of them."""

    @contextmanager
    def patched():
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(EFFORT, "draws", 16)
            patch.setitem(EFFORT, "warmup", 4)
            yield

    return patched


@pytest.fixture
def simulated():
    """A function (robot, trajectory, seed, noise, samples) -> Log that remembers what it made."""
    return simulated_log


@pytest.fixture(scope="session")
def simulated_session():
    """The same for fixtures that outlive a test."""
    return simulated_log


COMMANDS = vars(get_command(app))["commands"]


def invoke(*words):
    """Run a command line in this process; return its result."""
    return CliRunner().invoke(app, [str(word) for word in words])


def invoke_well(*words):
    """Run a command line that ends well; return its result."""
    done = invoke(*words)
    assert done.exit_code == 0, f"{words}\n{done.output}\n{done.exception}"
    return done


def quickly(name, *words):
    """Return the words of a command with those of its options that spare time."""
    command = COMMANDS[name]
    quick = {o for p in command.params for o in p.opts} & {"--quick"} - {*words}
    workers = ("--set", "workers=1") if "workers" in command.settings else ()
    return name, *words, *workers, *quick


@pytest.fixture(scope="session")
def command():
    """A function (words) -> result of the command line, run in this process."""
    return invoke


@pytest.fixture(scope="session")
def succeeds():
    """A function (words) -> result of a command that ends well."""
    return invoke_well


@pytest.fixture
def read_long(monkeypatch):
    """A function as `Log.read` that maps the rows of any log from a file, in many pieces."""

    def read(path, known=None):
        with monkeypatch.context() as small:
            small.setattr(rows, "LONG", 0)
            small.setattr(tables, "PIECE_LETTERS", 5000)
            small.setattr(tables, "PIECE_CELLS", 1000)
            return Log.read(path, known)

    return read
