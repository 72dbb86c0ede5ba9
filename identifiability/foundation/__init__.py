"""The ground: errors, names, options, files that are read and written, results, engines."""

#: Of the package, which its metadata takes from here.
__version__ = "0.1.0"
