"""Try changes of a scenario one by one, and rank them by what they are worth.

Exit code 0: ranked; 1: some runs failed, or the scenario as it is does not finish; 2: bad input; 130:
stopped by Ctrl-C; 143: by SIGTERM.
"""

from __future__ import annotations

import argparse
import json
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import yaml

from automaton.commands.arguments import (
    Output,
    add_output_arguments,
    add_refinement_arguments,
    add_scenario_arguments,
    add_timeout_argument,
    add_workers_argument,
    note,
    output_of,
    print_warnings,
    settings_of,
    whole,
)
from automaton.commands.sweep_command import duration, progress
from automaton.commands.what_if_command import (
    MAX_PAIRS,
    asked_metrics,
    folder_of,
    levels_of,
    study_keys,
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
from automaton.runs.cores import cores
from automaton.scenario.document import Document, Override
from automaton.studies import bottlenecks as search
from automaton.studies.reports.comparison_tables import difference_cells, p_text, relative_text
from automaton.studies.reports.first_page import direction_of
from automaton.studies.reports.study_results import (
    Results,
    described,
    read_results,
    units_of_points,
)
from automaton.studies.sweeps import pools, sweep_plan, sweep_session
from automaton.studies.sweeps.named_changes import BASE_NAMES, NamedChange, read_changes
from automaton.studies.sweeps.run_keys import replication_seeds, seed_of
from automaton.studies.sweeps.study import checked_study
from automaton.units import count
from automaton.world.resolve import Resolved, resolve

SCREENING, CONFIRMATION = "screening", "confirmation"  # folders of results
MARKED: Final = 9  # changes that the picture of the floor shows
LARGEST: Final = (120, 60)  # columns and rows of a floor that is drawn


class Asked(NamedTuple):
    """What is compared, and by which runs."""

    metric: str
    is_higher_better: bool
    base_name: str
    keys: dict[str, Any]  # of both studies, without their points, runs and seeds


class Findings(NamedTuple):
    """The changes of a scenario and the results of their runs."""

    resolved: Resolved
    asked: Asked
    changes: search.CandidateList
    lost: dict[int, float]  # ticks lost near each change that has a place, by its number from 1
    screened: Results
    outcomes: list[search.ScreenedChange]
    confirmed: Results
    chosen: list[int]  # numbers of the confirmed changes
    ranked: search.Ranking

    @property
    def has_base(self) -> bool:
        """Whether enough runs of the unchanged scenario finished."""
        return self.screened.counts(self.screened.points[0]).finished >= 2

    def change(self, one: search.RankedChange | search.ScreenedChange) -> search.CandidateChange:
        """The change of a point of the confirmation."""
        return self.changes.tried[self.chosen[one.number - 1] - 1]

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
    text = "try at most N changes, those near much lost time first (default: 150)"
    add("--most", type=whole("a number of changes", 1, 10_000), default=150, metavar="N", help=text)
    add(
        "--pairs",
        type=pairs_of,
        default=(20, 100),
        metavar="N,M",
        help="screen each change with N pairs of runs, and confirm the best with M further pairs "
        "(default: 20,100)",
    )
    text = "rank by this metric (default: throughput; makespan, if runs end by themselves)"
    add("--metric", metavar="NAME", help=text)
    better = parser.add_mutually_exclusive_group()
    for name, word in (("--minimise", "low"), ("--maximise", "high")):
        text = f"{word} values of the metric are better (default: as usual for the metric)"
        better.add_argument(name, action="store_true", help=text)
    add_workers_argument(parser, 1024)
    text = "keep the results in this folder; the same command then does only the missing runs"
    add("--out", type=Path, metavar="DIR", help=text)
    add(
        "--recompute",
        action="store_true",
        help="with --out, ignore results of other code or of other changes in the folder",
    )
    text = "list the changes, and estimate the time from a few pilot runs"
    add("--dry-run", action="store_true", help=text)
    add_timeout_argument(parser)
    add_output_arguments(parser, "--report")


def run(args: argparse.Namespace) -> int:
    """Screen, confirm, rank, print."""
    output = output_of(args, "--report")
    settings = settings_of(args)
    resolved = resolve(args.scenario, settings, args.seed)
    print_warnings(resolved.unrefined)
    own = read_changes(args.changes) if args.changes else ()
    asked = asked_of(args, resolved, settings, own)
    seeds = replication_seeds(resolved.scenario.seed, 0, search.LOOKED_AT)
    lost = search.lost_ticks(resolved, seeds)
    changes = search.candidates_of(args.scenario, settings, own, args.only, args.most, lost)
    if not changes.tried:
        raise InputError(nothing_to_try(args, changes), args.scenario)
    if args.dry_run:
        return dry_run(args, output, asked, changes)
    with folder_of(args.out) as folder:
        failed, findings = searched(args, folder, resolved.unrefined, asked, changes, lost)
    output.write(lambda: document_of(findings, args), lambda: as_json(findings, args, failed))
    if failed:
        note(f"{count(failed, 'run')} failed; the report says of which changes")
    return 1 if failed or not findings.has_base else 0


def searched(
    args: argparse.Namespace,
    folder: Path,
    resolved: Resolved,
    asked: Asked,
    changes: search.CandidateList,
    lost: Any,
) -> tuple[int, Findings]:
    """Screen and confirm; the number of failed runs and the results."""
    failed, screened = compared(args, asked, folder / SCREENING, changes.tried, args.pairs[0])
    outcomes = search.screened(screened, asked.metric, asked.is_higher_better)
    chosen, confirmed, ranked = search.finalists(outcomes), screened, search.Ranking((), ())
    if chosen:
        best = [changes.tried[number - 1] for number in chosen]
        more, confirmed = compared(args, asked, folder / CONFIRMATION, best, args.pairs[1])
        failed, ranked = (
            failed + more,
            search.ranking(confirmed, asked.metric, asked.is_higher_better),
        )
    near = {
        number: search.lost_near(resolved.floor_plan, lost, one.cells)
        for number, one in enumerate(changes.tried, 1)
        if one.cells
    }
    return failed, Findings(
        resolved, asked, changes, near, screened, outcomes, confirmed, chosen, ranked
    )


def asked_of(
    args: argparse.Namespace,
    resolved: Resolved,
    settings: Sequence[str | Override],
    own: Sequence[NamedChange],
) -> Asked:
    """What the arguments ask. Raises InputError."""
    stop = resolved.scenario.stop
    ends = stop.when != "never" and not resolved.scenario.ends_at_limit
    metric = args.metric or ("makespan" if ends else "throughput")
    names = [one.name for one in own]
    unchanged = (one.name for one in own if not one.settings)
    free = next(name for name in BASE_NAMES if name not in names)
    keys = study_keys(args.scenario, "bottlenecks", resolved.scenario, levels_of(settings))
    keys["analysis"] = {"metrics": [metric]}
    asked = Asked(metric, True, next(unchanged, free), keys)
    document = study_of(asked, (), 2)
    names_counted = sweep_plan.counted_by((resolved,))
    sweep_plan.check_metrics(document, checked_study(document), (resolved,), names_counted)
    better = direction_of(metric)
    if better is None and not (args.minimise or args.maximise):
        text = "high and low values may both be good: add --minimise or --maximise"
        raise InputError(text, f"--metric {metric}")
    is_higher_better = args.maximise or (better == "highest" and not args.minimise)
    return asked._replace(is_higher_better=is_higher_better)


def study_of(asked: Asked, changes: Sequence[search.CandidateChange], pairs: int) -> Document:
    """The study of some changes, each with the same seeds as the unchanged scenario."""
    points = [{"name": asked.base_name}, *({"name": c.name, "set": c.settings} for c in changes)]
    data = {**asked.keys, "replications": pairs, "points": points}
    return Document(data, overrides=tuple(asked_metrics([asked.metric])))


def compared(
    args: argparse.Namespace,
    asked: Asked,
    folder: Path,
    changes: Sequence[search.CandidateChange],
    pairs: int,
) -> tuple[int, Results]:
    """The runs of some changes in a folder: the number of failed ones, and their results."""
    study = study_of(asked, changes, pairs)
    is_second = folder.name == CONFIRMATION
    if is_second:  # fresh seeds
        study.data["seed"] = seed_of(f"{study.data['seed']} {CONFIRMATION}")
    plan = sweep_plan.make_sweep_plan(study)
    with progress(args.out) as listener:
        swept = sweep_session.sweep_into(
            folder,
            plan,
            lambda: pools.LocalPool(args.workers),
            args.recompute or is_second,  # other changes may be the best after more screening
            listener.begin,
            listener.rows,
            copies=sweep_plan.copies_of(study, plan),
            patience=args.strategy_timeout,
        )
    units = units_of_points(plan.scenarios, len(plan.points))
    return swept.failed, replace(read_results(swept.store), units=units)


def dry_run(
    args: argparse.Namespace, output: Output, asked: Asked, changes: search.CandidateList
) -> int:
    """Print the changes and the time that their runs will take."""
    plan = sweep_plan.make_sweep_plan(study_of(asked, changes.tried, args.pairs[0]))
    folder, workers = args.out and args.out / SCREENING, args.workers or cores()
    known = sweep_session.forecast(plan, folder, workers, pools.LocalPool(1), False, args.recompute)
    least, most = (
        min(len(changes.tried), many) + 1 for many in (search.FINALISTS, search.MAX_FINALISTS)
    )
    runs = plan.runs + most * args.pairs[1]
    seconds = known.start_s + (runs - known.done) * known.run_s / workers
    lines = [
        f"screening: {count(len(plan.points), 'scenario')} x {args.pairs[0]:,} = {plan.runs:,} runs"
        + (f", of which {known.done:,} are done" if known.done else ""),
        f"confirmation: {least:,} to {most:,} scenarios x {args.pairs[1]:,} runs",
        f"time: at most {duration(seconds)} with {count(workers, 'worker')} "
        f"({1e3 * known.run_s:,.0f} ms a run, by {count(known.pilots, 'pilot run')})",
    ]
    document = ReportDocument(asked.keys["name"], [Listed(lines, mark="")])
    document.add(*settings_blocks(changes.tried), *omitted(changes))
    data = {"scenario": args.scenario, "runs": runs, "wall_s": seconds}
    data["changes"] = [dict(candidate_record(one)) for one in changes.tried]
    output.write(lambda: document, lambda: data | refusals(changes))
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
    asked, changes = findings.asked, findings.changes
    document = ReportDocument(asked.keys["name"], [Heading(asked.keys["name"], 1)])
    direction = "raises" if asked.is_higher_better else "lowers"
    screening, confirmation = args.pairs
    document.add(
        Heading("Question"),
        Text(
            f"Which single change {direction} {asked.metric} most? "
            f"{count(len(changes.tried), 'change')} tried with {screening:,} pairs of runs each; "
            f"the best {len(findings.chosen):,} confirmed with {confirmation:,} further pairs."
        ),
        Heading("Answer"),
        Listed(list(answer(findings)), strong=True),
    )
    if findings.ranked.changes:
        document.add(ranking_table(findings), Listed(list(reading(findings)), mark=""))
        document.add(*picture(findings))
        best = [findings.change(one) for one in findings.ranked.changes]
        document.add(Heading("Settings"), *settings_blocks(best))
    document.add(*rest(findings), *omitted(changes))
    if args.out is not None:
        command = f"automaton report {shlex.quote(str(args.out / CONFIRMATION))}"
        document.add(Text(f"All runs are in {args.out}; `{command}` shows further tables."))
    return document


def answer(findings: Findings) -> Iterator[str]:
    """The first changes in a sentence."""
    metric, base = findings.asked.metric, findings.screened.points[0]
    if not findings.has_base:
        done = findings.screened.counts(base)
        yield (
            f"No answer: {done.finished:,} of {count(done.planned, 'run')} of the scenario as it is "
            "finished. Find out why with `automaton run`."
        )
        return
    better = [one for one in findings.ranked.changes if one.is_effect and one.is_better]
    if not better:
        yield f"No change has a statistically significant effect that makes {metric} better."
        if metric == "throughput":
            yield "If demand limits the throughput, rank by a time, such as --metric lead_time."
        return
    first, *others = better
    share = first.effect.relative
    text = "" if share is None else f": {metric} {100 * share.value:+.1f} %"
    yield f"'{findings.change(first).name}' has the largest effect{text}."
    alike = [findings.change(one).name for one in others if one.as_good_as_first]
    if alike and first is findings.ranked.changes[0]:
        yield f"As good, as far as these runs show: {'; '.join(alike)}."


def ranking_table(findings: Findings) -> Table:
    """A line for each confirmed change."""
    results, rows = findings.confirmed, []
    scale, planned = results.scale(findings.asked.metric), results.study.max_replications
    for place, one in enumerate(findings.ranked.changes, 1):
        number = findings.chosen[one.number - 1]
        near, lost = ["-", "-"], findings.lost.get(number)
        if lost is not None:
            near = [NumberText(f"{lost:,.0f}", lost), str(findings.lost_rank(number))]
        value, low, high = difference_cells(one.effect.difference, scale)
        effect = f"{value} {scale.unit} ({low} to {high})"
        if one.effect.relative is not None:
            effect = relative_text(one.effect.relative)
        sign = " =" if one.is_effect and one.is_better and one.as_good_as_first else ""
        pairs = f" ({one.pairs:,} pairs)" if one.pairs < planned else ""
        name = findings.change(one).name + pairs
        rows.append([f"{place}{sign}", name, effect, p_text(one.adjusted), *near])
    return Table(["", "change", "effect, 95 %", "p", "lost near", "rank"], rows, left=2)


def reading(findings: Findings) -> Iterator[str]:
    """How to read the table."""
    metric, ranked = findings.asked.metric, findings.ranked.changes
    yield (
        f"{metric}: {described(metric)[1]}. The {count(len(ranked), 'interval')} and p values hold "
        "simultaneously (Bonferroni, Holm): p < 0.05 is significant."
    )
    if any(one.is_effect and one.is_better and one.as_good_as_first for one in ranked):
        yield "=: the difference to the first is not significant."
    if findings.lost:
        yield (
            f"lost near: robot ticks that a run of the unchanged scenario loses within {search.NEAR} "
            f"cells; rank: among {count(len(findings.lost), 'change')} with a place."
        )


def picture(findings: Findings) -> Iterator[Block]:
    """The floor with the places of the first changes that are better; nothing if none has a place."""
    floor_plan = findings.resolved.floor_plan
    best = [one for one in findings.ranked.changes[:MARKED] if one.is_effect and one.is_better]
    places = [findings.change(one).cells for one in best]
    if not any(places) or floor_plan.width > LARGEST[0] or floor_plan.height > LARGEST[1]:
        return
    rows = [list(row) for row in floor_picture(floor_plan).split("\n")]
    margin = len(rows[0]) - floor_plan.width  # of parking bays
    styles = [["" for _ in row] for row in rows]
    for place, cells in reversed(list(enumerate(places, 1))):
        for x, y in map(floor_plan.xy, cells):
            rows[y][x + margin], styles[y][x + margin] = str(place), "bold"
    yield Text("The places of the first changes, by rank:")
    yield CharacterPicture([
        list(zip(*row, strict=True)) for row in zip(rows, styles, strict=True)
    ])  # fmt: skip


def settings_blocks(changes: Sequence[search.CandidateChange]) -> Iterator[Block]:
    """The settings of changes, to be pasted."""
    lines = [f"{number}. {c.name}\n   {pasted(c)}" for number, c in enumerate(changes, 1)]
    yield Text("\n".join(lines), code=True)


def pasted(change: search.CandidateChange) -> str:
    """The settings of a change as arguments of a command line."""
    return " ".join(f"--set {shlex.quote(f'{k}={in_yaml(v)}')}" for k, v in change.settings.items())


def in_yaml(value: Any) -> str:
    """A value in one line of YAML."""
    plain = json.loads(json.dumps(value))  # without aliases
    text = yaml.safe_dump(plain, default_flow_style=True, width=float("inf"), sort_keys=False)
    return text.removesuffix("...\n").strip()


def rest(findings: Findings) -> Iterator[Block]:
    """The tried changes without a rank, by the reason."""
    tried, base = findings.changes.tried, findings.screened.points[0]
    rows = []
    confirmed = {findings.chosen[one.number - 1]: one for one in findings.ranked.others}
    for one in sorted(findings.outcomes, key=lambda one: one.status):
        if one.number in findings.chosen and one.number not in confirmed:
            continue
        results = findings.confirmed if one.number in confirmed else findings.screened
        outcome = confirmed.get(one.number, one)
        point, text = results.points[outcome.number], outcome.status
        if outcome.status == search.JAMS:
            jams, planned = search.jammed_runs(results, point), results.counts(point).planned
            text += f" in {jams:,} of {count(planned, 'run')}"
            text += f" (as it is: {search.jammed_runs(results, results.points[0])})"
        effect = "-"
        if outcome.status == search.SCREENED:
            pairs = search.paired(results, point, base, findings.asked.metric, 0.95)
            effect = relative_text(pairs.relative).partition(" (")[0]
            text = "not among the best"
        rows.append([tried[one.number - 1].name, text, effect])
    if rows:
        yield Heading("Not ranked")
        yield Table(["change", "why", "relative, screening"], rows, left=2)


def omitted(changes: search.CandidateList) -> Iterator[Block]:
    """The changes that were not tried."""
    if changes.refused:
        yield Heading("Not possible")
        yield Listed([f"{change.name}: {reason}" for change, reason in changes.refused])
    if changes.left_out:
        yield Text(f"{count(changes.left_out, 'further change')} not tried (--most).")


# The same as data.


def as_json(findings: Findings, args: argparse.Namespace, failed: int) -> dict[str, Any]:
    """The results as one object, in the units of the runs."""
    asked = findings.asked
    ranks = {
        findings.chosen[one.number - 1]: (k, one)
        for k, one in enumerate(findings.ranked.changes, 1)
    }
    statuses = {findings.chosen[one.number - 1]: one.status for one in findings.ranked.others}
    records = []
    for outcome in findings.outcomes:
        number, candidate = outcome.number, findings.changes.tried[outcome.number - 1]
        record = {**candidate_record(candidate), "status": statuses.get(number, outcome.status)}
        rank, one = ranks.get(number, (None, None))
        if one is not None:
            record["status"] = search.CONFIRMED
            record |= {"difference": interval(one.effect.difference), "p": one.adjusted}
            record |= {"relative": interval(one.effect.relative), "pairs": one.pairs}
            record |= {"is_effect": one.is_effect, "as_good_as_first": one.as_good_as_first}
        near = findings.lost.get(number)
        record |= {"rank": rank, "lost_near": near}
        record["lost_near_rank"] = None if near is None else findings.lost_rank(number)
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
        **refusals(findings.changes),
        "failed": failed,
    }


def candidate_record(candidate: search.CandidateChange) -> dict[str, Any]:
    """A change as data."""
    return {"name": candidate.name, "kind": candidate.kind, "set": candidate.settings}


def refusals(changes: search.CandidateList) -> dict[str, Any]:
    """The changes that were not tried, as data."""
    refused = [{"name": change.name, "reason": reason} for change, reason in changes.refused]
    return {"refused": refused, "not_tried": changes.left_out}


def interval(one: Any) -> dict[str, Any] | None:
    """An interval as data."""
    return one and {"value": one.value, "low": one.low, "high": one.high}
