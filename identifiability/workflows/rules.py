"""`Rules`: limits by which models are used: errors, comparisons, loads and gains."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which models are used: errors, comparisons, loads and gains.

    Attributes
    ----------
    grades : tuple[float, float, float, float], by hand
        Errors on unseen motion, of how much torque varies, up to which they are called very good,
        good, fair and poor; a rule of thumb. A joint that is poor by itself is named where all
        together are good.
    differs : float, studies/rules.py
        What is so many times as large differs: errors of joints, noise of logs, bands of
        motion. [÷2 changes 20 (sentences: two exchanged positions), ×2 changes 3 (sentences:
        analyze five-bar) of 58 answers that reach it]
    joint_hidden : float, by hand
        Share of the smallest error of a joint below which that of all joints says little of
        any.
    compare_seen : float, by hand
        Torque is compared with what it was where that was so many times what chance makes,
        and nothing of it had a sign that friction and rotors cannot have.
    compare_price : float [σ²], by hand
        What each further number of a cause must explain.
    compare_power : float, level
        Standard deviations above the limit at which nine of ten changes are found.
    compare_blind : float, by hand
        Where friction must change by more than this share everywhere, an unchanged robot is
        no news.
    gain_left : float, by hand
        A load's torque of which less than this share is left beside the model cannot be
        told from it.
    tilt_large : float [°], derived
        Angle beyond which a tilt is looked for before all else: small angles about the
        file's direction, by which a diagnosis names a tilt, leave 1 − cos 15° = 3 % of the
        weight unexplained.
    grows : float, by hand
        An error is spoken of where it is so many times what is usual: of unseen motion, of
        torque that a load leaves, of a stretch of an odd log.
    inside_few : float, by hand
        Share of samples inside their 95 % interval below which something must have changed.
    scale_named : float, by hand
        Share of the scale of a body that is named for it, where bodies fix more than half.
    """

    grades: tuple[float, float, float, float] = (0.03, 0.08, 0.15, 0.5)
    differs: float = 2.0
    joint_hidden: float = 0.8
    compare_seen: float = 3.0
    compare_price: float = 4.0
    compare_power: float = 1.28
    compare_blind: float = 0.5
    gain_left: float = 1e-4
    tilt_large: float = 15.0
    grows: float = 1.5
    inside_few: float = 0.8
    scale_named: float = 0.2


RULES = Rules()
