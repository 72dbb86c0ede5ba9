"""Small robot files, one feature each, and the two roads from them to torque."""

from robot_corpus.entry import Entry
from robot_corpus.every import ENTRIES
from robot_corpus.silent import ELEMENTS, SILENT

__all__ = ["ELEMENTS", "ENTRIES", "SILENT", "Entry"]
