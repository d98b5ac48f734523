"""The steps of a diagnosis: from records to what is missing and what is left."""

import math
from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sklearn_pgnn.diagnosis.formula_selection import FormulaSelection
from sklearn_pgnn.diagnosis.search import Search
from sklearn_pgnn.diagnosis.search_result import SearchResult
from sklearn_pgnn.diagnosis.structure import Structure, find_structure
from sklearn_pgnn.diagnosis.unexplained import Proposal
from sklearn_pgnn.diagnosis.verdict import Remaining, describe_remaining, verdict_of
from sklearn_pgnn.estimation.budgets import MUCH
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.difference_fits import ONSETS
from sklearn_pgnn.estimation.fine_steps import fine_steps
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.hypothesis_models import Key
from sklearn_pgnn.estimation.problem import (
    EstimationProblem,
    build_problem,
    recut,
    with_hold,
    with_substeps,
)
from sklearn_pgnn.estimation.progress import Progress
from sklearn_pgnn.estimation.record_differences import find_group, n_groups
from sklearn_pgnn.estimation.record_groups import Group, mark
from sklearn_pgnn.estimation.stretches import is_long, on_stretches
from sklearn_pgnn.estimation.window_selection import check_prior, select_windows
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import SensorSaturation
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.record_quality.checks import clipped_outputs
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.record_quality.wiring import Rewired, find_wiring
from sklearn_pgnn.simulation.record_windows import enough_substeps, speed_in_windows
from sklearn_pgnn.simulation.substeps import Steps, given_steps
from sklearn_pgnn.simulation.window_fit import WindowFit
from sklearn_pgnn.trajectories.record import Record

#: share of the squares that explains most of them
MOST = 0.5


@dataclass(frozen=True)
class Findings:
    """The findings of a diagnosis.

    `structure` is whether what is left depends on anything recorded, None if that was not tested;
    `replaced` are the causes that the formula replaced.
    """

    search: Search
    result: SearchResult
    proposal: Proposal | None
    structure: Structure | None
    replaced: SearchResult | None = None

    @property
    def of_wiring(self) -> tuple[Finding, ...]:
        """What the records show of the wiring, unless re-tuning does as well."""
        wiring = self.search.wiring
        as_well = self.result.complete and not self.result.steps and not self.remaining.is_much
        if wiring is None or as_well:
            return ()
        return (wiring.finding(self.search.fitter.problem.prior),)

    @property
    def trials(self) -> dict[str, FittedHypothesis]:
        """The re-tuned prior, the model with the causes, and the one with the formula, if any."""
        trials = {"refitted": self.result.base, "extended": self.result.final}
        return trials if self.proposal is None else {**trials, "formula": self.proposal.trial}

    @property
    def best(self) -> FittedHypothesis:
        """The last of the trials, with all that was found."""
        return list(self.trials.values())[-1]

    @property
    def remaining(self) -> Remaining:
        """What is left of the records with the causes."""
        search = self.search
        return describe_remaining(
            search.fitter, self.result.final, self.structure, search.criterion
        )

    @property
    def verdict(self) -> str:
        """The verdict, one of the values of `verdict_of`."""
        return verdict_of(self.result, self.remaining, self.proposal is not None)


@dataclass
class Investigation:
    """Search for the causes of a model's error; the best so far is available at any time.

    The records have no gaps. For `alpha` and `smallest_share` see `SelectionCriterion`; `options`
    are those of `build_problem`, and the window length is selected unless it is given.
    """

    model: PhysicsModel
    records: tuple[Record, ...]
    candidates: tuple[Effect, ...]
    alpha: float
    smallest_share: float
    max_causes: int
    progress: Progress
    options: Mapping[str, Any]
    found: Findings | None = None
    searched: Findings | None = None
    search: Search | None = None
    whole: EstimationProblem | None = None
    wiring: Rewired | None = None
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    n_compared: int = 0
    compares_records: bool = True

    def run(self, hold: str, is_told: bool) -> Findings:
        """Search with one hold of the inputs, and with the other if the records support it."""
        self.progress.begin("wiring")
        with self.progress.kept():
            self.wiring = find_wiring(self.model, self.records, each_step=self.progress.tick)
        fitter = self._fitter(hold)
        with self.progress.kept():
            self.searched = self._at_once(fitter)
        self.searched = self.searched or self._search(fitter)
        if not is_told and self.progress.ended is None:
            with self.progress.kept():
                self.searched = self._try_slopes(self.searched)
        if self.compares_records and self.progress.ended is None:
            with self.progress.kept():
                self._try_differences(self.searched)
        with self.progress.kept():
            self.found = self._judge_on_all(self.searched)
        if self.found is not None and self.progress.ended is None:
            with self.progress.kept():
                self.found = self._in_fine_steps(self.found)
        return self.so_far()

    def so_far(self) -> Findings:
        """Return what was found, by an unfinished search if there is no finished one."""
        if self.found is None:
            if self.searched is None:
                if self.search is None:
                    raise LookupError("no search has begun")
                self.searched = Findings(self.search, self.search.so_far(), None, None)
            with self.progress.kept():
                self.found = self._judge_on_all(self.searched)
            self.found = self.found or self.searched
        return self.found

    def from_the_best(self) -> Iterator[Findings]:
        """Yield what was found, then ever less of it: without the formula, without the causes."""
        found = self.so_far()
        yield found
        causes = replace((found.replaced or found.result), complete=False)
        yield Findings(found.search, causes, None, found.structure)
        nothing = SearchResult(causes.base, [], {}, alone=causes.alone, complete=False)
        yield Findings(found.search, nothing, None, None)

    def _fitter(self, hold: str) -> HypothesisFitter:
        """Return the fitter with the user's window length, else with one selected from records."""
        self.progress.begin("reading the records")
        problem = build_problem(self.model, self.records, hold=hold, **self.options)
        records = self.records
        if is_long(problem):
            self.whole = problem
            problem, records = on_stretches(problem, records, self.options)
        self.progress.begin("window length")
        if self.wiring is not None:
            fitter = self._as_wired(self.wiring.wirings[0].apply(self.model), problem, records)
        elif self.options.get("window_length") is None:
            fitter = select_windows(problem, self.progress)
        else:
            fitter = HypothesisFitter(problem, self.progress)
        check_prior(fitter, [record.name for record in records])
        return self._in_enough_steps(fitter)

    def _as_wired(
        self, wired: PhysicsModel, problem: EstimationProblem, records: tuple[Record, ...]
    ) -> HypothesisFitter:
        """Return the fitter of the model as given, on the windows and steps that suit it wired."""
        hold = problem.windows.hold
        other = build_problem(wired, records, hold=hold, **self.options)
        if self.options.get("window_length") is None:
            other = select_windows(other, self.progress).problem
        problem = replace(problem, min_samples=other.min_samples)
        problem = recut(problem, other.scales.window) or problem
        if self._steps_are_told:
            return HypothesisFitter(problem, self.progress)
        suited = with_substeps(problem, other.windows.substeps)
        fitter = HypothesisFitter(suited, self.progress)
        if np.isfinite(fitter.base().fit.evaluation.squares).all():
            return fitter
        return HypothesisFitter(problem, self.progress)  # finite as given, if only in its own steps

    def _in_enough_steps(self, fitter: HypothesisFitter) -> HypothesisFitter:
        """Return the fitter with integration steps as the prior needs them, stable ones if told."""
        if self.wiring is not None:
            return fitter
        windows, base = fitter.problem.windows, fitter.base().fit
        method = self.model.simulation.get("method")
        fast = speed_in_windows(base.model, windows, base.evaluation)
        if self._steps_are_told:
            steps = given_steps(windows.substeps, method, fast)
        else:
            steps = enough_substeps(base.model, windows, base.x0, fast, method)
        return fitter if steps == windows.steps else self._in_steps(fitter, steps)

    def _in_steps(self, fitter: HypothesisFitter, steps: Steps) -> HypothesisFitter:
        """Return a fitter with other integration steps, its prior re-tuned with them as well."""
        problem = with_substeps(fitter.problem, steps.substeps, steps.method)
        other = HypothesisFitter(problem, self.progress)
        other.base()
        other.refit(fitter.base())
        return other

    @property
    def _steps_are_told(self) -> bool:
        """Whether the user or the model specifies the number of integration steps."""
        return bool(self.options.get("substeps") or self.model.simulation.get("substeps"))

    def _like(self, problem: EstimationProblem, whole: EstimationProblem) -> HypothesisFitter:
        """Return the fitter on all records, with the window length and step of the search."""
        if problem.windows.hold != whole.windows.hold:
            whole = with_hold(whole, problem.windows.hold)
        if not self._steps_are_told:
            thinned = max(1, round(problem.scales.sample_time / whole.scales.sample_time))
            whole = with_substeps(whole, math.ceil(problem.windows.substeps / thinned))
        whole = with_substeps(whole, whole.windows.substeps, problem.windows.method)
        whole = replace(whole, min_samples=problem.min_samples)
        whole = recut(whole, problem.scales.window) or whole
        fitter = HypothesisFitter(whole, self.progress)
        check_prior(fitter, [record.name for record in self.records])
        return fitter

    def _search(self, fitter: HypothesisFitter, begin: FittedHypothesis | None = None) -> Findings:
        """Search the catalogue, and search a formula for what it does not explain."""
        given = frozenset(map(SensorSaturation, clipped_outputs(fitter.problem)))
        count = max(len(self.candidates), self.n_compared)
        criterion = SelectionCriterion(self.alpha, self.smallest_share, count)
        asked = _Structures(fitter, criterion)
        self.progress.begin("candidates")
        formulas = FormulaSelection()
        self.search = search = Search(
            fitter,
            _distinct(self.candidates, fitter.problem),
            criterion,
            self.max_causes,
            asked.has_structure,
            formulas.is_law,
            given,
            self.wiring,
        )
        searched = search.run(begin)
        result, proposal, structure = searched, None, None
        if self.progress.ended is None:
            result = replace(searched, complete=False)  # unless a formula can be looked for
            with self.progress.kept():
                left = search.compare.leaves_what_may_depend(searched.final)
                structure = asked.of(searched.final) if left else None
                has_structure = structure is not None and structure.is_significant
                result, proposal = formulas.choose(search, searched, has_structure)
                structure = asked.of(result.final) if left or proposal else None
        replaced = searched if len(result.steps) < len(searched.steps) else None
        return Findings(search, result, proposal, structure, replaced)

    def _judge_on_all(self, found: Findings) -> Findings:
        """Judge on all records what was found on stretches of them."""
        if self.whole is None:
            return found
        self.progress.counts = False  # a result there must be
        search, proposal, structure = found.search, None, None
        fitter = self._like(search.fitter.problem, self.whole)
        asked = _Structures(fitter, search.criterion)
        result = judged = search.judge_on(found.result, fitter, asked.has_structure)
        if self.progress.ended is None:
            result = replace(judged, complete=False)
            with self.progress.kept():
                if found.proposal is not None:
                    proposal = FormulaSelection.on_other_records(
                        search, judged.final, found.proposal
                    )
                if proposal is None and found.replaced is not None:
                    causes = replace(found, result=found.replaced, proposal=None, replaced=None)
                    return self._judge_on_all(causes)
                if search.compare.leaves_what_may_depend(judged.final) or proposal:
                    structure = asked.of(judged.final)
                result = judged
        return Findings(search, result, proposal, structure)

    def _in_fine_steps(self, found: Findings) -> Findings:
        """Fit the causes with integration steps so fine that no parameter depends on them.

        Told steps are kept, unless the fit has made the model too fast for them. If there are no
        causes, or none remains with finer steps, search again with finer steps. A model that runs
        away from the records does so in finer steps, too.
        """
        fitter, result = found.search.fitter, found.result
        is_dear = self.whole is not None and not result.steps
        is_lost = found.search.compare.runs_away(result.final)
        if is_dear or is_lost or found.proposal is not None:
            return found
        self.progress.begin("integration steps")
        steps = fine_steps(fitter, result.final, is_told=self._steps_are_told)
        if steps == fitter.problem.windows.steps:
            return found
        finer = self._in_steps(fitter, steps)
        if result.steps:
            refined = self._refined(found, finer)
            if refined.result.steps:
                return refined
            found = _provisional(found)  # its causes do not stand in finer steps
        again = self._search(finer)
        return again if again.result.complete else found

    def _refined(self, found: Findings, finer: HypothesisFitter) -> Findings:
        """Fit the causes with finer integration steps; test what is left if some are dropped."""
        search = copy(found.search)  # the one that found them stands if the time is up
        result = search.in_steps_of(finer, found.result)
        structure, before = found.structure, found.result.final.hypothesis
        if len(result.steps) < len(before.causes):
            asked = _Structures(finer, search.criterion)
            may_depend = search.compare.leaves_what_may_depend(result.final)
            structure = asked.of(result.final) if may_depend else None
        return replace(found, search=search, result=result, structure=structure)

    def _at_once(self, fitter: HypothesisFitter) -> Findings | None:
        """Search at first with what differs between records, if with it only noise is left.

        That is tried of whole records that explain most, and of what alone leaves about noise.
        """
        base = fitter.base()
        left, much = fitter.held_out(base).windows.squares, MUCH**2 * fitter.white_squares(base)
        if not self.compares_records or (left <= much).all():
            return None
        group = find_group(fitter.problem, base.fit, self.progress.tick)
        if group is None:
            return None
        if group.until is not None and self._is_early(group):
            return None  # it may be a drift, which has no onset
        is_most = group.since is None and group.share >= MOST
        usual = (group.left + group.share) * left  # with another value everywhere
        if not is_most and ((group.left * left > much).any() or (usual <= much).all()):
            return None
        self.progress.begin("differences between records")
        for each in self._or_whole(group):
            wider = self._beside(each, fitter.problem)
            try:
                found = wider._search(wider._fitter(fitter.problem.windows.hold))
            except KeyboardInterrupt:
                vars(self).update(vars(wider))  # what it holds is the best so far
                raise
            is_all = not found.search.compare.leaves_what_may_depend(found.result.final)
            if self._lacks(wider, found) and (is_all or self.progress.ended):
                vars(self).update(vars(wider))
                return found
        return None

    def _try_differences(self, found: Findings) -> None:
        """Search again with what may differ between records, where that explains what is left.

        The other candidates are tried anew beside it: what was named may have stood for it. Of a
        small residual that depends on nothing recorded, a difference must leave only noise.
        """
        compare, best = found.search.compare, found.best
        if not compare.leaves_what_may_depend(best):
            return
        structure = found.structure if found.proposal is None else None
        has_structure = structure is not None and structure.is_significant
        is_clear = has_structure or compare.leaves_much(best)
        self.progress.begin("differences between records")
        problem = found.search.fitter.problem
        of_groups = [(g, each) for g in _groups_that_differ(found) for each in self._or_whole(g)]
        for group, each in of_groups:
            wider = self._beside(each, problem)
            if wider.groups.keys() == self.groups.keys():
                continue  # what differs there was tried
            again = wider._search(wider._fitter(problem.windows.hold))
            is_all = not again.search.compare.leaves_what_may_depend(again.result.final)
            is_named = again.result.complete and self._lacks(wider, again)
            if is_named and (is_all or (is_clear and each is group)):
                vars(self).update(vars(wider), searched=again)
                return self._try_differences(again)

    def _is_early(self, group: Group) -> bool:
        """Return whether a group has an onset, so early that its whole records may differ."""
        of = [self.records[r].t for r in group.records]
        since = np.inf if group.since is None else group.since
        return all(since - t[0] < (t[-1] - t[0]) / ONSETS for t in of)

    def _or_whole(self, group: Group) -> list[Group]:
        """Return a group, after its whole records, if not all, where it begins early."""
        if len(group.records) == len(self.records) or not self._is_early(group):
            return [group]
        return [group._replace(since=None, until=None), group]

    def _lacks(self, wider: "Investigation", found: Findings) -> bool:
        """Return whether something is named that only a wider investigation considers."""
        new = set(wider.candidates) - set(self.candidates)
        return bool(new & set(found.result.final.hypothesis.causes))

    def _beside(self, group: Group, problem: EstimationProblem) -> "Investigation":
        """Return the investigation with what may differ in a group among the candidates."""
        marked = mark(self.model, self.records, group)
        names = tuple(self.records[r].name for r in group.records)
        return replace(
            self,
            model=marked.model,
            records=marked.records,
            candidates=(*marked.candidates, *self.candidates),
            groups={**self.groups, marked.column: names},
            n_compared=self.n_compared + len(marked.candidates) * n_groups(problem),
        )

    def _try_slopes(self, held: Findings) -> Findings:
        """Continue with inputs interpolated between samples if the records refute that less."""
        fitter, final = held.search.fitter, held.result.final
        has_structure = held.structure is not None and held.structure.is_significant
        if not (held.result.steps or has_structure):
            return held
        self.progress.begin("inputs between samples")
        sloped = HypothesisFitter(with_hold(fitter.problem, "foh"), self.progress)
        criterion, before = held.search.criterion, fitter.held_out(final)
        of_one = replace(criterion, n_candidates=1)  # there is no other way to run
        refitted = sloped.refit(final)
        if not of_one.names(before, sloped.held_out(refitted)):
            return held
        again = self._search(sloped, refitted)
        if not again.result.complete:
            return _provisional(held)
        better = criterion.evidence(before, sloped.held_out(again.result.final)) > 0.0
        return again if better else held


def _groups_that_differ(found: Findings) -> list[Group]:
    """Return where a difference explains most beside the causes, and instead of them."""
    problem, final, base = (
        found.search.fitter.problem,
        found.result.final.fit,
        found.result.base.fit,
    )
    fits = (final,) if final is base else (final, base)
    tick = found.search.progress.tick
    groups = [group for fit in fits if (group := find_group(problem, fit, tick))]
    if not groups or groups[0].share < found.search.criterion.smallest_share:
        return []
    return list({group[:3]: group for group in groups}.values())


def _provisional(found: Findings) -> Findings:
    """Return what was found by a hold or by steps that are refuted, for want of another end."""
    return replace(found, result=replace(found.result, complete=False))


def _distinct(candidates: tuple[Effect, ...], problem: EstimationProblem) -> tuple[Effect, ...]:
    """Drop the candidates that these records do not show, or that equal their special cases."""
    all_named, scales = {(cause.id, cause.target) for cause in candidates}, problem.scales

    def is_needed(cause: Effect) -> bool:
        special = {(case, cause.target) for case in cause.generalises}
        is_distinct = cause.is_distinct(scales) or not special & all_named
        return is_distinct and cause.is_shown(problem.prior, scales)

    return tuple(cause for cause in candidates if is_needed(cause))


class _Structures:
    """Whether fitted hypotheses leave structure, each tested once."""

    def __init__(self, fitter: HypothesisFitter, criterion: SelectionCriterion):
        self.fitter, self.criterion = fitter, criterion
        self._known: dict[Key, tuple[WindowFit, Structure]] = {}

    def has_structure(self, trial: FittedHypothesis) -> bool:
        """Return whether the residuals of a hypothesis depend on anything recorded."""
        return self.of(trial).is_significant

    def of(self, trial: FittedHypothesis) -> Structure:
        """Return the structure that a hypothesis leaves."""
        key = self.fitter.key(trial.hypothesis)
        if key not in self._known or self._known[key][0] is not trial.fit:
            self.fitter.progress.begin("structure of what is left")
            rule = self.criterion
            found = find_structure(
                self.fitter.problem,
                trial,
                rule.alpha,
                rule.smallest_share,
                self.fitter.progress.tick,
            )
            self._known[key] = trial.fit, found
        return self._known[key][1]
