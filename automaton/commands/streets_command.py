"""Search weights of streets that raise the throughput of a scenario, and test them with fresh seeds.

Exit code 0: the streets are better; 1: no gain that holds; 2: bad input; 130: stopped by Ctrl-C; 143: by
SIGTERM. The same command resumes a search that was stopped.
"""

from __future__ import annotations

import argparse
import math
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from automaton.commands.arguments import (
    HTML,
    TEXT,
    Output,
    add_json_argument,
    add_scenario_arguments,
    add_timeout_argument,
    add_workers_argument,
    note,
    print_document,
    print_json,
    print_warnings,
    settings_of,
    whole,
)
from automaton.commands.sweep_command import crew_of, duration, forecast_of, progress
from automaton.commands.what_if_command import levels_of, study_keys
from automaton.documents.report_document import (
    Block,
    Curves,
    Heading,
    Listed,
    ReportCurve,
    ReportDocument,
    Table,
    Text,
)
from automaton.errors import InputError
from automaton.scenario.document import Document, Override
from automaton.studies.reports.comparisons import direction_of
from automaton.studies.reports.study_results import described
from automaton.studies.street_search import evolution, verdict
from automaton.studies.street_search.candidates import CandidateLog
from automaton.studies.street_search.designs import StreetDesign, stretches
from automaton.studies.street_search.evolution import SearchQuestion
from automaton.studies.street_search.finishing import (
    DesignContext,
    FinishedDesign,
    finished,
    most_runs,
)
from automaton.studies.street_search.street_output import (
    STREETS_FILE,
    scenario_path,
    write_scenario,
    write_streets,
)
from automaton.studies.street_search.street_report import blocks_of, in_percent, reason_record
from automaton.studies.sweeps.sweep_plan import SweepPlan, make_sweep_plan
from automaton.units import count
from automaton.world.resolve import Resolved, resolve

REPORT_FILES = (("report.txt", TEXT), ("report.html", HTML))
MAX_RUNS = 10_000_000
NO_STREETS = Override("streets=null", ("streets",), None)


class Asked(NamedTuple):
    """The scenario and what is asked about it."""

    question: SearchQuestion
    resolved: Resolved  # as it is, in its own ticks
    base: Callable[[int | None], Resolved]  # it with all weights 1, with a number of robots
    drawn: Resolved  # without streets
    as_it_is: StreetDesign
    plan: SweepPlan  # of the scenario as it is


class StreetResult(NamedTuple):
    """The results of a search."""

    search: evolution.SearchResult
    choice: verdict.ChosenDesign
    fleets: list[verdict.FleetVerdict]  # () if the scenario as it is was chosen
    refused: list[str]  # fleets that the scenario cannot have, with the reason
    failed: int  # runs
    finished: FinishedDesign | None  # None if the scenario as it is was chosen

    @property
    def chosen(self) -> evolution.NamedDesign:
        """The design that was chosen."""
        return self.search.finalists[self.choice.place]

    @property
    def total(self) -> float | None:
        """What the design gains with the fleet of the search, in shares of the metric."""
        own = [one.gain for one in self.fleets if one.is_asked]
        share = own[0].relative if len(own) == 1 and own[0] is not None else None
        return None if share is None else share.value

    def holds(self, question: SearchQuestion) -> bool:
        """Whether the design is better with each fleet for which it was searched."""
        own = [one for one in self.fleets if one.is_asked]
        return bool(own) and all(one.is_gain(question.is_higher_better) for one in own)


def fleets_type(text: str) -> tuple[int, ...]:
    """The type of an argument that lists numbers of robots."""
    read = whole("a number of robots", 2, 1_000_000)
    return tuple(dict.fromkeys(read(part.strip()) for part in text.split(",")))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton streets`."""
    add_scenario_arguments(parser)
    add = parser.add_argument
    text = "write streets.csv, the scenario with them, the report and all runs into this folder"
    add("--out", type=Path, metavar="DIR", required=True, help=text)
    text = "search with N runs (default: 5000); choice, reasons and test come on top"
    add("--runs", type=whole("a number of runs", 1, MAX_RUNS), default=5000, metavar="N", help=text)
    add(
        "--detail",
        choices=evolution.DETAILS,
        default=evolution.STRETCHES,
        help="weights for whole rows and columns, or after them for each stretch between obstacles "
        "(default: stretches)",
    )
    text = "make this metric better (default: throughput; makespan, if runs end by themselves)"
    add("--metric", metavar="NAME", help=text)
    better = parser.add_mutually_exclusive_group()
    for name, word in (("--minimise", "low"), ("--maximise", "high")):
        text = f"{word} values of the metric are better (default: as usual for the metric)"
        better.add_argument(name, action="store_true", help=text)
    text = "search for the mean of these numbers of robots, such as 300,400"
    add("--robots", type=fleets_type, metavar="N,M", help=text)
    add_workers_argument(parser, 1024)
    text = "run on a Dask cluster: an address, such as tcp://host:8786, or the scheduler file"
    add("--scheduler", metavar="ADDRESS", help=text)
    text = "close moves against streets where all ways remain and little is lost"
    add("--one-way", action="store_true", help=text)
    add("--dry-run", action="store_true", help="estimate the time from a pilot run")
    text = "search again where the folder has results of other code or another search"
    add("--recompute", action="store_true", help=text)
    add_timeout_argument(parser)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Search, choose, test, write."""
    if args.workers is not None and args.scheduler is not None:
        raise InputError("--workers sets local processes; leave it out with --scheduler")
    evolution.optimizer_type()
    args.refine = args.decide = None
    asked = asked_of(args)
    if args.dry_run:
        return dry_run(args, asked)
    if args.out.exists() and not args.out.is_dir():
        raise InputError("is not a folder", str(args.out))
    result = searched(args, asked)
    if result.finished is not None:
        floor_plan, design = asked.base(None).floor_plan, result.finished.design
        rules = write_streets(args.out, asked.drawn.floor_plan, floor_plan, design)
        same = [rule_of(asked.resolved)]  # the default may be another one with closed moves
        same += [] if args.seed is None else [Override("--seed", ("seed",), args.seed)]
        write_scenario(path_of(args, asked), args.scenario, (*settings_of(args), *same), rules)
    document = document_of(result, asked, args)
    for name, form in REPORT_FILES:
        Output(form, args.out / name).write(lambda: document, dict)
    if args.json:
        print_json(as_json(result, asked, args))
    else:
        print_document(document)
    if result.failed:
        note(f"{count(result.failed, 'run')} failed; the column error of the rows says why")
    return 0 if result.holds(asked.question) else 1


def asked_of(args: argparse.Namespace) -> Asked:
    """The question of the arguments. Raises InputError."""
    settings = settings_of(args)
    resolved = resolve(args.scenario, settings, args.seed).unrefined
    if not args.robots and resolved.scenario.fleet.robots < 2:
        raise InputError("streets need at least two robots, which get out of each other's way",
                         args.scenario)  # fmt: skip
    same_rule = rule_of(resolved)

    def changed(*more: Override) -> Resolved:
        return resolve(args.scenario, (*settings, same_rule, *more), args.seed).unrefined

    @cache
    def base(robots: int | None) -> Resolved:
        more = (
            [] if robots is None else [Override(f"--robots {robots}", ("fleet", "robots"), robots)]
        )
        return without_weights(changed(*more))

    own, guided = resolved.own_streets, resolved
    if own is None or isinstance(own, tuple):  # they may have no weights
        crossing = {"preset": "crisscross", "then": msgspec.to_builtins(own or ())}
        guided = changed(Override("streets", ("streets",), crossing))
    print_warnings(guided)
    drawn = changed(NO_STREETS) if own else resolved
    question, plan = question_of(args, resolved)
    stages_of(question)  # refuses too few runs
    for robots in question.robots:
        base(robots)
    return Asked(question, resolved, base, drawn, evolution.design_of(resolved.floor_plan), plan)


def rule_of(resolved: Resolved) -> Override:
    """The setting of the right of way of a scenario."""
    keys = ("strategy", "right_of_way")
    return Override("right of way", keys, resolved.scenario.strategy.right_of_way)


def without_weights(resolved: Resolved) -> Resolved:
    """A scenario without the weights of its streets; closed and open moves and capacities stay."""
    scenario = msgspec.structs.replace(resolved.scenario, streets=None)
    return replace(resolved, scenario=scenario, floor_plan=resolved.floor_plan.without_weights())


def question_of(args: argparse.Namespace, resolved: Resolved) -> tuple[SearchQuestion, SweepPlan]:
    """The question, and the plan of the scenario as it is. Raises InputError for an unfit metric."""
    scenario = resolved.scenario
    ends = scenario.stop.when != "never" and not scenario.ends_at_limit
    metric = args.metric or ("makespan" if ends else "throughput")
    better = direction_of(metric)
    keys = study_keys(args.scenario, "streets", scenario, levels_of(settings_of(args)))
    keys |= {"points": [{"name": evolution.UNCHANGED}], "replications": 1}
    keys |= {"analysis": {"metrics": [metric]}}
    try:
        plan = make_sweep_plan(Document(keys))
        if better is None and not (args.minimise or args.maximise):
            raise InputError("neither direction is better: add --minimise or --maximise")
    except InputError as error:
        raise error.at(f"--metric {metric}") from None
    is_higher_better = args.maximise or (better == "highest" and not args.minimise)
    robots = args.robots or (None,)
    question = SearchQuestion(
        metric, is_higher_better, robots, scenario.seed, args.runs, args.detail
    )
    return question, plan


def stages_of(question: SearchQuestion) -> list[tuple[str, int, int]]:
    """Name, generations and population of each stage."""
    first, later = question.generations
    stages = [(evolution.ROWS, first, evolution.FIRST_POPULATION)]
    return stages + ([(evolution.STRETCHES, later, evolution.POPULATION)] if later else [])


def finalist_number(question: SearchQuestion) -> int:
    """The number of finalists."""
    lasts = {end for end in np.cumsum([number for _, number, _ in stages_of(question)]).tolist()}
    every = range(evolution.FINALIST_EVERY, max(lasts) + 1, evolution.FINALIST_EVERY)
    return len(evolution.start_phases()) + len(lasts | set(every))


def planned_runs(args: argparse.Namespace, asked: Asked) -> dict[str, int]:
    """The runs of search, choice, reasons (at most) and test."""
    question, fleets = asked.question, len(asked.question.robots)
    starts = evolution.START_RUNS * len(evolution.start_phases())
    generations = sum(number * population for _, number, population in stages_of(question))
    streets = len(stretches(asked.base(None).floor_plan))
    pairs = question.scaled(verdict.HELD_OUT_PAIRS)
    return {
        "search": fleets * (starts + generations),
        "choice": fleets * verdict.choice_runs(question, finalist_number(question)),
        "reasons": fleets * most_runs(streets, args.one_way, question.scaled),
        "test": 2 * pairs * (len(verdict.FLEET_SHARES) - 1 + fleets),
    }


def planned_text(planned: Mapping[str, int]) -> str:
    """Such as "at most 4,000 runs: search 3,000, choice 200, reasons 0, test 800"."""
    parts = ", ".join(f"{name} {runs:,}" for name, runs in planned.items())
    return f"at most {sum(planned.values()):,} runs: {parts}"


def dry_run(args: argparse.Namespace, asked: Asked) -> int:
    """Print the runs of each part, the cores that they can use, and the time."""
    if args.scheduler is not None:
        raise InputError("--dry-run estimates for local processes; leave --scheduler out")
    question, known = asked.question, forecast_of(args, asked.plan, None)
    fleets, stages = len(question.robots), stages_of(asked.question)
    in_turns = sum(
        fleets * number * math.ceil(population / known.workers) for _, number, population in stages
    )
    planned = planned_runs(args, asked)
    total = sum(planned.values())
    rest = total - fleets * sum(number * population for _, number, population in stages)
    seconds = known.start_s + known.run_s * (in_turns + rest / known.workers)
    most = max(population for *_, population in stages)
    parts = " and ".join(f"{number} x {population} ({name})" for name, number, population in stages)
    lines = [
        f"search: {question.runs:,} runs at most: {len(evolution.start_phases())} start designs x "
        f"{evolution.START_RUNS}, generations {parts}"
        + (f", each with {fleets} fleets" if fleets > 1 else ""),
        planned_text(planned),
        f"time: about {duration(seconds)} with {count(known.workers, 'worker')} "
        f"({1e3 * known.run_s:,.0f} ms a run, by {count(known.pilots, 'pilot run')}; distance tables of "
        "each design come on top)",
        f"a generation ends before the next begins, so the search uses at most {most} cores",
    ]
    data = {"runs": total, "wall_s": seconds, "workers": known.workers, "most_workers": most}
    if args.json:
        print_json({"scenario": args.scenario, **data})
    else:
        print_document(ReportDocument(asked.resolved.scenario.name, [Listed(lines, mark="")]))
    return 0


# The search, the choice and the verdict.


def searched(args: argparse.Namespace, asked: Asked) -> StreetResult:
    """Search, choose and test, with progress on stderr. Raises InputError."""
    from automaton.studies.street_search.design_runs import design_runs

    question = asked.question
    floor_plan = asked.base(None).floor_plan
    planned = planned_runs(args, asked)
    note(f"{asked.resolved.scenario.name}: {planned_text(planned)}")
    with progress(args.out) as listener:
        begun = design_runs(
            args.out,
            asked.plan,
            asked.base,
            lambda: crew_of(args),
            args.recompute,
            lambda start: listener.begin(start._replace(runs=sum(planned.values()))),
            listener.rows,
            args.strategy_timeout,
        )
        with begun as runs:
            log = CandidateLog(args.out, searched_for(asked, runs.version), args.recompute)
            if log.damaged_from is not None:
                note(
                    f"{log.path} is damaged; the search goes on from generation {log.damaged_from}"
                )
            search = evolution.Search(question, floor_plan, asked.as_it_is, runs, log).run()
            choice = verdict.choose(question, search.finalists, runs)
            last: FinishedDesign | None = None
            fleets: list[verdict.FleetVerdict] = []
            refused: list[str] = []
            if choice.place:
                chosen = search.finalists[choice.place].design
                last = finished(chosen, context_of(args, asked, runs), args.one_way)
                fleets, refused = judged(asked, last.design, runs.with_detours())
            failed = sum(row["error"] is not None for row in runs.rows.values())
    return StreetResult(search, choice, fleets, refused, failed, last)


def context_of(args: argparse.Namespace, asked: Asked, runs: Any) -> DesignContext:
    """How designs are compared in the steps after the choice."""
    from automaton.studies.street_search.design_runs import with_design

    question = asked.question
    largest = max(question.robots, key=lambda robots: robots or 0)
    base = asked.base(largest)
    return DesignContext(
        base,
        lambda design: with_design(base, design),
        runs,
        question.metric,
        question.is_higher_better,
        question.robots,
        lambda purpose, number: question.seeds(purpose, question.scaled(number)),
        args.workers,
    )


def searched_for(asked: Asked, version: str) -> dict[str, Any]:
    """What determines the candidates of a search."""
    question = asked.question
    return {
        "scenario": asked.plan.manifest.points[0].fingerprint,
        "code": version,
        "seed": question.seed,
        "--runs": question.runs,
        "--detail": question.detail,
        "--metric": question.metric,
        "better": "highest" if question.is_higher_better else "lowest",
        "--robots": list(question.robots),
    }


def judged(
    asked: Asked, design: StreetDesign, runs: Any
) -> tuple[list[verdict.FleetVerdict], list[str]]:
    """The verdict for each fleet, and the fleets that the scenario cannot have."""
    question, own = asked.question, asked.resolved.scenario.fleet.robots
    wanted = tuple(own if one is None else one for one in question.robots)
    fleets, refused = [], []
    for robots in verdict.fleets_of(wanted):
        try:
            asked.base(None if robots == own else robots)
        except InputError as error:
            refused.append(f"{robots:,} robots: {error.message}")
            continue
        fleets.append(verdict.judge(question, asked.as_it_is, design, runs, robots, robots == own))
    return fleets, refused


# The report.


def document_of(result: StreetResult, asked: Asked, args: argparse.Namespace) -> ReportDocument:
    """Question, answer, fleets, search, and the command that repeats it."""
    name, question = asked.resolved.scenario.name, asked.question
    document = ReportDocument(name, [Heading(f"{name}: streets", 1)])
    direction = "highest" if question.is_higher_better else "lowest"
    unit, meaning = described(question.metric)
    generations = count(len(result.search.generations), "generation")
    text = (
        f"Which weights of streets give the {direction} {question.metric} ({unit}: {meaning})? "
        f"{generations} of designs, then {count(len(result.search.finalists), 'finalist')} in "
        f"{count(result.choice.rounds, 'round')} with {result.choice.runs:,} runs, then "
        f"{question.scaled(verdict.HELD_OUT_PAIRS)} pairs of runs for each fleet, with seeds that search "
        "and choice did not use."
    )
    document.add(Heading("Question"), Text(text), Heading("Answer"))
    document.add(Listed(list(answer(result, asked)), strong=True))
    if result.fleets:
        document.add(*fleet_blocks(result, question))
    if result.finished is not None:
        is_ascii = not (sys.stdout.encoding or "").lower().startswith("utf")
        floor_plan = asked.base(None).floor_plan
        document.add(
            *blocks_of(result.finished, floor_plan, question.metric, result.total, is_ascii)
        )
    document.add(Heading("Search"), *search_blocks(result, question))
    document.add(Heading("Files"), Listed(list(files(result, asked, args)), mark=""))
    return document


def answer(result: StreetResult, asked: Asked) -> Iterator[str]:
    """The gain in a sentence for each fleet that was asked for."""
    question = asked.question
    if not result.choice.place:
        yield "No gain that holds: no design was better than the scenario as it is in the choice."
        yield from hint_of_demand(question)
        return
    for one in result.fleets:
        if not one.is_asked:
            continue
        share = None if one.gain is None else one.gain.relative
        verb = "With these streets" if one.is_gain(question.is_higher_better) else \
            "No gain that holds: with these streets"  # fmt: skip
        before, after = (f"{mean:,.5g}" for mean in one.means)
        yield (
            f"{verb} {question.metric} changes by {in_percent(share)} with {one.robots:,} robots: "
            f"{before} as it is, {after} with them."
        )
        if one.warnings:
            yield f"Worse with {one.robots:,} robots: {'; '.join(one.warnings)}."
    if not any(one.is_gain(question.is_higher_better) for one in result.fleets if one.is_asked):
        yield from hint_of_demand(question)
    yield f"The design is '{result.chosen.name}'."


def hint_of_demand(question: SearchQuestion) -> Iterator[str]:
    """What to ask if robots deliver all that there is to deliver anyway."""
    if question.metric == "throughput":
        yield "If demand limits the throughput, search by a time, such as --metric lead_time."


def fleet_blocks(result: StreetResult, question: SearchQuestion) -> Iterator[Block]:
    """The table of fleets, and how to read it."""
    sides = [
        name for name in verdict.SIDE_METRICS if any(name in one.beside for one in result.fleets)
    ]
    rows = []
    for one in result.fleets:
        gain = "too few pairs" if one.gain is None else in_percent(one.gain.relative)
        cells = [f"{one.robots:,}{' *' if one.is_asked else ''}", *(f"{m:,.5g}" for m in one.means)]
        beside = [side_text(one, name) for name in sides]
        rows.append([*cells, gain, *beside])
    head = ["robots", "as it is", "with streets", f"{question.metric}, 95 %", *sides]
    yield Table(head, rows, left=0)
    pairs = question.scaled(verdict.HELD_OUT_PAIRS)
    lines = [f"*: the fleet of the search. {pairs} pairs for each fleet."]
    lines += [
        f"{one.robots:,} robots: {count(one.pairs, 'pair')}; without {question.metric} or unfinished: "
        f"{one.unfinished[0]:,} runs as it is, {one.unfinished[1]:,} with streets."
        for one in result.fleets
        if any(one.unfinished)
    ]
    lines += [
        f"{one.robots:,} robots, worse by more than 10 %: {'; '.join(one.warnings)}."
        for one in result.fleets
        if one.warnings
    ]
    lines += [f"Not possible with {refused}" for refused in result.refused]
    yield Listed(lines, mark="")


def side_text(one: verdict.FleetVerdict, name: str) -> str:
    """The change of a side metric."""
    effect = one.beside.get(name)
    if effect is None:
        return "-"
    if effect.relative is None or name == "detour_share":
        return f"{effect.difference.value:+.3g}"
    return f"{100 * effect.relative.value:+.1f} %"


def search_blocks(result: StreetResult, question: SearchQuestion) -> Iterator[Block]:
    """The curve of the search."""
    lines = []
    for stage, *_ in stages_of(question):
        of_stage = [
            one
            for one in result.search.generations
            if one.stage == stage and math.isfinite(one.mean)
        ]
        means = [one.mean for one in of_stage]
        x = [float(one.number) for one in of_stage]
        if x:
            lines.append(ReportCurve(stage, x, means, means, means))
    if lines:
        title = f"{question.metric}: mean of the designs of a generation"
        yield Curves(title, "generation", described(question.metric)[0], lines)
    yield Text(
        "All designs of a generation run with the same seed, each generation has another. These means "
        "choose designs; the gain is that of the answer."
    )


def path_of(args: argparse.Namespace, asked: Asked) -> Path:
    """The file of the scenario with the streets."""
    return scenario_path(args.out, asked.resolved.scenario.name)


def files(result: StreetResult, asked: Asked, args: argparse.Namespace) -> Iterator[str]:
    """What the folder has, and the command that repeats the search."""
    if result.choice.place:
        path = path_of(args, asked)
        yield f"streets: {args.out / STREETS_FILE}; scenario with them: {path}"
        yield f"watch: automaton watch {shlex.quote(str(path))}"
    yield f"repeat: {command_of(args)}"


def command_of(args: argparse.Namespace) -> str:
    """The command line of the search."""
    words = ["automaton", "streets", args.scenario, "--out", str(args.out)]
    words += ["--runs", str(args.runs), "--detail", args.detail]
    words += [] if args.seed is None else ["--seed", str(args.seed)]
    words += [] if args.metric is None else ["--metric", args.metric]
    words += [f"--{name}" for name in ("minimise", "maximise") if getattr(args, name)]
    words += ["--one-way"] if args.one_way else []
    words += ["--robots", ",".join(map(str, args.robots))] if args.robots else []
    for setting in args.settings:
        words += ["--set", setting if isinstance(setting, str) else setting.argument]
    return shlex.join(words)


def finished_record(last: FinishedDesign | None, asked: Asked) -> dict[str, Any]:
    """One-way streets, streets left out and reasons."""
    if last is None:
        return {"one_way": None, "left_out": [], "reasons": []}
    floor_plan = asked.base(None).floor_plan
    one_way = None
    if last.one_way is not None:
        numbers = ("closings", "reopened", "two_way")
        one_way = {name: len(getattr(last.one_way, name)) for name in numbers}
        one_way["is_kept"] = last.one_way.is_kept
    left_out = [one.name(floor_plan) for one in last.fewer.removed if last.fewer.is_kept]
    reasons = [reason_record(one, floor_plan) for one in last.reasons]
    return {"one_way": one_way, "left_out": left_out, "reasons": reasons}


def as_json(result: StreetResult, asked: Asked, args: argparse.Namespace) -> dict[str, Any]:
    """The results as one object."""
    question = asked.question
    fleets = []
    for one in result.fleets:
        record: dict[str, Any] = {
            "robots": one.robots,
            "asked": one.is_asked,
            "pairs": one.pairs,
            "as_it_is": one.means[0],
            "with_streets": one.means[1],
            "relative": None,
            "is_gain": one.is_gain(question.is_higher_better),
            "worse": one.warnings,
        }
        if one.gain is not None and one.gain.relative is not None:
            share = one.gain.relative
            record["relative"] = {"value": share.value, "low": share.low, "high": share.high}
        record["beside"] = {name: side.difference.value for name, side in one.beside.items()}
        fleets.append(record)
    return {
        "scenario": args.scenario,
        "metric": question.metric,
        "better": "highest" if question.is_higher_better else "lowest",
        "seed": question.seed,
        "out": str(args.out),
        "design": result.chosen.name,
        "finalists": [one.name for one in result.search.finalists],
        "generations": [one._asdict() for one in result.search.generations],
        "fleets": fleets,
        "refused": result.refused,
        **finished_record(result.finished, asked),
        "is_gain": result.holds(question),
        "failed": result.failed,
    }
