"""A folder to begin a study in: robot, sidecar, logs, script and Makefile, which run at once."""

from identifiability.workflows.study.workflow import Study, new_study

__all__ = ["Study", "new_study"]
