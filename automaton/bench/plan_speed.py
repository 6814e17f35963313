"""What a plan costs on the warehouse of Bhattathiri, Li & Kuhl and on larger ones like it.

A leg leads from the access cell of a rack to a dock, or on to another rack, drawn uniformly. An
avoidance plan chooses among the candidates for both legs, with what is predicted of five others
given, and writes the routes.
"""

from __future__ import annotations

from functools import partial

from automaton.bench.leg_plans import plan_avoiding, plan_legs
from automaton.bench.measurement import US, Measurement, Sample, cpu_seconds
from automaton.papers.traffic.traffic_trials import exact, tasks_of, warehouse
from strategies.routing.astar.frontier import FIFO, LARGER_G

PLANS = {100: 1000, 300: 200, 1000: 40}  # of a sample, by the side of the floor
SEED = 1


def measurements() -> list[Measurement]:
    """A leg by each of two tie rules and an avoidance plan, on each floor."""
    found = []
    for side, plans in PLANS.items():
        floor = f"on {side}x{side}"
        found += [
            Measurement(f"A* leg {floor}", US, partial(prepare_legs, side, LARGER_G, plans)),
            Measurement(f"A* leg {floor}, fifo", US, partial(prepare_legs, side, FIFO, plans)),
            Measurement(f"avoidance plan {floor}", US, partial(prepare_avoidance, side, plans)),
        ]
    return found


def prepare_legs(side: int, ties: int, plans: int) -> Sample:
    """A sampler: us for a leg; a plan has two."""
    where = warehouse(side)
    tasks = tasks_of(where, SEED, plans)[:, 0].copy()
    arguments = (where.grid, where.duration, where.workspace, ties, tasks, where.trial.plain)
    return lambda: 1e6 * cpu_seconds(lambda: plan_legs(*arguments)) / (2 * plans)


def prepare_avoidance(side: int, plans: int) -> Sample:
    """A sampler: us for a plan."""
    where = warehouse(side)
    tasks = tasks_of(where, SEED, plans)
    foreseen = exact(where, SEED, tasks)
    arguments = (where.grid, where.duration, where.workspace, tasks, foreseen, where.trial.plain)
    return lambda: 1e6 * cpu_seconds(lambda: plan_avoiding(*arguments)) / plans
