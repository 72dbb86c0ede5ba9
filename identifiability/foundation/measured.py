"""Numbers as sentences have them: beside how uncertain they are, and in percent."""

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


def percent(share: float, digits: int = 3) -> str:
    """Return a share in percent with so many digits, never in powers of ten.

    Examples
    --------
    >>> percent(0.12345), percent(0.12345, 2), percent(12.345), percent(1e-6), percent(math.nan)
    ('12.3 %', '12 %', '1234 %', 'less than 0.001 %', 'unknown size')
    """
    if not math.isfinite(share):
        return "unknown size"
    if 0 < 100 * share < 1e-3:
        return "less than 0.001 %"
    text = f"{100 * share:.{digits}g}"
    return f"{100 * share:.0f} %" if "e" in text else f"{text} %"
