"""`Search`: from logs that are ready to findings: three passes of naming, stress, verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from identifiability.effects import find_families
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation, Samples
from identifiability.logs.repeats import Recording
from identifiability.workflows.diagnose.complete import keep_complete, keep_one_way
from identifiability.workflows.diagnose.conclude import conclude
from identifiability.workflows.diagnose.doubted import name_doubted
from identifiability.workflows.diagnose.finer import find_finer
from identifiability.workflows.diagnose.gates import Naming
from identifiability.workflows.diagnose.give_back import give_back, list_preferred, with_denied
from identifiability.workflows.diagnose.goes_on import Earlier
from identifiability.workflows.diagnose.in_bodies import keep_off_bodies
from identifiability.workflows.diagnose.in_its_stead import keep_unbeaten
from identifiability.workflows.diagnose.late import early, name_late
from identifiability.workflows.diagnose.material import Material, Setting, gather
from identifiability.workflows.diagnose.naming import Say, name_effects
from identifiability.workflows.diagnose.odd_log import OddLog, still_odd
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.stand_ins import keep_no_stand_ins
from identifiability.workflows.diagnose.stress import stress_named
from identifiability.workflows.diagnose.unnamed import name_unnamed

T = TypeVar("T")


@frozen
class Search:
    """How effects are looked for in some logs.

    Attributes
    ----------
    logs : tuple of Log or LogFile
        As they were measured, one for each of the setting's fitted samples.
    choose : tuple of Samples
        What judges while names are chosen; none to leave out fitted motion in turn.
    how : Preparation or None
        How derivatives are made.
    effects : tuple of str or None
        Families that may be named.
    draws : int
        Simulated noises.
    streams : tuple of numpy.random.Generator
    say : callable(str, float)
    earlier : Earlier or None
        A diagnosis that is gone on from.
    """

    logs: tuple[Recording, ...]
    choose: tuple[Samples, ...]
    how: Preparation | None
    effects: tuple[str, ...] | None
    draws: int
    streams: tuple[np.random.Generator, ...]
    say: Say
    earlier: Earlier | None = None

    def run(self, setting: Setting) -> Diagnosis:
        """Name what is missing, add it, verify."""
        say, streams = self.say, self.streams
        told = () if self.earlier is None else self.earlier.families
        effects = None if self.effects is None else list(dict.fromkeys((*self.effects, *told)))
        first = [f.name for f in early(find_families(effects))]
        m = gather(setting, self.choose, streams[0], dict.fromkeys((*first, *told)), self.draws)
        naming = self._name_first(m, first)
        finer = find_finer(m, naming.chosen)
        if finer:
            # From the beginning: what stands out does so among all shapes, and a rival whose grid
            # lay better must not have been there first.
            m = m.finer(finer)
            naming = self._name_first(m, first)
        if self.earlier is not None:
            naming = replace(naming, p_values={**self.earlier.p_values, **naming.p_values})
        # What resembles the missing effect makes room for it before the next pass.
        complete, elsewhere = _keep_told(m, naming)
        refused = [*_lost(naming, complete), *naming.refused]
        m, late = name_late(m, complete, streams[4], effects, self.draws, say, refused)
        naming, besides = _keep_told(m, late)
        denied = [*refused, *_lost(late, naming)]
        functions = () if self.earlier is None else self.earlier.functions
        m, naming = name_unnamed(m, naming, streams[5], effects, self.draws, say, functions)
        naming = with_denied(naming, denied, m, {*elsewhere, *besides})
        if not naming.chosen:
            naming = self._name_doubted(m, naming)
        found = self._verify(m, naming)
        if self.earlier is None:
            return found
        turns, error = self.earlier.turns(found), self.earlier.error
        return replace(found, earlier=self.earlier.source, earlier_error=error, turns=turns)

    def _verify(self, m: Material, naming: Naming) -> Diagnosis:
        """Return what is left once motion was made anew and unseen motion was asked."""
        self.say("changing the preparation", 0.8)
        stressed = stress_named(m, naming, self.logs, self.how, self.streams[1])
        self.say("verifying", 0.9)
        found = conclude(m, stressed, self.streams[2])
        kept = {(e.name, place) for e in found.effects for place in e.joints}
        left = replace(naming, chosen=tuple(c for c in naming.chosen if c.group in kept))
        gone = {c.group for c in naming.chosen} - kept
        # Names that foretell more may be refuted themselves; then only what is refuted gives way.
        for better in (list_preferred(m, left), {}):
            again = give_back(naming, gone, m.setting.structure.present, better)
            if again is None:
                break
            back = self._verify(m, again)
            if better.keys() <= {place for e in back.effects for place in e.joints}:
                return replace(back, refuted=(*found.refuted, *back.refuted))
        return found

    def _name_first(self, m: Material, first: Sequence[str]) -> Naming:
        """Return what the first pass names, families of an earlier diagnosis beside its own."""
        self.say("naming effects", 0.4)
        start = [] if self.earlier is None else self.earlier.start(m)
        groups = {c.group for c in start}
        options = [c for c in m.candidates if c.family.name in first or c.group in groups]
        rules, present = m.setting.rules, m.setting.structure.present
        return name_effects(m.bench, options, m.held, rules, present, self.say, start)

    def _name_doubted(self, m: Material, naming: Naming) -> Naming:
        """Return what is left to the motion that verifies, if it explains more than it leaves."""
        self.say("naming what is in doubt", 0.75)
        refused = {c.group for c in naming.refused}
        options = [c for c in m.candidates if not c.family.unnamed and c.group not in refused]
        rules, present = m.setting.rules, m.setting.structure.present
        found = _keep(m, name_doubted(m.bench, options, m.held, rules, present), alone=True)
        return naming.then(found) if found.chosen else naming

    def run_doubted(self, setting: Setting, odd: OddLog) -> tuple[Diagnosis, str]:
        """Name effects without a log that disagrees, unless what is named with it explains it.

        A log whose motion alone shows what is missing disagrees as well, and is the one that says
        most: then no log disagrees any more under the model with what was named. A log that is not
        fitted stays where it is.

        Returns
        -------
        found : Diagnosis
        said : str
            What became of the log.
        """
        found = self.run(setting)
        held = odd.number >= len(setting.samples)
        logs = (*setting.samples, *self.choose, *setting.validation) if held else setting.samples
        if found.effects and not still_odd(found.completed, logs, odd.number):
            return found, odd.kept
        if held:
            return found, odd.doubted
        samples = drop(setting.samples, odd.number)
        others = replace(self, logs=drop(self.logs, odd.number))
        found = others.run(replace(setting, samples=samples, left_out=(odd.name,)))
        return found, odd.left_out


def _keep(m: Material, naming: Naming, *, alone: bool = False) -> Naming:
    """Return a naming without names that are not what is missing, in their joint or in several."""
    return keep_off_bodies(m, _keep_fitting(m, naming, alone=alone))


def _keep_fitting(m: Material, naming: Naming, *, alone: bool = False) -> Naming:
    """Return a naming without names that leave too much, or in whose stead another says more."""
    naming = keep_unbeaten(m, keep_complete(m, naming, alone=alone))
    return keep_no_stand_ins(m, naming)


def _keep_told(m: Material, naming: Naming) -> tuple[Naming, list[str]]:
    """Return what `_keep` does, and the joints of names that gave way to a cause elsewhere."""
    fitting = _keep_fitting(m, naming)
    kept = keep_off_bodies(m, fitting)
    elsewhere = (*_lost(naming, keep_one_way(m, naming)), *_lost(fitting, kept))
    return kept, [c.place for c in elsewhere]


def _lost(before: Naming, after: Naming) -> list[Candidate]:
    """Return the names that have gone."""
    return [c for c in before.chosen if c not in after.chosen]


def drop(several: Sequence[T], number: int) -> tuple[T, ...]:
    """Return all but one."""
    return (*several[:number], *several[number + 1 :])
