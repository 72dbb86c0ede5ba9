"""`Rules`: limits of the data-quality checks."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits of the data-quality checks.

    Attributes
    ----------
    contact_slips : float, by hand
        A closed contact that moves at this share of how fast it does while open does not
        stand.
    impacts_folded : float, calibrated
        Intervals of a quadruped's trot held (.98) where .02 to .04 of the acceleration was
        folded, and did not (.61 and .69) from .07 on.
    sign_turned : float, studies/rules.py
        Share of the samples at which noise turns the sign of a velocity that is said. [÷2 and
        ×2 change none of 90 answers that reach it]
    outside_share : float, studies/rules.py
        Share of the samples that must lie outside the limits of a joint, [÷2 and ×2 change none
        of 90 answers that reach it]
    outside_margin : float, studies/rules.py
        by this share of the allowed range. [÷2 and ×2 change none of 90 answers that reach it]
    stuck_changes : float, studies/rules.py
        A column is stuck where over as many samples it usually changes by so many times its
        resolution [÷2 and ×2 change none of 5 answers that reach it]
    stuck_jumps : float, by hand
        and, when it goes on, jumps so many times as far as it usually changes in one
        sample.
    delay_small : float, by hand
        Relative error of the log, unmoved, below which no delay is looked for;
    delay_left : float, studies/rules.py
        and the largest that may be left of it, moved: a fit that explains little says nothing
        on time. [×2 changes 7 (sentences: a long rest before and after) of 75 answers that
        reach it]
    delay_rows : float, studies/rules.py
        Fewest rows for each column of the model, with which a delay is looked for, [÷2 and ×2
        change none of 75 answers that reach it]
    delay_fewest : int, studies/rules.py
        and fewest in all. [÷2 and ×2 change none of 75 answers that reach it]
    shift_outputs : float, studies/rules.py
        Fewest outputs for each column, and for each of the stretches between which they
        scatter, with which a shift of a part of a sample is, [÷2 and ×2 change none of 63
        answers that reach it]
    shift_samples : int, studies/rules.py
        and fewest samples of such a stretch. [÷2 and ×2 change none of 11 answers that reach
        it]
    shift_chance : float, level
        A shift of a part of a sample is said where chance makes one so seldom,
    shift_least : float [samples], studies/rules.py
        from this size on [÷2 and ×2 change none of 64 answers that reach it]
    shift_most : float [samples], by hand
        and up to where its slope tells it.
    speed_beyond : float, studies/rules.py
        Speeds beyond so many times the limit at every joint that has one, or below the inverse
        square. [÷2 and ×2 change none of 86 answers that reach it]
    time_ratio : float, studies/rules.py
        Torque follows acceleration by another factor than weight if their ratio is beyond this.
        [÷2 and ×2 change none of 66 answers that reach it]
    weight_carried : float, studies/rules.py
        Measured torque is too small if its size is this share of the weight that it has to
        hold. [÷2 and ×2 change none of 78 answers that reach it]
    weight_felt : float, studies/rules.py
        Weight must be this share of the largest one among like joints. [÷2 and ×2 change none
        of 85 answers that reach it]
    factor_widest : float, studies/rules.py
        Half of the widest interval with which the factor of a torque's gravity (−1, 0, ½, 1) is
        named. [÷2 changes 1 (numbers: effort before a gear of 2, 3-rps), ×2 changes 1
        (sentences: effort before a gear of 2, 3-rps) of 84 answers that reach it]
    factor_near : float, studies/rules.py
        Nor is it named as one half where its interval ends farther from it than this. [÷2 and
        ×2 change none of 83 answers that reach it]
    factor_worse : float, by hand
        How much worse one of two models may fit that is as good.
    unit_factor : float, studies/rules.py
        A file's masses are hardly wrong by such a factor. [÷2 changes 1 (sentences: per cent of
        the rated torque) of 85 answers that reach it]
    unit_apart : float, studies/rules.py
        Nor do factors of two joints differ by more than this. [×2 changes 1 (missed: per cent
        of the rated torque) of 73 answers that reach it]
    scale_distinct : float, studies/rules.py
        Share of the predicted torque that must not look like friction, rotor inertia and
        offset. [÷2 and ×2 change none of 82 answers that reach it]
    scale_follows : float, studies/rules.py
        The measured torque must follow the predicted one with this correlation, at that joint.
        [÷2 and ×2 change none of 82 answers that reach it]
    scale_agrees : float, studies/rules.py
        All that the file predicts agrees with the measured torque from this correlation on,
        where masses alone do not show. [÷2 and ×2 change none of 17 answers that reach it]
    scale_felt : float, studies/rules.py
        Predicted torque of a joint must be this share of the largest one among like joints. [×2
        changes 1 (missed: per cent of the rated torque) of 82 answers that reach it]
    unit_alike : float, by hand
        Factors of all joints are one unit if they lie within this factor of their middle.
    clipped_share : float, studies/rules.py
        An extreme value is a flat top if the column stays there this often in all [÷2 and ×2
        change none of 90 answers that reach it]
    clipped_crowded : float, by hand
        and it is met so many times as often as the next band of the same width.
    mixed_bad : float, studies/rules.py
        Relative error of the unpruned model up to which nothing is looked for. [÷2 and ×2
        change none of 65 answers that reach it]
    mixed_error : float, studies/rules.py
        The sum of squared errors must fall below this share of that of the log as it is. [×2
        changes 1 (missed: one gain of 20) of 15 answers that reach it]
    """

    contact_slips: float = 1 / 3
    impacts_folded: float = 0.06
    sign_turned: float = 0.01
    outside_share: float = 0.2
    outside_margin: float = 0.05
    stuck_changes: float = 12.0
    stuck_jumps: float = 6.0
    delay_small: float = 0.03
    delay_left: float = 0.5
    delay_rows: float = 3.0
    delay_fewest: int = 100
    shift_outputs: float = 2.0
    shift_samples: int = 8
    shift_chance: float = 1e-3
    shift_least: float = 0.25
    shift_most: float = 4.0
    speed_beyond: float = 10.0
    time_ratio: float = 400.0
    weight_carried: float = 0.1
    weight_felt: float = 0.05
    factor_widest: float = 0.25
    factor_near: float = 0.05
    factor_worse: float = 1.1
    unit_factor: float = 5.0
    unit_apart: float = 8.0
    scale_distinct: float = 0.3
    scale_follows: float = 0.7
    scale_agrees: float = 0.9
    scale_felt: float = 0.02
    unit_alike: float = 1.5
    clipped_share: float = 0.005
    clipped_crowded: float = 6.0
    mixed_bad: float = 0.1
    mixed_error: float = 0.2


RULES = Rules()
