"""Try changes of a scenario one by one, and rank them by what they are worth.

Exit code 0: ranked; 1: some runs failed, or the scenario as it is does not finish; 2: bad input; 130:
stopped by Ctrl-C; 143: by SIGTERM. The results so far are printed before.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from automaton.commands.arguments import (
    Output,
    add_refinement_arguments,
    add_scenario_arguments,
    note,
    output_of,
    print_warnings,
    settings_of,
    whole,
)
from automaton.commands.sweep_command import duration, forecast_of, require_results
from automaton.commands.what_if_command import (
    MAX_PAIRS,
    SweptRuns,
    add_run_arguments,
    folder_of,
    levels_of,
    study_keys,
    swept_into,
)
from automaton.documents.report_document import (
    Block,
    CharacterPicture,
    Heading,
    Listed,
    NumberText,
    ReportDocument,
    Table,
    Text,
)
from automaton.errors import InputError, nearest
from automaton.floor.drawn_floors import floor_picture
from automaton.studies import bottlenecks as search
from automaton.studies.reports.comparison_tables import effect_text, p_text, relative_text
from automaton.studies.reports.comparisons import direction_of
from automaton.studies.reports.study_results import (
    Results,
    described,
    read_results,
    units_of_points,
)
from automaton.studies.sweeps.named_changes import BASE_NAMES, read_changes
from automaton.studies.sweeps.run_keys import fingerprint, replication_seeds, seed_of
from automaton.studies.sweeps.study import Analysis, Study
from automaton.studies.sweeps.sweep_plan import make_sweep_plan, resolve_changes
from automaton.units import count
from automaton.world.resolve import Resolved, resolve

SCREENING, CONFIRMATION = "screening", "confirmation"  # folders of results
LOOKED_AT: Final = 5  # runs of the scenario as it is in which lost time is located
LISTED: Final = 3  # changes that are impossible for the same reason
MARKED: Final = 9  # changes that the picture of the floor shows
LARGEST_DRAWN: Final = (120, 60)  # columns and rows of a floor that is drawn


class MetricQuestion(NamedTuple):
    """What is compared."""

    metric: str
    is_higher_better: bool
    base_name: str
    keys: dict[str, Any]  # of both studies, without their points and numbers of runs


class Findings(NamedTuple):
    """The changes of a scenario and the results of their runs."""

    resolved: Resolved  # unrefined
    asked: MetricQuestion
    changes: search.CandidateList
    lost: dict[int, float]  # ticks lost near each change that has a place, by its number from 1
    screened: Results
    outcomes: dict[int, search.ScreenedChange]  # by number of the change
    chosen: list[int]  # numbers of the confirmed changes
    confirmed: Results
    ranked: list[search.RankedChange]
    failed: int  # runs
    cut: SweptRuns | None  # the runs that were interrupted; None: all are done

    @property
    def has_base(self) -> bool:
        """Whether enough runs of the scenario as it is finished."""
        return self.screened.counts(self.screened.points[0]).finished >= 2

    def number(self, one: search.RankedChange) -> int:
        """The number of a ranked change."""
        return self.chosen[one.number - 1]

    def change(self, one: search.RankedChange) -> search.CandidateChange:
        """The change of a rank."""
        return self.changes.tried[self.number(one) - 1]

    def lost_rank(self, number: int) -> int:
        """The rank of a change by the ticks lost near it."""
        return 1 + sum(ticks > self.lost[number] for ticks in self.lost.values())


def kinds_of(text: str) -> tuple[str, ...]:
    """The type of an argument that lists kinds of changes."""
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in search.KINDS:
            hint = nearest(name, search.KINDS)
            known = ", ".join(search.KINDS)
            raise argparse.ArgumentTypeError(f"unknown kind '{name}'{hint}; there are {known}")
    return tuple(names)


def pairs_of(text: str) -> tuple[int, int]:
    """The type of an argument with the pairs of the screening and of the confirmation."""
    read = whole("a number of pairs", 2, MAX_PAIRS)
    numbers = [read(part.strip()) for part in text.split(",")]
    if len(numbers) != 2:
        raise argparse.ArgumentTypeError(f"'{text}' is not two numbers of pairs such as 20,100")
    return numbers[0], numbers[1]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton bottlenecks`."""
    add_scenario_arguments(parser)
    add_refinement_arguments(parser)
    add = parser.add_argument
    kinds = ", ".join(search.KINDS)
    text = f"try only these kinds of changes, such as station,energy (default: {kinds})"
    add("--only", type=kinds_of, default=search.KINDS, metavar="KINDS", help=text)
    text = "also try the changes in a YAML file, each as {name: NAME, set: {KEY: VALUE, ...}}"
    add("--changes", type=Path, metavar="FILE", help=text)
    text = "try at most N changes, beginning where most time is lost (default: 150)"
    add("--most", type=whole("a number of changes", 1, 10_000), default=150, metavar="N", help=text)
    add(
        "--pairs",
        type=pairs_of,
        default=(20, 100),
        metavar="N,M",
        help="screen each change with N pairs of runs, and confirm the best changes with M more "
        "pairs (default: 20,100)",
    )
    text = "rank by this metric (default: throughput; makespan, if runs end by themselves)"
    add("--metric", metavar="NAME", help=text)
    better = parser.add_mutually_exclusive_group()
    for name, word in (("--minimise", "low"), ("--maximise", "high")):
        text = f"{word} values of the metric are better (default: as usual for the metric)"
        better.add_argument(name, action="store_true", help=text)
    text = "list the changes, and estimate the time from a few pilot runs"
    add("--dry-run", action="store_true", help=text)
    add_run_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Screen, confirm, rank, print."""
    output = output_of(args, "--report")
    settings = settings_of(args)
    require_results()
    resolved = resolve(args.scenario, settings, args.seed)
    base = resolved.unrefined
    print_warnings(base)
    own = list(own_changes(args, settings))
    unchanged = [one.name for one in own if not one.settings]
    free = (name for name in BASE_NAMES if name not in {one.name for one in own})
    base_name = [*unchanged, *free, BASE_NAMES[-1]][0]
    asked = asked_of(args, base, base_name, levels_of(settings))
    from automaton.studies.reports.site_pages import lost_and_visits  # needs Numba

    lost, flow = lost_and_visits(resolved, replication_seeds(base.scenario.seed, 0, LOOKED_AT))
    changes = search.candidates_of(
        base,
        lambda texts: resolve(args.scenario, (*settings, *texts)).unrefined,
        [one for one in own if one.settings],
        args.only,
        args.most,
        lost,
        flow,
    )
    if not changes.tried:
        raise InputError(nothing_to_try(args, changes), args.scenario)
    if args.dry_run:
        return dry_run(args, output, asked, changes)
    near = {
        number: search.lost_near(base, lost, one.cells)
        for number, one in enumerate(changes.tried, 1)
        if one.cells
    }
    with folder_of(args.out) as folder:
        findings = searched(args, folder, base, asked, changes, near)
    output.write(lambda: document_of(findings, args), lambda: as_json(findings, args))
    if findings.failed:
        note(f"{count(findings.failed, 'run')} failed; the report says why")
    if findings.cut is not None and findings.cut.cut is not None:
        raise findings.cut.cut
    return 1 if findings.failed or not findings.has_base else 0


def own_changes(
    args: argparse.Namespace, settings: Sequence[Any]
) -> Iterator[search.CandidateChange]:
    """The changes in the file of --changes. Raises InputError with its line."""
    if args.changes is None:
        return
    own, first = read_changes(args.changes), dict[str, str]()
    for one, resolved in zip(own, resolve_changes(args.scenario, settings, own), strict=True):
        earlier = first.setdefault(fingerprint(resolved), one.name)
        if earlier != one.name:
            raise InputError(f"'{earlier}' and '{one.name}' are the same scenario", *one.place)
        yield search.CandidateChange(search.OWN, one.name, one.settings or {})


def asked_of(
    args: argparse.Namespace, base: Resolved, base_name: str, settings: dict[str, Any]
) -> MetricQuestion:
    """The question of the arguments. Raises InputError for a metric that cannot be used."""
    ends = base.scenario.stop.when != "never" and not base.scenario.ends_at_limit
    metric = args.metric or ("makespan" if ends else "throughput")
    keys = study_keys(args.scenario, "bottlenecks", base.scenario, settings)
    better = direction_of(metric)
    is_higher_better = args.maximise or (better == "highest" and not args.minimise)
    asked = MetricQuestion(metric, is_higher_better, base_name, keys)
    try:
        make_sweep_plan(study_of(asked, (), 2))
        if better is None and not (args.minimise or args.maximise):
            raise InputError("neither direction is better: add --minimise or --maximise")
    except InputError as error:
        raise error.at(f"--metric {metric}") from None
    return asked


def study_of(asked: MetricQuestion, changes: Sequence[search.CandidateChange], pairs: int) -> Study:
    """The study of some changes, each with the same seeds as the scenario as it is."""
    points: list[dict[str, Any]] = [{"name": asked.base_name}]
    points += [{"name": change.name, "set": change.settings} for change in changes]
    keys = {("settings" if key == "set" else key): value for key, value in asked.keys.items()}
    analysis = Analysis(metrics=(asked.metric,))
    return Study(**keys, listed=tuple(points), replications=pairs, analysis=analysis)


def searched(
    args: argparse.Namespace,
    folder: Path,
    base: Resolved,
    asked: MetricQuestion,
    changes: search.CandidateList,
    near: dict[int, float],
) -> Findings:
    """Screen all changes, and confirm the best with fresh seeds."""
    swept, screened = compared(args, asked, folder / SCREENING, changes.tried, args.pairs[0])
    failed = swept.failed
    outcomes = search.screened(screened, asked.metric, asked.is_higher_better)
    chosen, confirmed, ranked = search.finalists(outcomes), screened, []
    by_number = {one.number: one for one in outcomes}
    if swept.cut is not None:
        chosen = []
    if chosen:
        seed = seed_of(f"{asked.keys['seed']} {CONFIRMATION}")
        fresh = asked._replace(keys=asked.keys | {"seed": seed})
        best = [changes.tried[number - 1] for number in chosen]
        swept, confirmed = compared(args, fresh, folder / CONFIRMATION, best, args.pairs[1])
        failed += swept.failed
        ranked = search.ranking(confirmed, asked.metric, asked.is_higher_better)
        for number, status in search.statuses(confirmed, asked.metric).items():
            by_number[chosen[number - 1]] = search.ScreenedChange(number, status)
    cut = swept if swept.cut is not None else None
    return Findings(
        base, asked, changes, near, screened, by_number, chosen, confirmed, ranked, failed, cut
    )


def compared(
    args: argparse.Namespace,
    asked: MetricQuestion,
    folder: Path,
    changes: Sequence[search.CandidateChange],
    pairs: int,
) -> tuple[SweptRuns, Results]:
    """The runs of some changes in a folder, and their results."""
    study = study_of(asked, changes, pairs)
    plan = make_sweep_plan(study)
    # After more screening, other changes may be the best.
    recompute = args.recompute or folder.name == CONFIRMATION
    swept = swept_into(args, folder, plan, recompute)
    units = units_of_points(plan.scenarios, len(plan.points))
    return swept, replace(read_results(swept.store), units=units)


def dry_run(
    args: argparse.Namespace, output: Output, asked: MetricQuestion, changes: search.CandidateList
) -> int:
    """Print the changes and the time that their runs will take."""
    plan = make_sweep_plan(study_of(asked, changes.tried, args.pairs[0]))
    known = forecast_of(args, plan, args.out and args.out / SCREENING)
    tried = len(changes.tried)
    least, most = (min(tried, many) + 1 for many in (search.FINALISTS, search.MAX_FINALISTS))
    runs = plan.runs + most * args.pairs[1]
    seconds = known.start_s + (runs - known.done) * known.run_s / known.workers
    lines = [
        f"screening: {count(len(plan.points), 'scenario')} x {args.pairs[0]:,} = {plan.runs:,} runs"
        + (f", of which {known.done:,} are done" if known.done else ""),
        f"confirmation: {least:,} to {most:,} scenarios x {args.pairs[1]:,} runs",
        f"time: at most {duration(seconds)} with {count(known.workers, 'worker')} "
        f"({1e3 * known.run_s:,.0f} ms a run, by {count(known.pilots, 'pilot run')})",
    ]
    document = ReportDocument(asked.keys["name"], [Listed(lines, mark="")])
    document.add(settings_text(changes.tried), *omitted(changes))
    data = {"scenario": args.scenario, "runs": runs, "wall_s": seconds}
    records = [candidate_record(one) for one in changes.tried]
    output.write(lambda: document, lambda: data | {"changes": records} | omissions(changes))
    return 0


def nothing_to_try(args: argparse.Namespace, changes: search.CandidateList) -> str:
    """Why no change is left to try."""
    kinds = " or ".join(args.only)
    if not changes.refused:
        text = f"no change is left to try: the scenario has none of the kind {kinds}"
        return f"{text}; list changes of your own with --changes FILE"
    change, reason = changes.refused[0]
    return f"no change of the kind {kinds} can be tried; {change.name}: {reason}"


# The report.


def document_of(findings: Findings, args: argparse.Namespace) -> ReportDocument:
    """Question, answer, ranking, picture, settings, and the changes that are not ranked."""
    asked, ranked = findings.asked, findings.ranked
    document = ReportDocument(asked.keys["name"], [Heading(asked.keys["name"], 1)])
    direction, (screening, confirmation) = (
        ("raises" if asked.is_higher_better else "lowers"),
        args.pairs,
    )
    question = (
        f"Which single change {direction} {asked.metric} most? "
        f"{count(len(findings.changes.tried), 'change')} tried with {screening:,} pairs of runs each; "
        f"the best {len(findings.chosen):,} confirmed with {confirmation:,} further pairs."
    )
    document.add(Heading("Question"), Text(question), Heading("Answer"))
    if findings.cut is not None:
        phase = CONFIRMATION if findings.chosen else SCREENING
        document.add(Text(f"{findings.cut.cut_text} They are those of the {phase}.", strong=True))
    document.add(Listed(list(answer(findings)), strong=True))
    if ranked:
        document.add(ranking_table(findings), Listed(list(reading(findings)), mark=""))
        document.add(*picture(findings), Heading("Settings"))
        document.add(settings_text([findings.change(one) for one in ranked]))
    document.add(*not_ranked(findings), *omitted(findings.changes))
    if args.out is not None:
        command = f"automaton report {shlex.quote(str(args.out / CONFIRMATION))}"
        document.add(Text(f"All runs are in {args.out}; `{command}` shows further tables."))
    return document


def answer(findings: Findings) -> Iterator[str]:
    """The best change in a sentence, with those that are as good."""
    metric = findings.asked.metric
    better = [one for one in findings.ranked if one.helps]
    if not findings.has_base:
        done = findings.screened.counts(findings.screened.points[0])
        yield (
            f"No answer: {done.finished:,} of {count(done.planned, 'run')} of the scenario as it is "
            f"finished{failures(findings.screened, 0)}."
        )
    elif findings.cut is not None and not findings.chosen:
        yield "No change is confirmed yet: the table shows the effects in the screening."
    elif not better:
        yield f"No change has a statistically significant effect that makes {metric} better."
        if metric == "throughput":
            yield "If demand limits the throughput, rank by a time, such as --metric lead_time."
    else:
        share = better[0].effect.relative
        text = "" if share is None else f": {metric} {100 * share.value:+.1f} %"
        yield f"'{findings.change(better[0]).name}' has the largest effect{text}."
        if better[0].pairs < (runs := findings.confirmed.study.max_replications):
            yield (
                f"This leaves out {count(runs - better[0].pairs, 'pair')} with a run that failed or did "
                "not finish, which favours the change."
            )
        alike = [findings.change(one).name for one in better if one.equals_first]
        if alike and better[0] is findings.ranked[0]:
            yield f"As good, as far as these runs show: {'; '.join(alike)}."


def ranking_table(findings: Findings) -> Table:
    """A line for each confirmed change."""
    results, rows = findings.confirmed, []
    scale, planned = results.scale(findings.asked.metric), results.study.max_replications
    for place, one in enumerate(findings.ranked, 1):
        near, number = ["-", "-"], findings.number(one)
        if number in findings.lost:
            lost = findings.lost[number]
            near = [NumberText(f"{lost:,.0f}", lost), str(findings.lost_rank(number))]
        sign = " =" if one.helps and one.equals_first else ""
        pairs = f" ({one.pairs:,} pairs)" if one.pairs < planned else ""
        name = findings.change(one).name + pairs
        if search.jammed_runs(results, one.number) > search.jammed_runs(results, 0):
            name += f": {search.jam_text(results, one.number)}"
        effect = effect_text(one.effect, scale)
        rows.append([f"{place}{sign}", name, effect, p_text(one.adjusted), *near])
    return Table(["", "change", "effect, 95 %", "p", "lost near", "rank"], rows, left=2)


def reading(findings: Findings) -> Iterator[str]:
    """How to read the table."""
    metric, ranked = findings.asked.metric, findings.ranked
    yield (
        f"{metric}: {described(metric)[1]}. The {count(len(ranked), 'interval')} and p values hold "
        "simultaneously (Bonferroni): p < 0.05 is significant."
    )
    if any(one.helps and one.equals_first for one in ranked):
        yield "=: the difference to the first is not significant."
    if findings.lost:
        yield (
            f"lost near: robot ticks that a run of the scenario as it is loses within {search.NEAR} "
            f"cells; rank: among {count(len(findings.lost), 'change')} with a place."
        )


def picture(findings: Findings) -> Iterator[Block]:
    """The floor with the places of the first changes that help; nothing if none has a place."""
    floor_plan = findings.resolved.floor_plan
    places = [findings.change(one).cells for one in findings.ranked[:MARKED] if one.helps]
    size = floor_plan.width, floor_plan.height
    if not any(places) or size[0] > LARGEST_DRAWN[0] or size[1] > LARGEST_DRAWN[1]:
        return
    rows = [[(sign, "") for sign in row] for row in floor_picture(floor_plan).split("\n")]
    margin = len(rows[0]) - floor_plan.width  # of parking bays
    for place, cells in reversed(list(enumerate(places, 1))):
        for x, y in map(floor_plan.xy, cells):
            rows[y][x + margin] = str(place), "bold"
    yield Text("The places of the first changes, by rank:")
    yield CharacterPicture(rows)


def settings_text(changes: Sequence[search.CandidateChange]) -> Text:
    """The settings of changes, as arguments of a command line."""
    lines = []
    for number, change in enumerate(changes, 1):
        pasted = " ".join(f"--set {shlex.quote(text)}" for text in change.texts)
        lines += [f"{number}. {change.name}", f"   {pasted}"]
    return Text("\n".join(lines), code=True)


def not_ranked(findings: Findings) -> Iterator[Block]:
    """The tried changes without a rank, each with the reason."""
    ranked, rows = {findings.number(one) for one in findings.ranked}, []
    for number, outcome in findings.outcomes.items():
        if number in ranked:
            continue
        results = findings.confirmed if number in findings.chosen else findings.screened
        reason, effect = outcome.status, "-"
        if reason == search.JAMS:
            reason = search.jam_text(results, outcome.number) + failures(results, outcome.number)
        elif reason == search.SCREENED:
            is_cut = findings.cut is not None and not findings.chosen
            reason = "not confirmed yet" if is_cut else "not among the best"
            one = search.paired(results, number, 0, findings.asked.metric, search.SCREENING_LEVEL)
            effect = relative_text(one.relative).partition(" (")[0]
        rows.append([findings.changes.tried[number - 1].name, reason, effect])
    if rows:
        yield Heading("Not ranked")
        yield Table(
            ["change", "why", "effect, screening"], sorted(rows, key=lambda row: row[1]), left=2
        )


def failures(results: Results, number: int) -> str:
    """The number of failed runs of a point and the first reason; "" if none failed."""
    rows = zip(results.columns["point"], results.columns["error"], strict=True)
    errors = [error for point, error in rows if point == number and error is not None]
    return f"; {count(len(errors), 'run')} failed: {errors[0]}" if errors else ""


def omitted(changes: search.CandidateList) -> Iterator[Block]:
    """The changes that were not tried."""
    if changes.refused:
        yield Heading("Not possible")
        by_reason: dict[str, list[str]] = {}
        for change, reason in changes.refused:
            by_reason.setdefault(reason, []).append(change.name)
        yield Listed([f"{named(names)}: {reason}" for reason, names in by_reason.items()])
    if changes.left_out:
        yield Text(f"{count(changes.left_out, 'further change')} not tried (--most).")


def named(names: Sequence[str]) -> str:
    """Some changes: "row 1: open both ways; row 2: open both ways; 8 further changes"."""
    further = [count(len(names) - LISTED, "further change")] if len(names) > LISTED + 1 else []
    return "; ".join([*names[: LISTED if further else None], *further])


# The same as data.


def as_json(findings: Findings, args: argparse.Namespace) -> dict[str, Any]:
    """The results as one object, in the units of the runs."""
    asked = findings.asked
    ranks = {findings.number(one): (rank, one) for rank, one in enumerate(findings.ranked, 1)}
    records = []
    for number, outcome in findings.outcomes.items():
        record = candidate_record(findings.changes.tried[number - 1]) | {"status": outcome.status}
        rank, one = ranks.get(number, (None, None))
        if one is not None:
            record |= {"status": search.CONFIRMED, "p": one.adjusted, "pairs": one.pairs}
            record |= {"is_effect": one.is_effect, "as_good_as_first": one.equals_first}
            for name in ("difference", "relative"):
                interval = getattr(one.effect, name)
                ends = interval and {
                    end: getattr(interval, end) for end in ("value", "low", "high")
                }
                record[name] = ends
        record |= {"rank": rank, "lost_near": findings.lost.get(number), "lost_near_rank": None}
        if number in findings.lost:
            record["lost_near_rank"] = findings.lost_rank(number)
        records.append(record)
    return {
        "scenario": args.scenario,
        "metric": asked.metric,
        "better": "highest" if asked.is_higher_better else "lowest",
        "seed": asked.keys["seed"],
        "set": asked.keys.get("set", {}),
        "pairs": list(args.pairs),
        "out": None if args.out is None else str(args.out),
        "changes": records,
        **omissions(findings.changes),
        "complete": findings.cut is None,
        "failed": findings.failed,
    }


def candidate_record(candidate: search.CandidateChange) -> dict[str, Any]:
    """A change as data."""
    return {"name": candidate.name, "kind": candidate.kind, "set": candidate.settings}


def omissions(changes: search.CandidateList) -> dict[str, Any]:
    """The changes that were not tried, as data."""
    refused = [{"name": change.name, "reason": reason} for change, reason in changes.refused]
    return {"refused": refused, "not_tried": changes.left_out}
