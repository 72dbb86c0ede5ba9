"""The contract of an exam: what a tool writes for a case, and how its process is run.

A tool is called as ``python ADAPTER CASE OUT`` and writes ``result.json`` to OUT.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

#: A tool is ended after this processor time on one case [s].
MOST_SECONDS = 240.0


#: Runs a command under a limit of processor time; prints its exit code, processor time [s] and
#: memory [kB]. A process inherits the peak memory of its parent, so the parent has to be small.
LAUNCHER = """
import json, resource, subprocess, sys
most = int(float(sys.argv[1]))
limit = lambda: resource.setrlimit(resource.RLIMIT_CPU, (most, most))
code = subprocess.call(sys.argv[2:], stdout=sys.stderr, preexec_fn=limit)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([code, used.ru_utime + used.ru_stime, used.ru_maxrss]))
"""


class Value(BaseModel):
    """An estimate of one combination of standard parameters."""

    model_config = ConfigDict(extra="forbid")

    terms: dict[str, float] = Field(description="Standard parameter → coefficient.")
    value: float
    low: float = Field(description="Lower end of the 95 % interval.")
    high: float = Field(description="Upper end of the 95 % interval.")
    called: bool = Field(description="Whether the tool calls the value identifiable.")


class Answer(BaseModel):
    """The file `result.json` of a tool."""

    model_config = ConfigDict(extra="forbid")

    tool: str = Field(description="Name and version.")
    refused: str = Field(default="", description="Why the tool does not answer; empty if it does.")
    predictions: list[str] = Field(
        default=[], description="One CSV a held-out log: `t`, and `<joint>.tau` or `<joint>.q`."
    )
    robot: str = Field(
        default="", description="The written robot file; scored in cases of commands."
    )
    delay: float = Field(default=0.0, description="Time until a command acts [s].")
    values: list[Value] = []
    effects: list[str] = Field(default=[], description="Hidden effects: family, blank, joint.")
    columns: list[tuple[str, str]] = Field(default=[], description="Exchanged columns, in pairs.")


@dataclass(frozen=True)
class Run:
    """What a tool answered, and what it cost.

    Attributes
    ----------
    answer : Answer
    status : {"answered", "refused", "failed"}
    seconds : float [s]
        Processor time of the process and its children.
    memory : float [MB]
        Largest resident memory.
    """

    answer: Answer
    status: Literal["answered", "refused", "failed"]
    seconds: float
    memory: float


def run_tool(adapter: Path, case: Path, out: Path, python: str = sys.executable) -> Run:
    """Run the adapter of a tool on a case, in a process of one thread.

    Parameters
    ----------
    adapter : Path
    case, out : Path
        Folders.
    python : str
        The interpreter of the tool's environment.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / "result.json").unlink(missing_ok=True)
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    words = [python, str(adapter), str(case), str(out)]
    with (out / "log.txt").open("w", encoding="utf-8") as log:
        done = subprocess.run(
            [sys.executable, "-c", LAUNCHER, str(MOST_SECONDS), *words],
            stdout=subprocess.PIPE,
            stderr=log,
            env=os.environ | threads,
            check=True,
        )
    (out / "run.json").write_bytes(done.stdout.splitlines()[-1])
    run = read_run(out)
    assert run is not None
    return run


def read_run(out: Path) -> Run | None:
    """Return what a tool answered into a folder, or None if it did not run."""
    if not (out / "run.json").is_file():
        return None
    code, seconds, memory = json.loads((out / "run.json").read_text(encoding="utf-8"))
    answer, status = _read(out.name, out, code)
    return Run(answer, status, seconds, memory / 1024)


def _read(
    tool: str, out: Path, code: int
) -> tuple[Answer, Literal["answered", "refused", "failed"]]:
    """Return the answer in a folder and its status; without a valid file the tool failed."""
    try:
        answer = Answer.model_validate_json((out / "result.json").read_text(encoding="utf-8"))
    except (OSError, ValidationError) as error:
        lines = (out / "log.txt").read_text(encoding="utf-8", errors="replace").splitlines()
        last = lines[-1] if code and lines else str(error).splitlines()[0]
        why = f"exit code {code}: {last[:160]}"
        return Answer(tool=tool, refused=why), "failed"
    return answer, "refused" if answer.refused else "answered"


def schema_text() -> str:
    """Return the JSON schema of `result.json`."""
    return json.dumps(Answer.model_json_schema(), indent=1) + "\n"
