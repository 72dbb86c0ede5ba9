"""`Thresholds` of the verdicts, and `Rules` by which models are estimated and judged."""

from __future__ import annotations

from identifiability.foundation.options import Positive, Share
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Thresholds(RuleTable):
    """Thresholds of the verdicts.

    Attributes
    ----------
    sigma_percent : float [%], by hand
        Largest σ of an identifiable parameter, of its value: robust σ of what its label says.
    sign_level : float, level
        Level at which the sign of a parameter must be certain.
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

    @property
    def sigma_share(self) -> float:
        """`sigma_percent` as a share of the value."""
        return self.sigma_percent / 100


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
    body_share : float, studies/rules.py
        How far a body's mass, first and second moments are taken to lie from the robot file's,
        relative to m, m·r and m·r² with r the rms distance of its mass from its frame. [÷2
        changes 1 (numbers: prune five-bar), ×2 changes 2 (numbers: prune two-link) of 6 answers
        that reach it]
    blocks_fewest : int, studies/rules.py
        Fewer blocks than this say nothing about the spread between blocks. [÷2 and ×2 change
        none of 14 answers that reach it]
    memories : float, literature
        Window of the integrated autocorrelation time, in units of itself [Sokal 1997]; so long
        are stretches of time whose scatter is taken as independent, while there are enough.
    stretches_fewest : int, studies/rules.py
        Fewest such stretches of scores, [÷2 changes 2 (sentences: analyze positions two-link),
        ×2 changes 9 (numbers: analyze two-link) of 12 answers that reach it]
    errors_fewest : int, studies/rules.py
        and of errors. [÷2 and ×2 change none of 6 answers that reach it]
    unasked_level : float, level
        Level of a test that nobody asked for: whether a function is missing, the halves of a log
        differ, a suggested move is denied, ranks are uneven.
    columns_most : float, studies/rules.py
        Columns that explain the noise-free part may take at most this share of a joint's rows.
        [÷2 changes 1 (numbers: diagnose two-link), ×2 changes 1 (numbers: diagnose two-link) of
        7 answers that reach it]
    column_short : float, studies/rules.py
        Directions of unit columns below this length are left to the noise. [÷2 changes 1
        (numbers: diagnose two-link), ×2 changes 1 (numbers: diagnose two-link) of 7 answers
        that reach it]
    instrument_strong : float, by hand
        A direction follows its instrument from this canonical correlation on,
    instrument_f : float, literature
        and one that was measured again from this first-stage F on, samples for N [Lee
        2022]: one actuator alone may know of the direction.
    instrument_left : float, by hand
        Directions of which noise leaves less than this share stay with least squares: what
        is known of the noise is not enough to multiply them by more.
    rollout_contradicted : float, calibrated
        Share of what there is to explain by which the best rollout errs, of half of the joints,
        where gains contradict it (simulated servos only),
    rollout_noises : float, calibrated
        and how many times the noise of positions is nothing to explain.
    servo_many : float, by hand
        A servo that makes so many times the torque that the file's bodies need has other gains,
    servo_told : float, by hand
        where these bodies explain this share of it beside rotors, friction and offsets.
    sigma_other : float, by hand
        Share of σ by noise beyond which what else moves a value is spoken of.
    """

    paper_factor: float = 10.0
    direction_touched: float = 0.1
    body_share: float = 0.3
    blocks_fewest: int = 8
    memories: float = 5.0
    stretches_fewest: int = 12
    errors_fewest: int = 4
    unasked_level: float = 0.01
    columns_most: float = 0.45
    column_short: float = 1e-3
    instrument_strong: float = 0.9
    instrument_f: float = 104.7
    instrument_left: float = 0.5
    rollout_contradicted: float = 0.5
    rollout_noises: float = 5.0
    servo_many: float = 5.0
    servo_told: float = 0.1
    sigma_other: float = 0.5


RULES = Rules()
