"""Workflows: one folder or file for each verb. Imports follow the layers in `pyproject.toml`."""
