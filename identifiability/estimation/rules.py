"""`Thresholds` of the verdicts, and `Rules` by which models are estimated and judged."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.options import Positive, Share
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Thresholds(RuleTable):
    """Thresholds of the verdicts."""

    sigma_percent: Annotated[
        Positive, "largest robust σ of an identifiable parameter [%], by hand"
    ] = 20.0
    sign_level: Annotated[Share, "level at which the sign must be certain, level"] = 0.05
    negligible_share: Annotated[
        Share, "most that a negligible parameter moves of any residual, by hand"
    ] = 0.1
    constraint_variance: Annotated[
        Share, "share to which bodies narrow an open variance, by hand"
    ] = 0.5
    contraction: Annotated[Share, "least contraction that is not by the prior, by hand"] = 0.5
    outputs_per_parameter: Annotated[
        Positive, "fewest independent outputs to judge by, by hand"
    ] = 3.0


@frozen
class Rules(RuleTable):
    """Limits and levels by which models are estimated, judged and compared."""

    paper_factor: Annotated[
        float, "σ% over the smallest of a model [Khalil 2002] at most, literature"
    ] = 10.0
    body_share: Annotated[
        float, "a body's distance from the file, relative to m, m·r and m·r², by hand"
    ] = 0.3
    blocks_fewest: Annotated[int, "blocks that tell a spread between blocks, by hand"] = 8
    memories: Annotated[
        float, "window [Sokal 1997] and stretches in autocorrelation times, literature"
    ] = 5.0
    stretches_fewest: Annotated[int, "stretches of scores that tell a scatter, by hand"] = 12
    columns_most: Annotated[
        float, "columns of the noise-free part, as a share of rows, by hand"
    ] = 0.45
    name: Annotated[float, "log odds that name a missing effect, on fitted rows, derived"] = 1.0
    keep: Annotated[float, "and how much more with unseen rows keeps it [nat], derived"] = 2.0
    harmful: Annotated[
        float, "standard errors by which unseen motion errs less without one of many names, by hand"
    ] = 2.0
    simpler: Annotated[float, "nats within which fewer columns go first, derived"] = 3.0
    rival: Annotated[float, "nats within which it is A or B, derived"] = 4.0
    law_error: Annotated[Share, "largest error of a law by gain in its joint, calibrated"] = 0.15
    smooth_price: Annotated[float, "gain that a slow function must exceed [nat], calibrated"] = 6.0
    unlikely: Annotated[float, "log odds of no alternative to speak of, by hand"] = -6.0
    grades: Annotated[
        tuple[float, float, float, float],
        "errors of very good, good, fair and poor models, by hand",
    ] = (0.03, 0.08, 0.15, 0.5)
    uneven: Annotated[
        float, "a joint that errs so many times the error of all joints is named, by hand"
    ] = 3.0
    means_apart: Annotated[
        float, "error over each joint's mean over that over one, that is said, by hand"
    ] = 1.3
    contradicted: Annotated[
        float, "standard errors that contradict a body of the file; times its equals, by hand"
    ] = 5.0
    rollout_contradicted: Annotated[
        float, "error of the best rollout where gains contradict it, calibrated"
    ] = 0.5
    constants_within: Annotated[
        float, "torque constants are right to this share, one standard deviation, by hand"
    ] = 0.1
    sigma_other: Annotated[float, "share of σ from which other causes are reported, by hand"] = 0.5


RULES = Rules()
