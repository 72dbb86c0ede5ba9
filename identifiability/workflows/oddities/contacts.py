"""Contacts of a robot that floats: do those said to be closed stand, are impacts aliased?"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs.base import ACC
from identifiability.logs.prepare import Samples
from identifiability.logs.signals import sampling_step
from identifiability.robot.floating import slip_shares
from identifiability.workflows.oddities.check import Does, MeasuredLogs, check
from identifiability.workflows.oddities.rules import RULES

#: and what has so many times the mean of such noise is none.
NOISE: Tolerance = 2.0

#: this share of its mean;
SHARE: Tolerance = 0.45

#: Where windows are sorted by their power, noise that never rests has in this share of them, the
#: quietest,
QUIET: Tolerance = 0.2

#: Samples at which it is looked at whether a closed contact stands.
LOOKED = 5000


@check(
    "closed contacts that move",
    Does.HINTS,
    57,
    always=True,
    says="… against the other closed contacts, at up to … % of how fast they do while open",
    means="A foot or support that is said to stand slips, or its flag, schedule or frame is wrong.",
    do="Look at the flags of the contact that is named; slipping stretches are left out by "
    "`schedule`.",
)
def find_slips(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return which contacts move while they are said to be closed; nothing if none does."""
    robot = logs.robot
    if robot.base is None:
        return ()
    shares = np.zeros(len(robot.base.contacts))
    for s in logs.samples:
        if isinstance(s, Samples) and s.motion.touch is not None:
            some = s.motion[:: max(1, len(s.motion) // LOOKED)]
            assert some.touch is not None
            found = slip_shares(robot.tree, robot.base, some.q, some.v, some.touch)
            shares = np.fmax(shares, found)
    moving = [
        c.name for c, x in zip(robot.base.contacts, shares, strict=True) if x > RULES.contact_slips
    ]
    if not moving:
        return ()
    return (
        f"{listing(moving, 4)} {'moves' if len(moving) == 1 else 'move'} against the other closed "
        f"contacts, at up to {100 * shares.max():.2g} % of how fast they do while open: flags, "
        "schedule or frames are wrong, and forces that they hide may be no contact's.",
    )


#: Samples of the windows that spectra are made of, and the highest of their frequencies that are
#: asked, next to half the sampling rate.
WINDOW, HIGHEST = 32, 4


@check(
    "impacts sampled without a low-pass",
    Does.MISREADS,
    10,
    says="The acceleration of the base in … comes in bursts that reach up to half the sampling "
    "rate",
    means="Feet hit the ground, and the sensor's ringing was sampled too slowly: what is above "
    "half the rate appears (aliased) as motion that never was.",
    do="Let acceleration, angular velocity and torque pass the same low-pass, below 0.4 of the "
    "sampling rate, before they are sampled; or sample faster. Such a log cannot be mended.",
)
def find_aliases(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return which logs hold impacts that were sampled without a low-pass; nothing if none does."""
    if logs.robot.base is None:
        return ()
    found: dict[str, float] = {}
    bands = {s.name: getattr(s, "band", None) for s in logs.samples}
    for _, log in logs.windows():
        if log.base is not None and len(log) > WINDOW:
            dt = sampling_step(log.t)
            cutoff = bands.get(log.name) or 0.5 / dt
            share = folded_share(log.base[:, ACC], dt, cutoff)
            found[log.name] = max(found.get(log.name, 0.0), share)
    names = [name for name, share in found.items() if share > RULES.impacts_folded]
    if not names:
        return ()
    return (
        f"The acceleration of the base in {listing(names, 4)} comes in bursts that reach up to "
        f"half the sampling rate: of impacts sampled without a low-pass about "
        f"{100 * max(found.values()):.0f} % of it is folded into the band of the motion, where it "
        "cannot be told from motion; let acceleration, angular velocity and torque pass the same "
        "low-pass, below 0.4 of the sampling rate, before they are sampled, or sample faster.",
    )


def folded_share(x: Array, dt: float, cutoff: float) -> float:
    """Return which share (rms) of signals (N, k) below a cut-off [Hz] comes from aliases.

    A spectrum that was cut off before it was sampled has fallen to its noise at half the sampling
    rate; of one that was not, what lies just above is folded to just below. Noise is there all
    the time and impacts are not: what windows have there beyond the quietest of them is taken for
    aliases, and to reach down through the band as it is.
    """
    taper = np.hanning(WINDOW)
    parts = np.lib.stride_tricks.sliding_window_view(x, WINDOW, axis=0)[:: WINDOW // 2]
    Z = np.fft.rfft((parts - parts.mean(-1, keepdims=True)) * taper)[..., -HIGHEST - 1 : -1]
    power = (np.abs(Z) ** 2).mean(-1) * 2 / (WINDOW * (taper**2).sum())
    mean, noise = (
        power.mean(0),
        np.quantile(power, QUIET, axis=0) / SHARE,
    )
    folded = np.where(mean > NOISE * noise, mean - noise, 0.0).sum()
    reached = cutoff * dt * WINDOW
    return float(np.sqrt(folded * reached / max(x.var(0).sum(), 1e-300)))
