"""Robots from tables of Denavit and Hartenberg: `convert_dh` writes a robot file of a table."""

from identifiability.robot.dh.convert import Converted, convert_dh

__all__ = ["Converted", "convert_dh"]
