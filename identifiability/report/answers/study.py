"""What `new` answers: the files of a study, and the first command to type."""

from __future__ import annotations

from typing import TYPE_CHECKING

from identifiability.foundation.findings import phrase
from identifiability.foundation.presenter import Presenter
from identifiability.foundation.quoting import path_for_shell
from identifiability.workflows.study import RUNS

from .common import sentence

if TYPE_CHECKING:
    from identifiability.workflows.study import Study


class StudyPresenter(Presenter):
    """Answers of `new`."""

    result: Study

    def next_line(self) -> str:
        """Return the first command to type."""
        result = self.result
        alone = f"inspect {path_for_shell(result.robot)}"
        verb = "analyze --report report.html" if result.has_logs else alone
        return f"cd {path_for_shell(result.folder)} && identifiability {verb}"

    def statement(self) -> str:
        """Return the files of the study, in one sentence."""
        result = self.result
        logs = [*result.fitted, *filter(None, [result.held_back]), *result.loaded]
        part = "logs" if result.has_logs else "alone"
        files = phrase("study", part, logs=logs, runs=[*RUNS])
        said = [sentence("study.files", folder=result.folder, robot=result.robot, files=files)]
        if result.has_logs and result.held_back:
            said.append(sentence("study.files", "held", log=result.held_back))
        if result.loaded:
            said.append(sentence("study.files", "loaded", logs=result.loaded))
        return " ".join(said)
