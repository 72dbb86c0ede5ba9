"""From `Information` to estimates: least squares, spread, errors on other motion, verdicts."""
