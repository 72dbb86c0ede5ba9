"""Common parts of the paper's studies: robot, noise, trials, printed numbers, pages."""
