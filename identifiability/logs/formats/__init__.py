"""Formats of logs that are read at once into one table; each format has a file.

To add one, write a function under `reader.reader` in a new file. Files of this folder are found
automatically. The function returns the columns of the file; names and units are interpreted for all
formats alike. Text tables and Parquet, of any length, are in `logs.tables`.
"""

from importlib import import_module
from pkgutil import iter_modules

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
