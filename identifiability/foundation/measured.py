"""A number beside how uncertain it is, as a sentence has it."""

import math


def measured(value: float, half: float, unit: str = "") -> str:
    """Return a value and half of its interval, which keeps two digits.

    Parameters
    ----------
    value, half : float
    unit : str
        Goes behind the value.

    Examples
    --------
    >>> measured(1.5234, 0.0412, "kg"), measured(18.26, 3.1, "%"), measured(-60.4, 250.0)
    ('1.523 kg ± 0.041', '18.3 % ± 3.1', '-60 ± 250')
    """
    places = 0
    if 0 < half < math.inf:
        places = max(0, 1 - math.floor(math.log10(half)))
    value, half = round(value, places) + 0.0, round(half, places)
    return f"{value:.{places}f}{f' {unit}' if unit else ''} ± {half:.{places}f}"
