"""Settings for all tests: property tests draw the same examples in every run of CI."""

from __future__ import annotations

import gc
import os
from itertools import groupby
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from shared_fixture import folder_of_all_workers

from automaton import pytest_plugin
from automaton.engine.jit.kernel import COMPILATIONS
from automaton.runs import first_compilation

# Compiled code is compiled once, in whatever example comes first: no deadline, no health check.
COMMON = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}

settings.register_profile("ci", derandomize=True, print_blob=True, **COMMON)
settings.register_profile("explore", derandomize=False, **COMMON)  # new examples in every run
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


# The workers of the tests use all cores: runs for which no number of processes is named get one.
pytest.MonkeyPatch().setattr(first_compilation, "cores", lambda: 1)


# The viewer starts with its own settings, not with those of the user who runs the tests; and what is
# drawn depends on the terminal.
os.environ["XDG_CONFIG_HOME"] = os.devnull
os.environ |= {"TERM": "xterm-256color", "COLUMNS": "80"}
for name in ("COLORTERM", "NO_COLOR", "FORCE_COLOR", "LINES"):
    os.environ.pop(name, None)


# Tests make objects by the million, and drop most of them at once.
gc.set_threshold(50_000, 50, 1000)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread the tests of the viewer, which mostly wait, among those that compute.

    So several workers on few cores keep these busy to the end. Tests of a file stay together.
    """
    files = {path: list(tests) for path, tests in groupby(items, lambda item: item.path)}
    kinds: tuple[list[Path], list[Path]] = ([], [])
    for path in files:
        kinds["tui" in path.parts].append(path)
    places = [((k + 0.5) / len(kind), path) for kind in kinds for k, path in enumerate(kind)]
    items[:] = [item for _, path in sorted(places) for item in files[path]]


def pytest_collection_finish() -> None:
    """What thousands of collected tests consist of stays to the end: no garbage is looked for there."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def runs_of_all_workers(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Where `remembered_runs` keeps runs that several test modules ask for."""
    folder = folder_of_all_workers(tmp_path_factory) / "runs"
    folder.mkdir(exist_ok=True)
    os.environ["RUNS_OF_ALL_WORKERS"] = str(folder)


def pytest_addoption(pluginmanager: pytest.PytestPluginManager) -> None:
    """Have `grid_snapshot`, unless somebody asked for it with -p."""
    if not pluginmanager.is_registered(pytest_plugin):
        pluginmanager.register(pytest_plugin)


# What a test has to compile changes nothing of what it reads on stderr.
COMPILATIONS.announced = True
