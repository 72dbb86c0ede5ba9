"""Ladders of models: files in, rungs over base parameters out.

What to use when: `find_ladder` gives the ladder that a user means, `build_ladder` its rungs;
`rung_entry` turns a rung back into what a file holds. A *model file* is a ladder of one rung.
"""

from identifiability.regression.reduction.file import (
    DEFAULT_EFFECTS,
    USUAL_EFFECTS,
    LadderEntry,
    LadderLike,
    LadderSource,
    ModelLike,
    RungEntry,
    choose_model,
    default_ladder,
    find_ladder,
    free_again,
    ladder_model,
    ladder_path,
    ladder_text,
    read_ladder,
    unused_ladder,
)
from identifiability.regression.reduction.rung import (
    Rung,
    build_comparison,
    build_ladder,
    full_rung,
    rung_entry,
)

__all__ = [
    "DEFAULT_EFFECTS",
    "USUAL_EFFECTS",
    "LadderEntry",
    "LadderLike",
    "LadderSource",
    "ModelLike",
    "Rung",
    "RungEntry",
    "build_comparison",
    "build_ladder",
    "choose_model",
    "default_ladder",
    "find_ladder",
    "free_again",
    "full_rung",
    "ladder_model",
    "ladder_path",
    "ladder_text",
    "read_ladder",
    "rung_entry",
    "unused_ladder",
]
