"""Format numbers as text, with the only rounding of the program, and estimate shares.

Shares of simulated experiments have binomial intervals if trials are independent, and clustered
intervals otherwise.
"""

import math
from collections.abc import Callable
from decimal import Decimal
from functools import partial

from scipy.special import betaincinv, expit

from .errors import count_more
from .names import Array, Strings
from .values import frozen

# Numbers as text.


#: Text in place of a missing number.
NONE = "—"

#: Digits of a value whose σ is (nearly) zero.
DIGITS = 8

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def format_measured(value: float, sigma: float) -> tuple[str, str]:
    """Return a value and its standard deviation, rounded together [PDG 2024, sec. 5.3].

    The three highest digits of σ decide: up to 354 it keeps two digits, from 355 on one, from 950
    on it becomes 1000 and keeps two. The value ends at the same decimal place.

    Examples
    --------
    >>> format_measured(0.8272, 0.1192)
    ('0.83', '0.12')
    >>> format_measured(-61.27, 46.28)
    ('−60', '50')
    >>> format_measured(0.0, float("inf"))
    ('—', '—')
    """
    if not (math.isfinite(value) and math.isfinite(sigma)):
        return NONE, NONE
    size = max(abs(value), sigma)
    if sigma <= size * 10.0**-DIGITS:
        return format_number(value, DIGITS), format_number(sigma, 2)
    power = _exponent(size)
    if -4 < power < 6:
        power = 0
    place = _last_place(sigma) - power
    tail = f"·10{superscript(power)}" if power else ""
    first, second = (_fixed(x / 10.0**power, place) + tail for x in (value, sigma))
    return first, second


def measured(value: float, half: float, unit: str = "") -> str:
    """Return a value with its unit and half of its interval, rounded together.

    Examples
    --------
    >>> measured(1.5234, 0.0412, "kg"), measured(-60.4, 250.0, "1")
    ('1.52 kg ± 0.04', '−60 ± 250')
    """
    first, second = format_measured(value, half)
    shown = "" if unit in ("", "1") else f" {unit}"
    return f"{first}{shown} ± {second}"


def format_number(value: float | None, digits: int = 4, *, pad: bool = False) -> str:
    """Return a number with some significant digits; far from 1 it has a power of ten.

    Parameters
    ----------
    value : float or None
    digits : int
    pad : bool
        Whether to keep trailing zeros, so that numbers in a column end at comparable digits.

    Examples
    --------
    >>> format_number(-0.39517, 3), format_number(228.0), format_number(3.2e-9, 2)
    ('−0.395', '228', '3.2·10⁻⁹')
    >>> format_number(3499.6, 3), format_number(4.5, 3, pad=True), format_number(2e-320, 1)
    ('3500', '4.50', '2·10⁻³²⁰')
    """
    if value is None or not math.isfinite(value):
        return NONE
    if value == 0:
        return "0"
    significand, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    power = int(exponent)
    tail = ""
    if not -5 < power < 6:
        value = float(significand)
        tail = f"·10{superscript(power)}"
        power = 0
    decimals = digits - 1 - power
    text = f"{round(value, decimals):.{max(0, decimals)}f}"
    if not pad and "." in text:
        text = text.rstrip("0").rstrip(".")
    return text.replace("-", "−") + tail


def digits(count: int) -> Callable[[float | None], str]:
    """Return the function that writes a column's numbers with some significant digits, all kept.

    Examples
    --------
    >>> digits(3)(0.12345), digits(3)(61.0)
    ('0.123', '61.0')
    """
    return lambda x: format_number(x, count, pad=True)


def percent(share: float, count: int = 3, *, pad: bool = False) -> str:
    """Return a share in percent with some significant digits, or a dash.

    Examples
    --------
    >>> percent(0.12345), percent(0.12345, 2), percent(0.12, pad=True), percent(1e4)
    ('12.3 %', '12 %', '12.0 %', 'more than 9999 %')
    """
    if 99.99 < share < math.inf:
        return "more than 9999 %"
    if math.isfinite(share):
        return f"{format_number(100 * share, count, pad=pad)} %"
    return NONE


def state_probability(log_odds: float) -> str:
    """Return the probability of log odds [nat] in percent, in words.

    Examples
    --------
    >>> state_probability(1.2), state_probability(6.0), state_probability(1500.0)
    ('probability 77 %', 'probability over 99 %', 'probability over 99.99 %')
    """
    return f"probability {probability_text(log_odds)}"


def probability_text(log_odds: float | None) -> str:
    """Return the probability of log odds [nat] in percent, or a dash.

    Examples
    --------
    >>> probability_text(6.0), probability_text(-20.0), probability_text(math.nan)
    ('over 99 %', 'below 1 %', '—')
    """
    return NONE if log_odds is None else chance_text(float(expit(log_odds)))


def chance_text(probability: float) -> str:
    """Return a probability in percent; near 0 and 1 the limit up to which it can be believed."""
    if probability > 0.99:
        return "over 99.99 %" if probability > 0.9999 else "over 99 %"
    return "below 1 %" if probability < 0.01 else percent(probability, 2)


#: Shares in percent to two digits, and errors to three, zeros kept.
rough_percent, error_text = partial(percent, count=2), partial(percent, pad=True)


def stated_text(stated: float | None, sigma: float = math.nan) -> str:
    """Return a stated value; sums that cancel leave a rounding error, which is zero.

    With an estimate's σ, the value has as many decimals as that estimate.

    Examples
    --------
    >>> stated_text(0.94683), stated_text(0.94683, 0.12), stated_text(1e-17, 0.12)
    ('0.9468', '0.95', '0')
    """
    if stated is not None and abs(stated) < 1e-12:
        return "0"
    ends = format_measured(math.nan if stated is None else stated, sigma)[0]
    if ends == NONE:
        return format_number(stated)
    return ends


def percent_text(value: float | None) -> str:
    """Return a percentage with two significant digits, or a dash.

    Examples
    --------
    >>> percent_text(0.7064), percent_text(20.03), percent_text(621.2), percent_text(math.inf)
    ('0.71 %', '20 %', '620 %', '—')
    """
    if value is None:
        return NONE
    return percent(value / 100, 2)


def format_count(count: int, noun: str) -> str:
    """Return ``1 sample``, ``2250 samples``; five digits or more in groups of three."""
    counted = noun if count == 1 else f"{noun}s"
    digits = f"{count:,}".replace(",", "\u202f" if count > 9999 else "")
    return f"{digits} {counted}"


def join(names: list[str] | Strings, most: int = 6, things: str = "") -> str:
    """Return ``a, b and c``, or the first few and how many more things."""
    if len(names) > most:
        more = count_more(len(names) - most + 1, things)
        return f"{', '.join(names[: most - 1])} {more}"
    if len(names) < 2:
        return "".join(names)
    first = ", ".join(names[:-1])
    return f"{first} and {names[-1]}"


def superscript(power: int) -> str:
    """Return an integer in small raised digits."""
    return str(power).translate(_SUPERSCRIPT)


def _exponent(x: float) -> int:
    return math.floor(math.log10(x)) if x > 0 else 0


def _last_place(sigma: float) -> int:
    """Return the power of ten of the last digit of σ that is kept."""
    exponent = _exponent(sigma)
    lead = round(sigma / 10.0 ** (exponent - 2))
    return exponent - 1 if lead < 355 else exponent


def _fixed(x: float, place: int) -> str:
    rounded = Decimal(repr(float(x))).quantize(Decimal(1).scaleb(place))  # a half to the even digit
    return f"{rounded + 0:f}".replace("-", "−")


# Shares counted in simulated experiments, with the Monte-Carlo error of the count.


#: Level of every interval.
LEVEL = 0.95

#: Standard deviations to each side of a normal interval of that level, and quantiles at its ends.
REACH, ENDS = 1.96, (0.025, 0.975)


@frozen
class Share:
    """A share estimated from counts.

    Attributes
    ----------
    value : float
        NaN without trials.
    low, high : float
        Interval of the true share.
    """

    value: float
    low: float
    high: float


def exact_share(count: float, total: float, level: float = LEVEL) -> Share:
    """Return a binomial share with its exact interval [Clopper & Pearson 1934].

    Parameters
    ----------
    count, total : float
        Need not be whole: effective numbers are allowed.
    level : float
        Of the interval.
    """
    if not total > 0:
        return Share(float("nan"), float("nan"), float("nan"))
    tail = 0.5 * (1 - level)
    low = float(betaincinv(count, total - count + 1, tail)) if count > 0 else 0.0
    high = float(betaincinv(count + 1, total - count, 1 - tail)) if count < total else 1.0
    return Share(count / total, low, high)


def clustered_share(events: Array, among: Array, related: Array) -> Share:
    """Return the share of events in trials, of which each experiment has several.

    Events of one experiment are correlated, so the effective number of trials is smaller [Korn &
    Graubard 1998]. Related events that are more frequent also estimate this correlation; the larger
    design effect counts.

    Parameters
    ----------
    events, among, related : (T, k) bool
        Rows are experiments.
    """
    total = float(among.sum())
    if not total:
        return exact_share(0, 0)
    effective = total / max(design_effect(events, among), design_effect(related, among), 1.0)
    share = float((events & among).sum()) / total
    return exact_share(share * effective, effective)


def design_effect(events: Array, among: Array) -> float:
    """Return the ratio of the variance of a share to that of independent events; else 0."""
    trials = len(events)
    size = among.sum(1).astype(float)
    rows = size.sum()
    count = (events & among).sum(1).astype(float)
    share = count.sum() / rows
    independent = share * (1 - share) / rows
    if not independent > 0 or trials < 2:
        return 0.0
    left = count - share * size
    variance = left @ left / rows**2 * trials / (trials - 1)
    return float(variance / independent)


def each_share(events: Array) -> tuple[Share, ...]:
    """Return the share of every column of (T, k), all intervals right together [Bonferroni]."""
    trials, count = events.shape
    level = 1 - (1 - LEVEL) / max(count, 1)
    return tuple(exact_share(float(c), float(trials), level) for c in events.sum(0))
