"""`Thresholds` of the verdicts, and `Rules` by which models are estimated and judged."""

from __future__ import annotations

from identifiability.foundation.options import Positive, Share
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Thresholds(RuleTable):
    """Thresholds of the verdicts; reports print them.

    Attributes
    ----------
    sigma_percent : float [%], by hand
        Largest σ of an identifiable parameter, of its value: robust σ of what its label says.
    sign_level : float, level
        Family-wise level at which the sign must be certain (Holm over all parameters).
    recurrence : float, by hand
        Share of resampled logs (block bootstrap) that call an identifiable parameter well known,
        too, below which the share is said: it is information, no condition.
    negligible_share : float, by hand
        A parameter is negligible if its sign is not certain and no value in its 95 % interval
        moves the torque of any joint by more than this share of the joint's residual.
    constraint_variance : float, by hand
        Largest variance of a constraint-determined parameter: of that which the data leave open,
        bodies that can exist narrow the variance below this share.
    contraction : float, by hand
        Least contraction, 1 − posterior sd ∕ prior sd, that is not prior-dominated: a posterior
        that is less narrow repeats the prior.
    outputs_per_parameter : float, by hand
        Fewest independent outputs with which a parameter is judged: degrees of freedom of the
        scatter of its scores over stretches of time.
    """

    sigma_percent: Positive = 20.0
    sign_level: Share = 0.05
    recurrence: Share = 0.9
    negligible_share: Share = 0.1
    constraint_variance: Share = 0.5
    contraction: Share = 0.5
    outputs_per_parameter: Positive = 3.0


@frozen
class Rules(RuleTable):
    """Limits and levels by which models are estimated, judged and told from each other.

    Attributes
    ----------
    paper_factor : float, literature
        Factor of the literature's rule: σ% below so many times the smallest σ% of the model
        [Khalil 2002, Díaz 2010].
    direction_touched : float, by hand
        A parameter leans on directions that make this share of its variance.
    body_share : float, by hand
        How far a body's mass, first and second moments are taken to lie from the robot
        file's, relative to m, m·r and m·r² with r the rms distance of its mass from its
        frame.
    sigma_named : float, by hand
        Least share of σ that makes a sentence name a member of what a number stands for.
    blocks_fewest : int, by hand
        Fewer blocks than this say nothing about the spread between blocks.
    memories : float, literature
        Stretches of time whose scatter is taken as independent are so many autocorrelation
        times long [Sokal 1997], while there are enough of them.
    stretches_fewest : int, by hand
        Fewest such stretches of scores,
    errors_fewest : int, by hand
        and of errors.
    memories_least : float, by hand
        Blocks may be so many autocorrelation times short where longer ones would be too
        few.
    sokal_window : float, literature
        Window of the integrated autocorrelation time, in units of itself [Sokal 1997].
    doubt_level : float, level
        Chance by which some function is taken where none is missing.
    columns_most : float, by hand
        Columns that explain the noise-free part may take at most this share of a joint's
        rows.
    column_short : float, by hand
        Directions of unit columns below this length are left to the noise.
    outputs_enough : float, by hand
        So many independent outputs for each of its parameters leave a model a residual that
        is noise.
    outputs_fewest : float, by hand
        Fewest outputs of a motion for each parameter, below which it is not fitted by
        itself.
    instrument_strong : float, by hand
        A direction follows its instrument from this canonical correlation on,
    instrument_f : float, literature
        and one that was measured again from this first-stage F on, samples for N [Lee
        2022]: one actuator alone may know of the direction.
    instrument_left : float, by hand
        Directions of which noise leaves less than this share stay with least squares: what
        is known of the noise is not enough to multiply them by more.
    block_alone : float, by hand
        What a block leaves of a direction that it determines almost alone is raised to
        this.
    columns_left : float, by hand
        At least this share of the samples is taken to be left by the columns.
    times_different : float, level
        Times are told apart from this share of the distribution on that equal ones would
        have.
    noise_floor : float, reasoned
        White noise that is taken to be there beside the residual, as a share of its
        variance: logs that were filtered before they were stored have empty bands, which
        whitening would blow up.
    direction_acts : float, by hand
        A direction that the fitted motion never showed acts if it makes this share of what
        its columns made there;
    column_never : float, by hand
        and a column which never acted counts for this share of the largest one.
    delay_latest : float [s], by hand
        No delay that is looked for is longer.
    rollout_contradicted : float, calibrated
        Share of what there is to explain by which the best rollout errs, of half of the joints,
        where gains contradict it (simulated servos only),
    rollout_noises : float, calibrated
        and how many times the noise of positions is nothing to explain.
    servo_many : float, by hand
        A servo that makes so many times the torque that the file's bodies need has other gains,
    servo_told : float, by hand
        where these bodies explain this share of it beside rotors, friction and offsets.
    rollout_block : float [s], by hand
        Length of blocks of time whose errors are taken to be independent.
    motions_level : float, level
        Level of each of the two tests: of all parameters together, and of those that move
        by themselves.
    halves_level : float, level
        Level of each where the halves of one log are compared: every log is asked.
    sigma_other : float, by hand
        Share of σ by noise beyond which what else moves a value is spoken of.
    """

    paper_factor: float = 10.0
    direction_touched: float = 0.1
    body_share: float = 0.3
    sigma_named: float = 0.1
    blocks_fewest: int = 8
    memories: float = 5.0
    stretches_fewest: int = 12
    errors_fewest: int = 4
    memories_least: float = 2.0
    sokal_window: float = 5.0
    doubt_level: float = 0.01
    columns_most: float = 0.45
    column_short: float = 1e-3
    outputs_enough: float = 3.0
    outputs_fewest: float = 1.0
    instrument_strong: float = 0.9
    instrument_f: float = 104.7
    instrument_left: float = 0.5
    block_alone: float = 0.05
    columns_left: float = 0.25
    times_different: float = 0.95
    noise_floor: float = 0.05
    direction_acts: float = 1e-5
    column_never: float = 1e-3
    delay_latest: float = 0.06
    rollout_contradicted: float = 0.5
    rollout_noises: float = 5.0
    servo_many: float = 5.0
    servo_told: float = 0.1
    rollout_block: float = 1.0
    motions_level: float = 0.05
    halves_level: float = 0.01
    sigma_other: float = 0.5


RULES = Rules()
