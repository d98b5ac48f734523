"""Search for what is missing: forward choice, backward elimination, a held-out decision."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from sklearn_pgnn.diagnosis.judge import Judge, Rules, n_parameters
from sklearn_pgnn.diagnosis.pairs import foretell_pairs
from sklearn_pgnn.estimation.equivalence import are_equivalent
from sklearn_pgnn.estimation.fitting import HypothesisFitter, Key, SubsampleFit, Trial, objective_of
from sklearn_pgnn.estimation.hypothesis import Cause, count_parameters, resemble, same_causes
from sklearn_pgnn.estimation.progress import TimeIsUp
from sklearn_pgnn.physics.effects import WrongParameter

#: pairs of suspects that are looked at on top of a hypothesis, the most promising first
PAIRS = 6
#: suspects that are judged on held-out windows, the best first, before a search ends
JUDGED = 3
#: what two causes explain alone may differ by such a share, if they are to be the same: not every
#: first look is followed to its end
ALIKE = 0.1


@dataclass
class Outcome:
    """What a search found.

    Parameters
    ----------
    base : Trial
        The re-tuned prior.
    steps : list of Trial
        The final hypothesis, cause by cause in their order of importance.
    alternatives : dict
        For every cause, the causes that would do as well in its place.
    noise : ndarray of shape (n_outputs,)
        Noise left by the best fit, in units of the problem's noise.
    tried : dict
        Every cause tried alone, and the error power it leaves relative to the base.
    complete : bool, default=True
        Whether the search came to its end.
    """

    base: Trial
    steps: list[Trial]
    alternatives: dict[Cause, tuple[Cause, ...]]
    noise: np.ndarray
    tried: dict[Cause, float] = field(default_factory=dict)
    complete: bool = True

    @property
    def final(self) -> Trial:
        """The hypothesis that was accepted."""
        return self.steps[-1] if self.steps else self.base


class Search:
    """Search the causes of a model's error.

    Parameters
    ----------
    fitter : HypothesisFitter
        Fits hypotheses.
    suspects : tuple of (effect class, target)
        The causes to think of.
    rules : Rules
        When a difference counts.
    is_beyond : callable, optional
        Asked ``is_beyond(search, trial)`` where causes leave something; the search ends where the
        answer is yes.
    shown : frozenset of (effect class, target), default=frozenset()
        Causes that the records show by themselves.

    Attributes
    ----------
    current : Trial
        The best hypothesis so far.
    """

    current: Trial

    def __init__(
        self,
        fitter: HypothesisFitter,
        suspects: tuple[Cause, ...],
        rules: Rules,
        is_beyond: Callable[["Search", Trial], bool] | None = None,
        shown: frozenset[Cause] = frozenset(),
    ):
        self.is_beyond = is_beyond
        self.fitter = fitter
        self.same = same_causes(fitter.problem.prior, suspects)
        self.suspects = tuple(self.same)
        self.judge = Judge(fitter, rules, shown)
        self.progress = fitter.progress
        self._tried: dict[Cause, float] = {}
        self._grounds: dict[Key, tuple[SubsampleFit, list[SubsampleFit]]] = {}

    def run(self) -> Outcome:
        """Find what is missing, or as much of it as the time allows.

        Returns
        -------
        Outcome
            The accepted hypothesis and all that was weighed against it.
        """
        base = self.fitter.base()
        self.judge.learn_noise(base)
        self.current = base
        self.progress.counts = True
        with suppress(TimeIsUp):
            self._go_forward()
            self._mend()
            return self._outcome(self._alternatives)
        return self.so_far()

    def so_far(self) -> Outcome:
        """Return the best hypothesis so far, compared with what was looked at already.

        Returns
        -------
        Outcome
            The outcome of a search that did not come to its end.
        """
        return replace(self._outcome(self._seen_as_good), complete=False)

    def _outcome(self, alternatives: Callable[[Trial, Cause], tuple[Cause, ...]]) -> Outcome:
        base, final, found = self.fitter.base(), self.current, {}
        causes = final.hypothesis.causes
        self.progress.begin("order of causes", len(causes))
        steps = self._in_order(base, final)
        self.progress.begin("alternatives", len(causes))
        for cause in causes:
            found[cause] = alternatives(final, cause)
            self.progress.step()
        return Outcome(base, steps, found, self.judge.noise(final), self._of_all(self._tried))

    def _go_forward(self) -> None:
        """Add causes while they help, and drop those that become needless."""
        base = self.current
        while len(self.current.hypothesis.causes) < self.judge.rules.max_causes:
            if (
                self.judge.is_at_noise(self.current)
                or self.fitter.key(self.current.hypothesis) in self._grounds
            ):
                break
            if self.current is not base and self.is_beyond and self.is_beyond(self, self.current):
                break
            best = self._next(self.current)
            if best is None:
                break
            self.current = best
            self.progress.begin("needless causes", len(best.hypothesis.causes))
            self.current = self._eliminate(best)

    def _next(self, current: Trial) -> Trial | None:
        """Return a hypothesis with one cause more, or with several that the records show."""
        scouted = self._scout(current)
        self.progress.begin(f"{_next_cause(current)}, held out", JUDGED)
        best = self._shown(current) or self._decide(current, scouted)
        return best or self._look_back(current)

    def _mend(self) -> None:
        """Replace causes, split them and fit them to their end."""
        self.progress.begin("replacing causes")
        self.current = self._swap(self.current)
        self.progress.begin("splitting causes")
        self.current = self._split(self.current)
        self.progress.begin("last fit")
        self.current = self._confirmed(self.current)

    def _confirmed(self, trial: Trial) -> Trial:
        """Fit the causes to their end, and judge once more the one that stands alone."""
        trial, base = self.fitter.polish(trial), self.fitter.polish(self.fitter.base())
        alone = len(trial.hypothesis.causes) == 1
        return base if alone and not self.judge.is_gain(base, trial) else trial

    def _of_all(self, tried: dict[Cause, float]) -> dict[Cause, float]:
        """Say of causes that are the same as others what was found of these."""
        return {cause: left for c, left in tried.items() for cause in (c, *self.same[c])}

    # -- forward -------------------------------------------------------------------------------

    def _scout(self, current: Trial) -> list[SubsampleFit]:
        """SubsampleFit every suspect on top of the current hypothesis, the best to their end."""
        left = [c for c in self.suspects if current.hypothesis.allows(c)]
        self.progress.begin(_next_cause(current), 2 * len(left))
        ground, looks, alone = self.fitter.sketch(current), [], not current.hypothesis.causes
        for cause in left:
            looks.append(self.fitter.look(ground, cause))
            if alone:
                self._tried |= _shares_left(ground, looks[-1:])
            self.progress.step()
        scouted = self._settle(ground, looks)
        self._grounds[self.fitter.key(current.hypothesis)] = ground, scouted
        if alone:
            self._tried = _shares_left(ground, scouted)
        return scouted

    def _settle(self, ground: SubsampleFit, looks: list[SubsampleFit]) -> list[SubsampleFit]:
        """Follow looks, the best first, until they cannot explain half of what the best does."""
        best, found = ground.fit.objective, []
        for place, look in enumerate(sorted(looks, key=objective_of)):
            half = np.inf if place < JUDGED else (ground.fit.objective + best) / 2
            found.append(self.fitter.settle(look, prune_above=half))
            best = min(best, found[-1].fit.objective)
            self.progress.step()
        return _usable(found)

    def _shown(self, current: Trial) -> Trial | None:
        """Add the causes that the records show by themselves, to a hypothesis without causes."""
        trial = current
        for cause in self.suspects if not current.hypothesis.causes else ():
            if cause in self.judge.shown:
                look = self.fitter.look(self.fitter.sketch(trial), cause)
                further = self._complete(self.fitter.settle(look), trial)
                trial = further if further.fit.usable else trial
        return trial if trial is not current else None

    def _decide(self, current: Trial, scouted: list[SubsampleFit]) -> Trial | None:
        """Give the best suspect that proves itself on unseen windows, or says the same simpler."""
        ground = self.fitter.sketch(current)
        left = [
            s
            for s in scouted
            if self.judge.may_gain(ground, s) or self.judge.may_simplify(ground, s)
        ]
        for _ in range(min(JUDGED, len(left))):
            contenders = self._contenders(left)
            trials = _usable([self._complete(sketch, current) for sketch in contenders])
            self.progress.step()
            if not trials:
                left = [sketch for sketch in left if sketch not in contenders]
                continue
            best = self._simplest_of_the_best(trials)
            current = self.fitter.retry(current, best)
            if self.judge.is_simpler(current, best) or self.judge.is_gain(current, best):
                return best
            left = [sketch for sketch in left if sketch.hypothesis != best.hypothesis]
        return None

    # -- pairs ---------------------------------------------------------------------------------

    def _look_back(self, current: Trial) -> Trial | None:
        """Look again where no suspect helps: to the end, at pairs, and at earlier hypotheses."""
        self.progress.begin("second look", sum(len(alone) for _, alone in self._grounds.values()))
        for key, (ground, alone) in self._grounds.items():
            self._grounds[key] = ground, self._settle_all(alone)
        _, alone = self._grounds[self.fitter.key(current.hypothesis)]
        best = self._decide(current, alone)
        if best is None:
            self.progress.begin("pairs", 2 * PAIRS * len(self._grounds))
            best = self._decide(current, self._pairs())
        return best

    def _settle_all(
        self, looks: list[SubsampleFit], prune_above: float = np.inf
    ) -> list[SubsampleFit]:
        """Follow looks to their end, or until it is clear that they stay prune_above."""
        found = []
        for look in looks:
            found.append(self.fitter.settle(look, prune_above))
            self.progress.step()
        return _usable(found)

    def _look_at(self, pairs: list[tuple[SubsampleFit, Cause]]) -> list[SubsampleFit]:
        """Take a first look at one cause more on top of each sketch."""
        looks = []
        for sketch, cause in pairs:
            looks.append(self.fitter.look(sketch, cause))
            self.progress.step()
        return looks

    def _pairs(self) -> list[SubsampleFit]:
        """SubsampleFit the pairs that promise most on top of what was scouted, the best first."""
        found = []
        for ground, alone in self._grounds.values():
            room = len(ground.hypothesis.causes) <= self.judge.rules.max_causes - 2
            if room and ground.fit.usable:
                tick = self.progress.tick
                ranked = foretell_pairs(ground, alone, self.fitter.rough.windows, tick)
                first = {sketch.hypothesis.causes[-1]: sketch for sketch in alone}
                allowed = [(a, b) for _, a, b in ranked if first[a].hypothesis.allows(b)]
                pairs = [self._ordered(first, a, b) for a, b in allowed[:PAIRS]]
                found += self._settle(ground, self._look_at(pairs))
        return sorted(found, key=objective_of)

    @staticmethod
    def _ordered(first, a: Cause, b: Cause) -> tuple[SubsampleFit, Cause]:
        """Give the better of two causes as fitted, and the other."""
        return (first[a], b) if first[a].squares <= first[b].squares else (first[b], a)

    def _contenders(self, scouted: list[SubsampleFit]) -> list[SubsampleFit]:
        """Give the suspects that all samples may show to be as good as the first."""
        return [s for s in scouted if s is scouted[0] or not self.judge.is_beaten(s, scouted[0])]

    def _complete(self, sketch: SubsampleFit, beside: Trial) -> Trial:
        trial = self.fitter.complete(sketch, beside)
        if trial.fit.usable:
            self.judge.learn_noise(trial)
        return trial

    def _simplest_of_the_best(self, trials: list[Trial]) -> Trial:
        """Give the trial with the fewest parameters among those as good as the best."""
        best = min(trials, key=lambda trial: self.judge.fair(trial).sum())
        equal = [trial for trial in trials if self.judge.as_good(best, trial)]
        return min(equal, key=lambda trial: (*self._complexity(trial), trial.squares))

    @staticmethod
    def _complexity(trial: Trial) -> tuple:
        """Fewest parameters first; at equal number a wrong number before a missing part."""
        missing = [e for e, _ in trial.hypothesis.causes if e is not WrongParameter]
        return trial.hypothesis.n_parameters, len(missing)

    # -- backward ------------------------------------------------------------------------------

    def _eliminate(self, trial: Trial) -> Trial:
        """Drop causes that are no longer needed, the least needed first."""
        while len(trial.hypothesis.causes) > 1:
            sketch = self.fitter.sketch(trial)
            reduced = [self.fitter.reduce(sketch, c) for c in trial.hypothesis.causes]
            least = self._complete(min(reduced, key=objective_of), trial)
            needed = self.judge.is_gain(least, trial)
            fewer = self._without_idle_memory(reduced, trial) if needed else least
            if fewer is None:
                return trial
            trial = fewer
        return trial

    def _without_idle_memory(self, reduced: list[SubsampleFit], trial: Trial) -> Trial | None:
        """Drop a cause with a memory that is no gain beside the others, if there is one."""
        for sketch in reduced:
            (dropped,) = set(trial.hypothesis.causes) - set(sketch.hypothesis.causes)
            if self.judge.remembers(dropped):
                without = self._complete(sketch, trial)
                if not self.judge.is_gain(without, trial):
                    return without
        return None

    def _swap(self, trial: Trial) -> Trial:
        """Put another cause in a cause's place where that is clearly better, or simpler."""
        if len(trial.hypothesis.causes) < 2:
            return trial
        for cause in self._open_to_doubt(trial):
            for sketch in self._replacements(trial, cause):
                swapped = self._complete(sketch, trial)
                if self.judge.says_it_better(trial, swapped):
                    return self._swap(self._eliminate(swapped))
        return trial

    def _open_to_doubt(self, trial: Trial) -> list[Cause]:
        """Name the causes of a hypothesis that the records do not show by themselves."""
        return [cause for cause in trial.hypothesis.causes if cause not in self.judge.shown]

    def _replacements(self, trial: Trial, cause: Cause) -> list[SubsampleFit]:
        """SubsampleFit the suspects that may stand in a cause's place, the best first."""
        sketch = self.fitter.sketch(trial)
        without = self.fitter.reduce(sketch, cause)
        needed = 0.8 * sketch.fit.objective + 0.2 * without.fit.objective
        looks = self._look_at([(without, other) for other in self._rivals(without, cause)])
        found = self._settle_all(looks, prune_above=needed)
        return [s for s in found if not self.judge.is_beaten(s, sketch)]

    def _rivals(self, without: SubsampleFit, cause: Cause) -> list[Cause]:
        """Name the suspects that explain a share of what a cause does alone, or stand with others.

        Beside others, what a suspect explains alone says little.
        """
        alone = not without.hypothesis.causes
        enough = 0.3 * (1.0 - self._tried.get(cause, 1.0)) if alone else 0.0
        return [
            other
            for other, left in self._tried.items()
            if other != cause and without.hypothesis.allows(other) and 1.0 - left >= enough
        ]

    def _split(self, trial: Trial) -> Trial:
        """Let parts of a cause stand on their own where that says the same with fewer numbers."""
        for ground in (trial, *self._equals(trial)):
            sketch = self.fitter.sketch(ground)
            aparts = [a for cause in ground.hypothesis.causes for a in self._apart(sketch, cause)]
            for apart in sorted(aparts, key=n_parameters):
                if n_parameters(apart) < n_parameters(trial):
                    split = self.fitter.complete(apart, ground)
                    if split.fit.usable and self.judge.as_good(trial, split):
                        return self._eliminate(split)
        return trial

    def _equals(self, trial: Trial) -> list[Trial]:
        """Give what is as good with another cause in one's place, if any cause has parts."""
        causes = trial.hypothesis.causes
        if len(causes) < 2 or not any(effect.generalises for effect, _ in causes):
            return []
        open_to_doubt = self._open_to_doubt(trial)
        sketches = [s for c in open_to_doubt for s in self._replacements(trial, c)]
        swapped = [self._complete(sketch, trial) for sketch in sketches]
        return [s for s in swapped if s.fit.usable and self.judge.as_good(trial, s)]

    def _apart(self, sketch: SubsampleFit, cause: Cause) -> list[SubsampleFit]:
        """SubsampleFit a cause beside a part of it, and its special cases without it."""
        effect, target = cause
        kin = [c for c in self.suspects if c[1] == target and c not in sketch.hypothesis.causes]
        found = [self.fitter.split(sketch, cause, c) for c in kin if c[0].id in effect.shared]
        special = [c for c in kin if c[0].id in effect.generalises]
        special += [c for c in self._as_parameters(cause) if c not in sketch.hypothesis.causes]
        for others in [[c] for c in special] + ([special] if len(special) > 1 else []):
            found.append(self.fitter.exchange(sketch, cause, others))
        return found

    def _as_parameters(self, cause: Cause) -> list[Cause]:
        """Name the special cases of a cause that are a wrong value of a parameter."""
        names = self.fitter.held(cause)
        return [c for c in self.suspects if c[0] is WrongParameter and c[1] in names]

    # -- result --------------------------------------------------------------------------------

    def _alternatives(self, trial: Trial, cause: Cause) -> tuple[Cause, ...]:
        """Give the causes that would explain the records as well in a cause's place."""
        without = self._complete(self.fitter.reduce(self.fitter.sketch(trial), cause), trial)
        if not self.judge.is_better(without, trial):
            return self.same[cause]
        exact, found = self._exact(without, cause), []
        for sketch in self._replacements(trial, cause):
            other = sketch.hypothesis.causes[-1]
            if other in exact or count_parameters(other) > count_parameters(cause):
                continue
            swapped = self.fitter.complete(sketch, trial)
            if swapped.fit.usable and not self.judge.is_better(swapped, trial):
                found.append((swapped.squares, other))
        others = [*exact, *(other for _, other in sorted(found, key=lambda item: item[0]))]
        others += [other for other in self._too_small(trial, cause) if other not in others]
        return (*self.same[cause], *(c for other in others for c in (other, *self.same[other])))

    def _too_small(self, trial: Trial, cause: Cause) -> list[Cause]:
        """Name the suspects that a cause may be, were they sought as small as it is."""
        problem, model = self.fitter.problem, trial.fit.model
        rest = trial.hypothesis.without(cause)
        return [o for o in self.suspects if rest.allows(o) and resemble(problem, model, cause, o)]

    def _exact(self, without: Trial, cause: Cause) -> list[Cause]:
        """Name the causes that are the same as one in the equations, beside the others.

        Alone they explain the same, too; only such causes are looked at.
        """
        model, hypothesis = without.fit.model, without.hypothesis
        return [
            other
            for other, left in self._tried.items()
            if other != cause
            and hypothesis.allows(other)
            and count_parameters(other) == count_parameters(cause) == 1
            and abs(left - self._tried.get(cause, np.inf)) <= ALIKE * (1.0 - left)
            and all(len(self.fitter.orders(hypothesis, c)) == 1 for c in (cause, other))
            and self._equivalent(model, cause, other)
        ]

    def _equivalent(self, model, cause: Cause, other: Cause) -> bool:
        self.progress.tick()
        return are_equivalent(model, cause, other, retuned=False)

    def _seen_as_good(self, trial: Trial, cause: Cause) -> tuple[Cause, ...]:
        """Name the suspects that first looks do not show to be worse in a cause's place."""
        key = self.fitter.key(trial.hypothesis.without(cause))
        looks = {s.hypothesis.causes[-1]: s for s in self._grounds.get(key, (None, ()))[1]}
        others = [
            other
            for other, look in looks.items()
            if cause in looks and other != cause and not self.judge.is_beaten(look, looks[cause])
        ]
        return (*self.same[cause], *(c for other in others for c in (other, *self.same[other])))

    def _in_order(self, base: Trial, final: Trial) -> list[Trial]:
        """Add the causes of the final hypothesis one by one, the most telling first."""
        left, steps, trial = list(final.hypothesis.causes), [], base
        while left:
            if len(left) == 1:
                causes = (*trial.hypothesis.causes, left[0])
                steps.append(Trial(replace(final.hypothesis, causes=causes), final.fit))
                break
            ready = [c for c in left if not any(part.id in c[0].shared for part, _ in left)]
            ground = self.fitter.sketch(trial)
            options = [self.fitter.settle(self.fitter.look(ground, cause)) for cause in ready]
            trial = self.fitter.complete(min(options, key=objective_of), trial)
            left.remove(trial.hypothesis.causes[-1])
            steps.append(trial)
        return steps


def _next_cause(current: Trial) -> str:
    """Name the stage in which a hypothesis is extended."""
    return f"cause {len(current.hypothesis.causes) + 1}"


def _usable(trials: list) -> list:
    """Return the trials that could be fitted, the best first."""
    return sorted((trial for trial in trials if trial.fit.usable), key=objective_of)


def _shares_left(ground: SubsampleFit, sketches: list[SubsampleFit]) -> dict[Cause, float]:
    """Return the share of the error power that every suspect leaves."""
    both = [sketch for sketch in sketches if sketch.fit.usable and ground.fit.usable]
    return {sketch.hypothesis.causes[-1]: sketch.squares / ground.squares for sketch in both}
