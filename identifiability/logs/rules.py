"""`Rules`: limits and levels by which logs are read, mended and low-passed."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits and levels by which logs are read, mended and low-passed.

    Attributes
    ----------
    fewest : int, studies/rules.py
        Fewer samples than this say nothing about any robot. [×2 changes 2 (numbers: all columns
        hang) of 108 answers that reach it]
    largest : float, reasoned
        No time, position or torque in SI units is larger: time since 1970 is 1.7e9 s.
    smallest_torque : float [N·m or N], reasoned
        Nor is all torque of a log smaller: it holds a hundredth of a milligram at a millimetre.
    stuck : int, reasoned
        Equal values on end, where most runs of equal values have one, are a sensor or a logger
        that hangs: as many times more where a slower clock, or coarse steps, repeat them.
    moving : float, reasoned
        Share of its usual step, or of its range, by which a joint moves there that does move.
    shortest_step : float [s], studies/rules.py
        No log is sampled faster than this. [÷2 and ×2 change none of 65 answers that reach it]
    fastest_step : float [s], studies/rules.py
        Usual steps of a log of motion are between this [÷2 and ×2 change none of 65 answers
        that reach it]
    slowest_step : float [s], studies/rules.py
        and this. [÷2 and ×2 change none of 108 answers that reach it]
    longest_step : float [s], by hand
        Nobody writes a log with longer steps than this.
    speeds : tuple[float, float] [rad/s or m/s], by hand
        The fastest joint of a log is between as slow and as fast as this, taken over a few
        samples: in a unit in which it were not, the times cannot be.
    unit_size : float, by hand
        Velocities are those of positions in a unit if they have the size of their slope up
        to this power of ten, and explain it as derivatives must (`derivative_unexplained`).
    epoch : tuple[float, float] [s], reasoned
        Seconds since 1970 between 2000 and 2100: such times are of a calendar.
    clock_odd : float, studies/rules.py
        Steps of the clock that differ from the usual one by more than this share of it are
        remembered. [÷2 and ×2 change none of 109 answers that reach it]
    clock_rounded : float, studies/rules.py
        Share of a step by which a clock's rounding makes steps differ; a mean step that differs
        from the usual one by more is said. [÷2 and ×2 change none of 82 answers that reach it]
    even : float, studies/rules.py
        What is off by less than this share of a step, of time or of an encoder, is even. [÷2
        and ×2 change none of 92 answers that reach it]
    gap : float, studies/rules.py
        A step longer than so many usual ones is a gap. [×2 changes 1 (sentences: lost samples
        here and there) of 92 answers that reach it]
    gap_jitter : float, reasoned
        Nor is a step a gap that is longer than the usual one by less than so many times
        what 95 % of the steps nearer than that deviate by: four standard deviations.
    gap_uneven : float, by hand
        Nor is a log refused whose longest or shortest step is off by less than so many
        times what 95 % of its steps are off by.
    gap_bridged : float, literature
        A gap is bridged up to this share of the period of the cut-off [Nyquist 1928].
    gap_most : float, studies/rules.py
        More gaps than this share of the samples are lost samples only where half of them are
        whole steps [÷2 and ×2 change none of 82 answers that reach it]
    gap_whole : float, reasoned
        up to this share of one, which of uneven steps a quarter is: else the clock is no
        clock.
    gap_kept : float, studies/rules.py
        A log with derivatives of its own is not split at gaps of at most so many steps, nor are
        they compared across longer ones. [÷2 and ×2 change none of 92 answers that reach it]
    repeats_longest : int [samples], studies/rules.py
        Longest run of values that repeat the one before; what lasts longer is a rest or a gap.
        [÷2 and ×2 change none of 90 answers that reach it]
    repeats_steps : float, reasoned
        Across a run of repeated values a joint moves by at least so many steps of its
        encoder, else rounding explains that nothing changed.
    encoder_exact : float, studies/rules.py
        Changes are whole steps of an encoder up to this share of one, if nearly all are; [÷2
        and ×2 change none of 81 answers that reach it]
    encoder_coarse : float, studies/rules.py
        a step that is this share of the usual change from sample to sample is worth a note. [÷2
        changes 1 (false alarm: five-bar, noise: encoder 1 mrad), ×2 changes 2 (sentences:
        3-rps, noise: encoder 1 mrad) of 81 answers that reach it]
    derivative_unexplained : float, studies/rules.py
        Share of the motion's variance that a given derivative may leave unexplained, and by
        which it may be too small, or its inverse too large. [÷2 and ×2 change none of 105
        answers that reach it]
    derivative_visible : float, studies/rules.py
        Motion must stand out this much from the noise of single samples to be compared. [÷2 and
        ×2 change none of 13 answers that reach it]
    positions_odd : float, studies/rules.py
        Share of the positions that may lie anywhere where it is asked whether limits in degrees
        would hold all. [÷2 and ×2 change none of 79 answers that reach it]
    command_followed : float, by hand
        A command is followed if positions correlate with it so much
    command_late : float [s], by hand
        at some delay up to this one,
    command_degrees : tuple[float, float], reasoned
        and if it does not vary so many times as much, as degrees would (57.3);
    command_still : float [rad or m], by hand
        what varies less stands.
    rows_lacking : float, studies/rules.py
        A column that lacks less than this share of the rows has broken rows, not another rate.
        [÷2 and ×2 change none of 68 answers that reach it]
    nearly_all : float, studies/rules.py
        Share that counts as nearly all: of the runs of a column that have the usual length up
        to one sample, so that it has a rate of its own; of the windows of a long log that
        another one has too; of the samples that are there again where a motion was repeated.
        [÷2 and ×2 change none of 83 answers that reach it]
    rate_far : float, by hand
        Nothing is put between samples of a column that lie farther apart than so many of
        its steps.
    rate_slower : float, by hand
        Velocities that come slower than positions by this factor are left out, and
        computed.
    rate_other : float, by hand
        Rates that differ by this share are two.
    locked_play : float [rad or m], studies/rules.py
        A joint that is locked moves less than this, but for less than half of the rows, which
        are left out. [÷2 and ×2 change none of 6 answers that reach it]
    copy_agrees : float, studies/rules.py
        Values agree within this share of their standard deviation. [÷2 and ×2 change none of
        105 answers that reach it]
    copy_chance : float, level
        A run that chance explains comes less often than this in all the rows.
    spike_steps : float, studies/rules.py
        A spike is wrong if it is so many times higher than any step, [÷2 and ×2 change none of
        105 answers that reach it]
    spike_around : float, studies/rules.py
        so many times higher than those around it and than the column's resolution, [÷2 and ×2
        change none of 105 answers that reach it]
    spike_tail : float, studies/rules.py
        and so many times higher than where the tail of all spikes begins; at an end of the
        column, where it is not seen to come back, also than the range of the column. [÷2 and ×2
        change none of 105 answers that reach it]
    wrap_step : float, by hand
        Positions are wrapped where they jump, and else change by at most this share of half
        a turn from sample to sample.
    quaternion_norm : float, by hand
        A quaternion whose norm is further from one than this is none.
    cutoff_lowest : float [Hz], reasoned
        No computed derivatives are low-passed below this for the motion's sake: however
        slow the program, friction and flexibility make joints move at some hertz, and
        inertia is seen nowhere but there.
    cutoff_wide : float, calibrated
        The cut-off in bandwidths of the motion.
    cutoff_lowered : float, calibrated
        Noise may lower the cut-off to this share of either: at three bandwidths few outputs
        are left, and nothing can be judged; gravity and friction are seen in slow motion
        too, whatever its accelerations are, and need outputs.
    cutoff_highest : float, studies/rules.py
        Largest cut-off as a share of the sampling rate. [÷2 changes 72 (numbers: time in ns),
        ×2 changes 67 (numbers: time in ns) of 91 answers that reach it]
    noise_share : float, calibrated
        Largest power that noise may have in the acceleration, as a share of the
        acceleration's.
    noise_still : float, studies/rules.py
        Joints with less than this share of the acceleration of the one that accelerates most
        (rms) do not lower the cut-off of the others. [÷2 and ×2 change none of 91 answers that
        reach it]
    motion_seen : float, reasoned
        Where the smoothed spectrum is not so many times the noise, there is no motion to be
        seen: the steps of a coarse encoder fall with the square of the frequency, which is
        25 times over `noise_above`, positions with the sixth power or faster.
    noise_negligible : float, studies/rules.py
        Noise below this share of a signal moves no value by what could be seen. [÷2 and ×2
        change none of 12 answers that reach it]
    noise_resolved : float, by hand
        Noise at rest of less than this share of that in motion (rms) cannot be told from
        none.
    dwell : float, derived
        A stay about zero speed is a dwell where it lasts longer than a reversal would at
        this share of the joint's typical acceleration. Those of Gaussian motion at its
        reversals are Rayleigh distributed [Rice 1944]: 2 % of them are slower, √(−2 ln
        .98);
    dwell_creep : float, derived
        and 5 %, √(−2 ln .95). The former counts within the errors of a record, this where a
        joint creeps.
    creep : float, studies/rules.py
        Speed that says nothing, as a share of a joint's largest: nothing but friction at rest
        is learnt of such motion, and joints creep there where friction is regularised. [÷2
        changes 43 (sentences: time in ns), ×2 changes 28 (numbers: the number of the sample) of
        92 answers that reach it]
    reversal_blur : float, calibrated
        Periods of the cut-off on each side that the low-pass mixes with a dwell or with a
        reversal: its main lobe. With half as many, values of robots that stick left their
        intervals.
    echo_nothing : float, studies/rules.py
        Noise with a smaller share of every acceleration (rms) does nothing to values. [÷2 and
        ×2 change none of 6 answers that reach it]
    echo_explained : float, by hand
        What the smoothed motion leaves out may be so many times what a low-pass leaves out
        of noise.
    loops_open : float, by hand
        Share of samples at which the loops may stay open along another motion.
    again_near : float, by hand
        Positions of a repetition differ by no more than this share of how much they vary
        (rms), and noise;
    noise_shared : float, by hand
        Correlation of two records' differences from which on they are said to share their
        noise: rounding is the same where an encoder passes the same places.
    instrument_followed : float, by hand
        A command that serves as an instrument differs from the motion by no more than this
        share of how much it varies (rms),
    instrument_late : float [s], by hand
        and comes no earlier or later than this.
    series_explained : float, by hand
        A series explains a motion if what is left is at most so many times the noise.
    series_samples : float, by hand
        A series has no harmonic of which a period has fewer samples than this, on average.
    """

    fewest: int = 20
    largest: float = 1e12
    smallest_torque: float = 1e-9
    stuck: int = 16
    moving: float = 0.1
    shortest_step: float = 1e-7
    fastest_step: float = 5e-5
    slowest_step: float = 0.5
    longest_step: float = 20.0
    speeds: tuple[float, float] = (0.002, 30.0)
    unit_size: float = 0.1
    epoch: tuple[float, float] = (9.46e8, 4.1e9)
    clock_odd: float = 0.4
    clock_rounded: float = 0.01
    even: float = 1e-3
    gap: float = 1.5
    gap_jitter: float = 2.0
    gap_uneven: float = 5.0
    gap_bridged: float = 0.5
    gap_most: float = 0.25
    gap_whole: float = 0.125
    gap_kept: float = 4.0
    repeats_longest: int = 5
    repeats_steps: float = 4.0
    encoder_exact: float = 0.02
    encoder_coarse: float = 0.25
    derivative_unexplained: float = 0.2
    derivative_visible: float = 4.0
    positions_odd: float = 0.01
    command_followed: float = 0.5
    command_late: float = 0.5
    command_degrees: tuple[float, float] = (30.0, 120.0)
    command_still: float = 1e-3
    rows_lacking: float = 0.2
    nearly_all: float = 0.9
    rate_far: float = 2.5
    rate_slower: float = 2.0
    rate_other: float = 0.1
    locked_play: float = 0.01
    copy_agrees: float = 1e-4
    copy_chance: float = 0.01
    spike_steps: float = 1.5
    spike_around: float = 4.0
    spike_tail: float = 3.0
    wrap_step: float = 0.25
    quaternion_norm: float = 0.01
    cutoff_lowest: float = 5.0
    cutoff_wide: float = 10.0
    cutoff_lowered: float = 0.5
    cutoff_highest: float = 0.2
    noise_share: float = 0.01
    noise_still: float = 0.1
    motion_seen: float = 40.0
    noise_negligible: float = 1e-3
    noise_resolved: float = 0.3
    dwell: float = 0.2
    dwell_creep: float = 0.32
    creep: float = 0.02
    reversal_blur: float = 0.5
    echo_nothing: float = 0.01
    echo_explained: float = 1.03
    loops_open: float = 0.02
    again_near: float = 0.05
    noise_shared: float = 0.3
    instrument_followed: float = 0.3
    instrument_late: float = 0.2
    series_explained: float = 1.15
    series_samples: float = 4.0


RULES = Rules()
