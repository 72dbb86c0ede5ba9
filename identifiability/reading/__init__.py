"""The reading of the logs: how their columns are to be understood, decided before anything else.

`Reading` holds one way to read the columns (`reading`). `Candidates` lists the ways that are tried
(`candidates`). `TorqueRows` fits the base parameters under a reading (`fit`). `choose_reading`
searches for the reading that the fitted rows prefer (`search`). `CarriedReading` is the reading of
a result, with which new logs are read (`carried`).
"""

from .carried import CarriedReading, ReadingEntry
from .reading import Reading
from .search import choose_reading, contradicts

__all__ = ["CarriedReading", "Reading", "ReadingEntry", "choose_reading", "contradicts"]
