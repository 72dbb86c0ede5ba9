"""The ground: errors, names, options, files that are read and written, results, engines."""
