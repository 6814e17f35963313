"""A short trial run before the real ones: does it jam, stall or exceed a bound?"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from automaton.runs.headless import Outcome, run_once
from automaton.runs.progress import Jam, starved_ticks, stuck_robots
from automaton.runs.run_diagnosis import JamWatch, describe_jam, describe_wait_cycles, robot_names
from automaton.runs.simulation import Simulation
from automaton.world.bounds import bounds, least_ticks, most_throughput
from automaton.world.resolved import Resolved

MIN_TICKS: Final = 500
TRIAL_ROBOT_TICKS: Final = 2_000_000


class TrialRun(NamedTuple):
    """The result of a trial run."""

    ticks: int
    patience: int  # ticks without progress after which a robot counts as starved
    findings: tuple[str, ...]  # phrases about problems

    def lines(self) -> list[str]:
        """Return the lines that `check` prints: one for each finding, or one that reports success."""
        head = f"trial of {self.ticks:,} ticks"
        if self.findings:
            return [f"{head}: {one}" for one in self.findings]
        if self.ticks <= self.patience:
            return [
                f"{head}: ok, but too short to detect a jam: this takes {self.patience:,} ticks here"
            ]
        return [f"{head}: ok, every robot with work made progress"]

    def as_json(self) -> dict[str, Any]:
        """Return the result as a JSON object."""
        return {"passed": not self.findings, **self._asdict()}


def try_out(resolved: Resolved) -> TrialRun:
    """Run a scenario for MIN_TICKS, or TRIAL_ROBOT_TICKS / robots if more, at most to its limit."""
    scenario = resolved.scenario
    ticks = scenario.refine * max(MIN_TICKS, TRIAL_ROBOT_TICKS // scenario.fleet.robots)
    findings: list[str] = []
    patience: list[int] = []

    def on_jam(tick: int, jam: Jam) -> None:
        findings.append(f"tick {tick:,}: {describe_jam(jam)[0]}")

    def on_end(simulation: Simulation) -> None:
        patience.append(starved_ticks(simulation.world))
        stuck = stuck_robots(simulation.world, patience[0])
        if len(stuck) and not findings:
            names = robot_names(simulation, stuck)
            findings.append(f"{names} work but finished nothing for {patience[0]:,} ticks")

    outcome = run_once(resolved, until=ticks, on_end=on_end, watch=JamWatch(on_jam))
    findings += describe_wait_cycles(outcome.circles)
    findings += exceeded_bounds(resolved, outcome)
    return TrialRun(outcome.ticks, patience[0], tuple(findings))


def exceeded_bounds(resolved: Resolved, outcome: Outcome) -> list[str]:
    """Return a phrase for each theoretical bound that the run exceeds."""
    limits, robots = bounds(resolved), resolved.scenario.fleet.robots
    least, why = least_ticks(limits, robots)
    phrases = []
    if outcome.delivered == outcome.orders and outcome.ticks < least:
        phrases.append(
            f"all orders delivered in {outcome.ticks:,} ticks, less than {least:,.0f} ({why})"
        )
    most, why = most_throughput(limits, robots, outcome.ticks)
    if 1000 * outcome.delivered > most * outcome.ticks:
        rate = 1000 * outcome.delivered / outcome.ticks
        phrases.append(f"{rate:,.1f} orders in 1,000 ticks, more than {most:,.1f} ({why})")
    return phrases
