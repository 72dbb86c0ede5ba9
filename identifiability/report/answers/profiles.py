"""Sentences on the profiles of an analysis: how far each number may go, and the simpler model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from identifiability.effects import FAMILIES, title_of
from identifiability.effects.effect import EXPONENT
from identifiability.estimation.profile import Profile
from identifiability.foundation.answers import Answer
from identifiability.foundation.rounding import format_number

from .common import answer, sentence


def answer_profiles(profiles: Sequence[Profile], shapes: Mapping[str, float]) -> Answer:
    """Return the regions of all profiles, and which stated shapes lie outside of them."""
    said = list[str]()
    for curve in profiles:
        region = state_region(curve)
        said.append(region)
        stated = shapes.get(curve.number.name, curve.region[0])
        rounded = format_number(stated, 3)
        if not curve.region[0] <= stated <= curve.region[1] and f" {rounded} " not in region:
            place, _, family = curve.number.name.rpartition(".")
            power = shapes.get(f"{curve.number.name}{EXPONENT}")
            more = f",{power:g}" if power else ""
            best = f"{family}@{place}:{curve.best:.3g}{more}"
            holes = {"stated": rounded, "unit": curve.number.unit, "best": best}
            said.append(sentence("analysis.bounds", "excluded", **holes))
    return answer("analysis.bounds", "found", regions=" ".join(said))


def is_width(curve: Profile) -> bool:
    """Whether a number is the width of a learned function, which has no physical meaning."""
    family = FAMILIES.get(curve.number.name.rpartition(".")[2])
    return family is not None and family.flexible


def state_region(curve: Profile) -> str:
    """Return the 95 % region of a number, and simpler models that the logs do not exclude."""
    lower, upper = (format_number(end, 3) for end in curve.region)
    part = {
        (False, False): "both",
        (True, False): "most",
        (False, True): "least",
        (True, True): "open",
    }[curve.open]
    holes = {"name": curve.number.name, "unit": curve.number.unit, "lower": lower, "upper": upper}
    region = sentence("analysis.bounds", part, **holes)
    return " ".join([region, *state_limits(curve)])


def state_limits(curve: Profile) -> list[str]:
    """Return the simpler models at the open ends of a curve, each as a sentence."""
    place, _, family = curve.number.name.rpartition(".")
    if family not in FAMILIES:
        zero = curve.open[0] and curve.number.least == 0
        return [sentence("analysis.bounds", "zero", name=curve.number.name)] if zero else []
    limits = [x for x, is_open in zip(curve.number.limits, curve.open, strict=True) if is_open]
    sentences = list[str]()
    for limit in dict.fromkeys(limits):
        part = "instead" if limit else "without"
        holes = {"effect": title_of(family), "place": place, "limit": title_of(limit)}
        sentences.append(sentence("analysis.bounds", part, **holes))
    return sentences
