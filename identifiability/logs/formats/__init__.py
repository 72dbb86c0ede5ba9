"""Formats of logs that are read at once into one table, one file a format.

To add one: a function under `reader.reader`, in a file of its own; files of this folder are found
by themselves. It returns columns as they stand: names and units are settled for all alike. Tables
of text and Parquet, of any length, are in `logs.tables`.
"""

from importlib import import_module
from pkgutil import iter_modules

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
