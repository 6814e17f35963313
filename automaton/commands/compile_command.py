"""Compile all code that the runs of a batch need, in advance.

Compiled code is stored for each version in `~/.cache/automaton`, or in AUTOMATON_CACHE_DIR. All
processes that share this folder use it, on any machine with the same processor.

Exit code 0: done; 2: bad input, such as a strategy that does not compile.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace

import msgspec

from automaton.commands.arguments import say, show_line
from automaton.commands.check import names_study
from automaton.errors import InputError
from automaton.scenario.schema import LAYER_NAMES, Measure
from automaton.scenario.text_files import shipped
from automaton.strategy import lookup
from automaton.studies.sweeps.sweep_plan import check_study
from automaton.world.resolve import Resolved, resolve

COMPILED_TICKS = 100  # of each run: enough to pick, to drop, and to be measured


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton compile`."""
    parser.add_argument(
        "file",
        nargs="*",
        metavar="FILE",
        help="scenario and study files to compile for (default: the shipped scenarios and all "
        "strategies)",
    )


def run(args: argparse.Namespace) -> int:
    """Start a run with each set of strategies, and print how long compiling took."""
    from automaton.engine.jit.kernel import jit_is_on, seconds_compiled
    from automaton.engine.jit.kernel_cache import cache_root

    if not jit_is_on():
        raise InputError("NUMBA_DISABLE_JIT turns compiling off; unset it")
    used = set()
    for resolved in first_of_each(scenarios_in(args.file or list(shipped()))):
        show_line(f"compiling what {resolved.scenario.name} needs")
        begin_run(resolved)
        used |= {(layer, choice.name) for layer, choice in resolved.choices}
    if not args.file:
        used |= compile_others(used)
    strategies = sum(name != lookup.NO_STRATEGY for _, name in used)
    spent = f"{seconds_compiled():,.0f} s"
    say(f"the world and strategies ({strategies}): compiled in {spent}, kept in {cache_root()}")
    return 0


def scenarios_in(files: Sequence[str]) -> Iterator[Resolved]:
    """The scenarios of the files and of the points of studies. Raises InputError."""
    for file in files:
        if names_study(file):
            _, scenarios = check_study(file)
            yield from scenarios
        else:
            yield resolve(file)


def first_of_each(scenarios: Iterator[Resolved]) -> Iterator[Resolved]:
    """The first scenario with each combination of strategies."""
    known = set()
    for resolved in scenarios:
        names = tuple(choice.name for _, choice in resolved.choices)
        if names not in known:
            known.add(names)
            yield resolved


def begin_run(resolved: Resolved) -> None:
    """Run a scenario for some ticks, recorded, observed and measured. Raises InputError."""
    from automaton.history.event_history import EventHistory
    from automaton.recording.recorder import MemoryRecorder
    from automaton.runs.headless import attribute_strategy_errors
    from automaton.runs.metrics import metrics_of
    from automaton.runs.simulation import Simulation

    measured = msgspec.structs.replace(resolved.scenario, measure=Measure())
    resolved = replace(resolved, scenario=measured)
    with attribute_strategy_errors(resolved):
        simulation = Simulation(
            resolved, on_record=MemoryRecorder(resolved), on_observe=EventHistory()
        )
        simulation.run(COMPILED_TICKS)
    metrics_of(simulation)


def compile_others(used: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """Compile features and strategies that no shipped scenario uses; return these strategies."""
    from automaton.engine.features import FEATURES, compiled_feature
    from automaton.runs.simulation import compile_strategy

    for number in range(len(FEATURES)):
        compiled_feature(number)
    others = {(layer, name) for layer in LAYER_NAMES for name in lookup.names(layer)} - used
    for layer, name in sorted(others):
        if name != lookup.NO_STRATEGY:
            show_line(f"compiling {layer} {name}")
            compile_strategy(lookup.load(layer, name))
    return others
