"""Answers of `export`: the content of the files, and their errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from identifiability.foundation.presenter import Presenter

from .common import sentence

if TYPE_CHECKING:
    from identifiability.workflows.export.draws import Draws
    from identifiability.workflows.export.workflow import Exported, Unseen


class ExportedPresenter(Presenter):
    """Answers of `export`."""

    result: Exported

    def statement(self) -> str:
        """Return the content of the files, in words."""
        result = self.result
        about = "export.files"
        parts = list[str]()
        alone = result.error_ra_file
        name = result.robot.name
        if result.lacking:
            parts.append(result.lacking)
        if result.snippet is not None:
            snippet = result.snippet.name
            parts.append(sentence(about, "snippet", snippet=snippet, added=result.added))
        if result.error_ra is not None and alone is not None:
            parts.append(sentence(about, "errors", file=name, error=result.error_ra, alone=alone))
        if result.unseen is not None:
            parts.append(result.unseen.told)
        return " ".join([*parts, *result.notes])


class UnseenPresenter(Presenter):
    """Errors of robot files on logs that were not fitted."""

    result: Unseen

    def told(self) -> str:
        """Return the errors, in a sentence."""
        result = self.result
        about = "export.unseen"
        part = "callback" if result.callback else "sidecar"
        whole = sentence(about, part, callback=result.callback, both=result.both)
        own, file = result.names
        if own == file:  # a patch changes the file in place
            own, file = (sentence(about, part, name=file) for part in ("old", "new"))
        files = {"own": own, "file": file, "worst": result.worst}
        more = whole if result.both != result.written else ""
        errors = {"written": result.written, "before": result.before, "more": more}
        return sentence(about, logs=result.logs, **files, **errors)


class DrawsPresenter(Presenter):
    """Words about drawn robots."""

    result: Draws

    def statement(self) -> str:
        """Return their number and their prior, in words."""
        result = self.result
        said = sentence("export.draws", count=len(result.values), share=result.share)
        return " ".join([said, *result.hints])
