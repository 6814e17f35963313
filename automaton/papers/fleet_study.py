"""Tasks that large fleets finish on grids of 32 x 32 cells: pibt and epibt beside printed results.

A. Yukhnevich, A. Andreychuk: Enhancing PIBT via Multi-Action Operations, AAAI-26. The project ships no
third-party problems: `--data FOLDER` reads those of the authors and of the League of Robot Runners from
FOLDER and its subfolders. Without it, floors of the same sizes are generated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Final

from automaton.errors import InputError
from automaton.exchange.imported_floor import imported_files
from automaton.exchange.problem import GridMap, Problem
from automaton.exchange.problem_files import (
    MAP_FILE,
    fleets_of,
    random_problem,
    read_league_problem,
    read_problem_folder,
)
from automaton.papers.claims import OUR_BOUND, Claim, Figure, above, claim, mean_of
from automaton.papers.reproduction_study import (
    NEVER_ASIDE,
    Case,
    Cases,
    Headline,
    Key,
    PublishedTable,
    Reproduction,
    RunCase,
    Runner,
    scenario_runs,
)
from automaton.scenario.text_files import read_text
from automaton.strategy import lookup
from automaton.studies.process_pool import RunResult
from automaton.world.resolve import Resolved, resolve
from layouts.random_floor import RandomFloor

EPIBT: Final = "epibt"
PIBT: Final = "pibt"
FLEET_STRATEGIES: Final = (EPIBT, PIBT)
RUN_TICKS: Final = 1000

# Tasks in 1,000 ticks by number of robots, for EPIBT with operations of three actions.
PRINTED_TASKS: Final = {
    100: 2788,
    200: 3823,
    300: 3655,
    400: 3349,
    500: 3379,
    600: 2632,
    700: 2416,
    800: 1658,
}
BEST_KNOWN: Final = {"random_32_32_20_100": 1186}  # with 32 cores and a second for each tick
LEAGUE_TICKS: Final = {"random_32_32_20_100": 500}

MAX_HEADLINES: Final = 12  # on the first screen

GENERATED: Final = "generated"
GENERATED_ROBOTS: Final = (100, 200, 400, 800)
GRID_SIDE: Final = 32  # cells
BLOCKED_SHARE: Final = 0.2

WHERE_PROBLEMS_ARE: Final = (
    "The problems belong to third parties and are not part of the project: the authors of EPIBT publish "
    "theirs on GitHub (user Straple), the League of Robot Runners in the examples of its start kit of "
    "2024 (github.com/MAPF-Competition/Start-Kit). `automaton reproduce fleets --data FOLDER` reads them."
)

MAP_KEY: Final = '"mapFile"'  # distinguishes problems of the league from outputs

ProblemOf = Callable[[Key], Problem]


class FleetCase(RunCase):
    """A strategy with a problem and a number of robots."""

    @property
    def own_settings(self) -> tuple[str, ...]:
        name = self.labels["strategy"]
        patience = f"strategy.right_of_way.deadlock_patience={NEVER_ASIDE}"
        own = f"strategy.right_of_way.name={name}"
        return (own, patience) if name in FLEET_STRATEGIES else (own,)


def tasks_in(problem_of: ProblemOf) -> Runner:
    """A table's runner: the finished tasks of each case (strategy, problem and number of robots)."""

    return scenario_runs(
        scenario_of=lambda case, folder: scenario_of(case, problem_of(case.key), folder),
        measured=with_tasks,
    )


def scenario_of(case: FleetCase, problem: Problem, folder: Path) -> Resolved:
    """The scenario of a case, from the files that `automaton import` would write."""
    ticks = LEAGUE_TICKS.get(problem.name, RUN_TICKS)
    for name, text in imported_files(problem, "floor", ticks).items():
        (folder / name).write_text(text, encoding="utf-8")
    return resolve(folder / "floor.yaml", (*case.own_settings, *case.settings))


def with_tasks(result: RunResult) -> RunResult:
    """The result of a run with the number of finished tasks as its only metric."""
    return result._replace(metrics={"tasks": result.metrics["delivered"]})


def crossed_with(problems: Sequence[tuple[str, int]]) -> Cases:
    """Cases for each strategy with each problem, given by name and number of robots."""

    def cases(strategies: Sequence[str]) -> list[Case]:
        for strategy in strategies:
            try:
                lookup.parameters_type("right_of_way", strategy)
            except InputError as error:
                raise InputError(f"--strategies: {error}") from error
        return [
            FleetCase({"strategy": strategy, "problem": name, "robots": robots})
            for strategy in strategies
            for name, robots in problems
        ]

    return cases


def generated_map() -> GridMap:
    """The map of the generator `random`: 32 x 32 cells, 20 % of them blocked."""
    floor_plan = RandomFloor(columns=GRID_SIDE, rows=GRID_SIDE, obstacles=BLOCKED_SHARE).build()
    return GridMap(GENERATED, floor_plan.drivable[1:-1, 1:-1])


@lru_cache(maxsize=8)
def generated_problem(robots: int) -> Problem:
    """Random starts and tasks on the generated map."""
    return random_problem(GENERATED, generated_map(), robots)


def printed(key: Key, metric: str) -> float | None:
    """The number printed by the authors of EPIBT, who ran no other strategy."""
    strategy, _, robots = key
    return PRINTED_TASKS.get(int(robots)) if strategy == EPIBT else None


def best_known(key: Key, metric: str) -> float | None:
    """The best known result of the league, with any strategy."""
    return BEST_KNOWN.get(str(key[1]))


def table_of(
    title: str, problems: Mapping[tuple[str, int], ProblemOf], **others: object
) -> PublishedTable:
    """A table of the tasks that strategies finish on problems."""
    return PublishedTable(
        title=title,
        cases=crossed_with(list(problems)),
        panels=(("tasks",),),
        run=tasks_in(lambda key: problems[str(key[1]), int(key[2])](key)),
        **others,  # type: ignore[arg-type]
    )


def headlines_of(problems: Sequence[tuple[str, int]]) -> tuple[Headline, ...]:
    """A headline for the tasks of each strategy with each problem, up to MAX_HEADLINES."""
    return tuple(
        Headline(f"{strategy}, {robots} robots: tasks", cell=("tasks", (strategy, name, robots)))
        for strategy in FLEET_STRATEGIES
        for name, robots in problems
    )[:MAX_HEADLINES]


def more_tasks(name: str, fleets: Sequence[int]) -> Claim:
    """The publication's claim about the fleets of a problem."""
    return claim(
        "Operations of several actions finish more tasks than single steps",
        *(
            above(
                f"tasks of epibt beyond pibt, N = {robots}",
                mean_of("tasks", EPIBT, name, robots) - mean_of("tasks", PIBT, name, robots),
            )
            for robots in fleets
        ),
    )


def as_printed(name: str, fleets: Sequence[int]) -> Claim:
    """The claim that the printed numbers are reproduced."""
    return claim(
        "EPIBT finishes as many tasks as its authors print",
        *(
            Figure(
                f"tasks / printed, N = {robots}",
                mean_of("tasks", EPIBT, name, robots) / PRINTED_TASKS[robots],
                at_least=0.97,
                at_most=1.03,
                digits=3,
                certain=True,  # EPIBT draws nothing
                why=OUR_BOUND,
            )
            for robots in fleets
            if robots in PRINTED_TASKS
        ),
    )


def from_data(folder: Path) -> Reproduction:
    """The reproduction with the problems of a folder and its subfolders. Raises InputError."""
    if not folder.is_dir():
        raise InputError("is not a folder", str(folder))
    places = [folder, *sorted(path for path in folder.iterdir() if path.is_dir())]
    tables: list[PublishedTable] = []
    claims: list[Claim] = []
    for place in places:
        if (place / MAP_FILE).is_file():
            fleets = fleets_of(place)
            problems = {(place.name, robots): fleet_reader(place) for robots in fleets}
            claims += [as_printed(place.name, fleets), more_tasks(place.name, fleets)]
            title = f"{place.name}: tasks in {RUN_TICKS:,} ticks, pre-assigned round-robin"
            tables.append(table_of(title, problems, published=printed, name=place.name))
        files = [path for path in sorted(place.glob("*.json")) if is_league_problem(path)]
        league = [read_league_problem(path) for path in files]
        if league:
            pool = {(one.name, one.robots): (lambda _, one=one: one) for one in league}
            title = "Problems of the League of Robot Runners: tasks from a pool"
            tables.append(table_of(title, pool, published=best_known, name="league"))
    if not tables:
        raise InputError("has no problem: neither map.txt nor a .json of a problem", str(folder))
    keys = [case.key for table in tables for case in table.cases(FLEET_STRATEGIES)]
    of_all = list(dict.fromkeys((str(name), int(robots)) for _, name, robots in keys))
    return replace(
        REPRODUCTION,
        tables=tuple(tables),
        claims=tuple(claims),
        remarks=FLEET_REMARKS[1:],
        headlines=headlines_of(of_all),
    )


def is_league_problem(path: Path) -> bool:
    """Whether a path is a regular file with a problem of the league. Raises InputError."""
    return path.is_file() and MAP_KEY in read_text(path)


def fleet_reader(folder: Path) -> ProblemOf:
    """A function that reads the problem of a folder for the number of robots of a case."""
    return lambda key: _read(folder, int(key[2]))


@lru_cache(maxsize=8)
def _read(folder: Path, robots: int) -> Problem:
    return read_problem_folder(folder, robots)


FLEET_REMARKS: Final = (
    f"The floors are generated, so they have no printed results. {WHERE_PROBLEMS_ARE}",
    "The printed numbers come from the authors' code, with its order of robots and of operations; a "
    "robot that starts on the cell of its task skips this task.",
    "The best known result of the league took 32 cores and up to a second for each tick.",
)

REPRODUCTION: Final = Reproduction(
    name="fleets",
    title="Large fleets on grids of 32 x 32 cells, one robot in a cell",
    source="Yukhnevich & Andreychuk, Enhancing PIBT via Multi-Action Operations, AAAI-26; the League of "
    "Robot Runners 2024",
    strategies=FLEET_STRATEGIES,
    tables=(
        table_of(
            f"Generated floors of the published sizes: tasks in {RUN_TICKS:,} ticks, from a pool",
            {
                (GENERATED, robots): lambda key: generated_problem(int(key[2]))
                for robots in GENERATED_ROBOTS
            },
        ),
    ),
    averaged=("tasks",),
    headlines=headlines_of([(GENERATED, robots) for robots in GENERATED_ROBOTS]),
    seeds=3,
    claims=(more_tasks(GENERATED, GENERATED_ROBOTS),),
    remarks=FLEET_REMARKS,
    remarks_title="Where the problems come from",
    from_data=from_data,
)
