"""The verbs: load, validate, call the function of the same name, print where results are.

A function here that `command` decorates is a verb. Its help text stands in ``help.toml``. Heavy
imports stand inside the functions, so that ``--help`` is quick.
"""

from __future__ import annotations

import runpy
import tomllib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Exit, Option, echo

from identifiability.foundation import options as kinds
from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.loading import loading
from identifiability.foundation.values import Fields

from .case import CASE
from .common import check_outputs, print_command, print_end, print_result, progress, write_all
from .options import (
    Derived,
    Effects,
    Fitted,
    Fixed,
    JsonResult,
    Judged,
    Ladder,
    Limits,
    Logs,
    Machine,
    Model,
    ModelOut,
    MoreLogs,
    OptionalLogs,
    Outputs,
    Place,
    Point,
    Prior,
    Reads,
    Recorded,
    Records,
    Report,
    Table,
    Verb,
    Work,
    Writes,
    alone,
)

if TYPE_CHECKING:
    from identifiability.foundation.runs import Progress
    from identifiability.logs import Log
    from identifiability.workflows.analyze import Analysis


def run(said: Fields, verb: str, write: str = "", **options: Any) -> tuple[Any, list[Path]]:
    """Call the function of a verb with the typed options, and write its result.

    Parameters
    ----------
    said : mapping
        Arguments of the verb, including groups.
    verb : str
    write : str, optional
        Method of the result that writes ``out``. It runs first, because the page names that file.
    options
        Options of this method.
    """
    machine = said.pop("machine")
    outputs = said.pop("outputs")
    work = said.pop("work", None)
    out = said.pop("out", None)
    # Functions take these by place, whatever they call them.
    given = [said.pop(name) for name in GIVEN if name in said]
    for group in ("fitted", "searched"):
        if group in said:
            said |= vars(said.pop(group))
    with work.running() if work else alone() as (say, how, _):
        import identifiability as library  # noqa: PLC0415

        with loading():
            function = getattr(library, verb)
        if verb in ("analyze", "diagnose") and outputs.report is not None:
            how["first"] = outputs.write_first
        result = function(machine.load(), *given, **said, **how)
        files = [(partial(getattr(result, write), **options), out)] if write else []
        return result, outputs.write(result, say, *files)


#: Arguments that the functions of verbs take after the robot, in their order.
GIVEN = ("result", "before", "after", "logs")


# To begin with.


@Verb
def new(
    folder: Annotated[Path, Writes()],
    recorded: Recorded,
    logs: OptionalLogs = (),
    robot: str = "six-dof-arm",
) -> None:
    """Make a folder to begin a study in: robot, sidecar, logs, case.toml and a script."""
    from identifiability.workflows.study import new_study  # noqa: PLC0415

    settings: Any = {key: x for key, x in asdict(recorded).items() if x is not None}
    made = new_study(folder, robot, logs, settings)
    print_end([*made.notes, made.statement])
    print_command("Begin with:", made.next_line)
    print_end([], made.written)


@Verb
def demo(
    quick: bool = False,
    folder: Annotated[Path, Writes()] = Path("reports"),
    seed: kinds.Seed = 0,
) -> None:
    """Run the main job on shipped logs of a six-axis arm, which has an effect its file lacks."""
    with progress() as say:
        folder.mkdir(parents=True, exist_ok=True)
        outputs = Outputs(folder / "demo.html", folder / "demo.json")
        check_outputs(outputs.report, outputs.json)
        print_end([phrase("demo", "says")])
        result, logs = run_demo(quick, seed, say, folder)
        read = [log.write(log.path) for log in logs]  # the next line names them
        written = [*read, *outputs.write(result, say)]
    print_result(result, written)
    page = (folder / "demo.html").resolve().as_uri()
    print_command("Open the page:", f"python -m webbrowser {page}")


#: Robot of the demo and its shipped logs; the last one is held out.
SHOWN = "six-dof-arm", ("run1.csv", "run2.csv", "run3.csv")


def run_demo(
    quick: bool,
    seed: int = 0,
    say: Progress = lambda _text, _share: None,
    folder: Path = Path("reports"),
) -> tuple[Analysis, list[Log]]:
    """Analyze two shipped logs of the six-axis arm, validated on a third.

    Returns the logs, too, which have the paths of files in a folder that they may be written to.
    """
    from identifiability.logs import Log  # noqa: PLC0415
    from identifiability.logs.conventions import Conventions  # noqa: PLC0415
    from identifiability.robot import Robot  # noqa: PLC0415
    from identifiability.workflows.analyze import analyze  # noqa: PLC0415

    name, files = SHOWN
    say("reading logs", 0.0)
    robot = Robot.load(name)
    logs = list[Log]()
    for file in files:
        shipped = robot.path.with_name("logs") / file
        log = Log.read(shipped, Conventions.of(robot))
        path = folder / f"demo-{file}"
        logs.append(replace(log, path=str(path)))
    found = analyze(robot, logs[:-1], logs[-1:], seed=seed, quick=quick, progress=say)
    return found, logs


@Verb
def inspect(
    machine: Machine,
    outputs: Outputs,
    work: Work,
    logs: OptionalLogs = (),
    validate: MoreLogs = (),
    model: Model = None,
) -> None:
    """List the content of a robot file, the columns that logs need, and the quality of logs."""
    result, written = run(locals(), "inspect")
    needs = [] if result.records else [f"{n.text} {n.line}".rstrip() for n in result.needs]
    case = CASE.get()
    if case is not None:
        case.read_truth(result.robot)
    holds = [] if case is None else [case.statement]
    print_result(result, written, [*holds, *(text.replace("\n", " ") for text in needs)])


# Fits.


@dataclass(frozen=True)
class OneMachine(Machine):
    """The robot; of many robots a folder each."""

    robot: Annotated[str, Argument()] = ""


@Verb
def analyze(
    machine: OneMachine,
    outputs: Outputs,
    work: Work,
    fitted: Judged,
    logs: OptionalLogs = (),
    validate: MoreLogs = (),
    ladder: Ladder = None,
    posterior: bool = False,
    profile: Annotated[Sequence[str], Option(metavar="NAME")] = (),
    prior: Prior = None,
    seed: kinds.Seed = 0,
    quick: bool = False,
    each: Annotated[Sequence[str], Option(metavar="FOLDER")] = (),
    out: Annotated[Path | None, Writes()] = None,
) -> None:
    """Find the parameters that the logs determine, and select a model of a ladder."""
    said = locals()
    if bool(each) == bool(logs) or (out is None) == bool(each):
        raise kinds.OptionError(Finding("each.none"))
    if not each:
        del said["each"], said["out"]
        print_result(*run(said, "analyze"))
        return
    without = {"machine": OneMachine(), "outputs": Outputs(), "logs": (), "validate": ()}
    if any(said.pop(name) != usual for name, usual in without.items()):
        raise kinds.OptionError(Finding("each.alone"))
    with work.running() as (say, how, _):
        from identifiability.workflows.many import analyze_many  # noqa: PLC0415

        del said["work"], said["each"], said["out"]
        fleet = analyze_many(
            each,
            str(out),
            **how,
            **vars(said.pop("fitted")),
            **said,
        )
    print_result(fleet, fleet.files)
    if fleet.failed:
        raise Exit(1)


@Verb
def prune(
    machine: Machine,
    logs: Logs,
    outputs: Outputs,
    work: Work,
    fitted: Fitted,
    validate: MoreLogs = (),
    ladder: Ladder = None,
    forbid: Sequence[str] = (),
    force: Sequence[str] = (),
    replicates: kinds.Replicates | None = None,
    prior: Prior = None,
    seed: kinds.Seed = 0,
    quick: bool = False,
    out: ModelOut = None,
) -> None:
    """Reduce the full model of a robot to the one worth using, from logs alone."""
    print_result(*run(locals(), "prune", "write_model"))


@Verb
def diagnose(
    machine: Machine,
    logs: Logs,
    outputs: Outputs,
    work: Work,
    validate: MoreLogs = (),
    effects: Effects = None,
    model: Model = None,
    fixed: Fixed = False,
    seed: kinds.Seed = 0,
    quick: bool = False,
    bending: bool = False,
    out: ModelOut = None,
    motion: Annotated[Path | None, Option("--next"), Writes(".json")] = None,
    limits: Limits = None,
) -> None:
    """Find where model and logs disagree, add the missing effect, and show that the gap shrinks."""
    said = locals()
    del said["motion"], said["limits"]
    result, written = run(said, "diagnose", "write_model")
    told = []
    if motion is not None:
        from identifiability.workflows.excite import find_next  # noqa: PLC0415

        try:
            with progress() as say:
                found = find_next(result, limits=limits, seed=seed, progress=say)
        except IdentifiabilityError as error:
            if error.key != "excite.decided":
                print_result(result, written)
                raise
            told.append(f"{motion} was not written: {error}")
        else:
            told.append(found.statement)
            if not found.same:
                written += write_all((found.to_json, result.note_written("next", motion)))
    print_result(result, written, told)


@Verb
def calibrate(
    machine: Machine,
    logs: Logs,
    outputs: Outputs,
    work: Work,
    fitted: Fitted,
    model: str | None = None,
    replicates: kinds.Repeated | None = None,
    ladder: Ladder = None,
    prior: Prior = None,
    seed: kinds.Seed = 0,
    quick: bool = False,
) -> None:
    """Check whether the intervals and verdicts of the selected model can be trusted here."""
    with work.running() as (say, how, engine):
        import identifiability as library  # noqa: PLC0415

        robot = machine.load()
        robot.check_stands("calibration")  # before the logs are fitted for it
        how["progress"] = lambda text, share: say(text, 0.2 * share)
        found = {"ladder": ladder, "prior": prior, "seed": seed, **vars(fitted), **how}
        analysis = library.analyze(robot, logs, **found)
        result = library.calibrate(
            analysis,
            model=model,
            replicates=replicates,
            seed=seed,
            quick=quick,
            progress=lambda text, share: say(text, 0.2 + 0.8 * share),
            engine=engine,
        )
        written = outputs.write(result, say)
    print_result(result, written)


# Verbs that use a fit.


@Verb
def predict(
    machine: Machine,
    result: Annotated[str, Records(results=True)],
    logs: Annotated[list[str], Argument(), Records()],
    outputs: Outputs,
    forward: bool = False,
    out: Annotated[Path | None, Table] = None,
) -> None:
    """Predict the torque of logs with a fitted model, or the motion of its robot."""
    print_result(*run(locals(), "predict", "write"))


#: Endings of exported files.
EXPORTED = (".xml", ".urdf", ".json", ".py", ".patch", ".csv", ".parquet", ".pq")


@Verb
def export(
    machine: Machine,
    result: JsonResult,
    out: Annotated[Path, Option(), Writes(*EXPORTED)],
    draws: kinds.Count | None = None,
    form: Annotated[kinds.ExportFormat | None, Option("--format")] = None,
    patch: bool = False,
    validate: MoreLogs = (),
    force: bool = False,
    prior: kinds.Positive | None = None,
    seed: kinds.Seed = 0,
) -> None:
    """Write the physically feasible parameters of a result back into the robot file."""
    from identifiability.workflows.export import draw_robots  # noqa: PLC0415
    from identifiability.workflows.export import export as run  # noqa: PLC0415

    robot = machine.load()
    if draws is not None:
        found = draw_robots(
            robot,
            result,
            draws,
            prior=prior,
            seed=seed,
        )
        written = found.write(out)
        for text in filter(None, (found.statement, found.lacking(out))):
            echo(text)
        last = f" … {written[-1].name}" if len(written) > 1 else ""
        echo(f"{written[0]}{last}")
        return
    if prior is not None:
        raise kinds.OptionError(Finding("prior.draws"))
    exported = run(
        robot,
        result,
        out,
        "patch" if patch else form,
        validate=validate,
        force=force,
    )
    for text in filter(None, (exported.mass, exported.statement, *exported.joints)):
        echo(text)
    for path in filter(None, (exported.robot, exported.sidecar, exported.snippet)):
        echo(f"{path}")


@Verb
def payload(
    machine: Machine,
    result: JsonResult,
    logs: Logs,
    outputs: Outputs,
    without: MoreLogs = (),
    body: str | None = None,
    mass: kinds.Positive | None = None,
    centre: Point | None = None,
    inertia: Point | None = None,
) -> None:
    """Estimate a payload on a body: its mass, centre and inertia, with intervals."""
    found, written = run(locals(), "payload")
    print_result(found, written, filter(None, [found.sidecar]))


@Verb
def compare(
    machine: Machine,
    before: Annotated[str, Records()],
    after: Annotated[str, Records()],
    derived: Derived,
    outputs: Outputs,
    ladder: Ladder = None,
    more_before: Annotated[Sequence[str], Option("--before", metavar="LOG"), Records()] = (),
    more_after: Annotated[Sequence[str], Option("--after", metavar="LOG"), Records()] = (),
) -> None:
    """Find the changes between two logs of one robot."""
    said = locals()
    said["before"] = [before, *said.pop("more_before")]
    said["after"] = [after, *said.pop("more_after")]
    said["preparation"] = said.pop("derived").preparation()
    print_result(*run(said, "compare"))


# Motions, and logs of robots that are known.


@Verb
def simulate(
    machine: Machine,
    motion: Annotated[str, Reads("motion", "CSV", always=False)],
    out: Annotated[Path, Option(), Table],
    noise: Annotated[str | None, Option(metavar="LEVELS")] = None,
    hide: Sequence[str] = (),
    derivatives: bool = True,
    seed: kinds.Seed = 0,
    samples: kinds.Period | None = None,
) -> None:
    """Make the log of a simulated robot along a prescribed motion."""
    import numpy as np  # noqa: PLC0415

    from identifiability.effects import effect_laws  # noqa: PLC0415
    from identifiability.simulation import simulate as run  # noqa: PLC0415
    from identifiability.simulation.forces import left_out  # noqa: PLC0415
    from identifiability.simulation.motion import find_motion  # noqa: PLC0415

    robot = machine.load()
    rng = np.random.default_rng(seed)
    move = find_motion(robot, motion, samples, rng)
    log = run(
        robot,
        move,
        noise=noise,
        hide=hide,
        derivatives=derivatives,
        laws=effect_laws(),
        rng=rng,
    )
    log.write(out)
    missing = left_out(robot)
    if missing:
        echo(
            f"The log lacks the torque of {listing(missing, 6, things='parameters')}, which the "
            "sidecar states: `simulate` leaves such effects out. `predict` has them, with the "
            "result that fitted them."
        )
    if robot.springs:
        echo(
            f"{listing(robot.springs)}: the log has positions of the motors, and torque with bent "
            "links. A log has no place for the links; Campaign.deflection has them in Python."
        )
    echo(f"{len(log)} samples of {robot.name} along {log.name}: {out}")


@dataclass(frozen=True)
class Searched:
    """The set of motions for the search."""

    table = ""

    harmonics: kinds.Harmonics = DEFAULTS.harmonics
    samples: int = DEFAULTS.samples
    evaluations: kinds.Count = DEFAULTS.evaluations


@dataclass(frozen=True)
class Played:
    """How a motion is written for a controller."""

    table = ""

    periods: Annotated[int, kinds.counted(1, 10_000)] = 1


@Verb
def excite(
    machine: Machine,
    work: Work,
    out: Annotated[Path, Option(), Writes(".json", ".csv", ".mcap", ".npz")],
    searched: Searched,
    played: Played,
    duration: kinds.Duration | None = None,
    limits: Limits = None,
    parameters: Annotated[Sequence[str] | None, Option("--parameter")] = None,
    model: Model = None,
    start_from: Annotated[Sequence[str] | None, Records()] = None,
    separate: Sequence[str] | None = None,
    seed: kinds.Seed = 0,
    rate: Annotated[float, kinds.within(1, 100_000)] = DEFAULTS.rate,
    report: Report = None,
) -> None:
    """Find a motion that is worth measuring, within the limits of the robot."""
    said = locals()
    del said["played"], said["rate"]
    said["outputs"] = Outputs(said.pop("report"))
    if out.suffix.lower() == ".json":
        print_result(*run(said, "excite", "to_json"))
        return
    result, written = run(said, "excite", "write_motion", rate=rate, periods=played.periods)
    rest = zip(result.limits.joints, result.play(rate).q[0], strict=True)
    pose = ", ".join(f"{joint} = {x:.4g}" for joint, x in rest)
    print_result(result, written, [f"{out.name} begins and ends at rest: {pose}."])


# The paper.

#: Where to get the studies, and the name of the project that they belong to.
SOURCE = "https://github.com/robot-identifiability/identifiability"
PROJECT = "robot-identifiability"


def find_studies() -> Path:
    """Return the studies of the checkout that holds the working folder, or else the package.

    Raises
    ------
    IdentifiabilityError
        If neither is in a checkout.
    """
    package = Path(__file__).resolve().parents[2]
    for folder in (Path.cwd(), *Path.cwd().parents, package):
        studies = folder / "studies"
        if (studies / "registry.py").is_file() and _is_checkout(folder):
            return studies
    raise IdentifiabilityError(Finding("studies.none", SOURCE))


def _is_checkout(folder: Path) -> bool:
    """Return whether a folder is this project: nobody else's file called 'registry.py' may run."""
    try:
        text = (folder / "pyproject.toml").read_text(encoding="utf-8")
        return bool(tomllib.loads(text)["project"]["name"] == PROJECT)
    except (OSError, ValueError, KeyError, TypeError):
        return False


@Verb
def paper(
    place: Place,
    tables: Annotated[Sequence[str], Argument()] = (),
    quick: bool = False,
    seeds: kinds.Count | None = None,
    out: Annotated[Path, Writes()] = Path("reports"),
) -> None:
    """Compute every table and figure of the paper, and compare it with the printed numbers."""
    studies = find_studies()
    words = [*tables, "--out", str(out), *(["--quick"] if quick else [])]
    words += [] if seeds is None else ["--seeds", str(seeds)]
    runpy.run_path(str(studies), {"words": words, "place": place}, "__main__")
