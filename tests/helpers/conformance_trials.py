"""Whether all shipped strategies and the projects of `new-strategy` conform: run by hand.

    python tests/helpers/conformance_trials.py shipped [FLOORS [LAYER:NAME ...]]
    python tests/helpers/conformance_trials.py projects [FOLDER [LAYER ...]]
    python tests/helpers/conformance_trials.py compiled

`shipped` prints the table of docs/reference/conformance.md (40 floors: at most 90 s on two idle
cores). `projects` writes the two projects of each layer and, for each in a fresh environment,
installs it, runs its tests, `list`, the example of its README and `check-strategy --floors 50`.
`compiled` checks that the compiled strategies of broken_strategies.py are named by their own checks.
The exit code is 1 if one fails.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

from automaton.conformance import FAILS, CheckRequest, Children, Verdict, checked
from automaton.conformance.new_project import LAYERS, write_project
from automaton.strategy.lookup import NO_STRATEGY, names

ROOT = Path(__file__).parents[2]
FLOORS = 40


def shipped(floors: int = FLOORS, chosen: tuple[str, ...] = ()) -> int:
    """Check the shipped strategies, and print a row for each."""
    every = [f"{layer}:{name}" for layer in LAYERS for name in names(layer) if name != NO_STRATEGY]
    begun, failed = time.perf_counter(), []
    print("| strategy | cases | refused | decisions | ns of a decision | verdict |")
    print("|---|---|---|---|---|---|")
    with Children() as children:
        for name in chosen or every:
            verdict = checked(CheckRequest(name, floors), children=children)
            print(row(verdict), flush=True)
            if not verdict.conforms:
                failed.append("\n".join(verdict.lines()))
    print(f"{time.perf_counter() - begun:.0f} s", file=sys.stderr)
    print("\n\n".join(failed), file=sys.stderr)
    return 1 if failed else 0


def row(verdict: Verdict) -> str:
    """A strategy as a row of the table."""
    said = [
        f"{one.name}: {one.verdict}" for one in verdict.checks if one.verdict in ("FAILS", "note")
    ]
    median = verdict.ns["median"]
    cells = (
        verdict.strategy,
        verdict.cases,
        verdict.refused,
        f"{verdict.decisions:,}",
        "" if median is None else f"{median:,.0f}",
        ", ".join(said) or "conforms",
    )
    return "| " + " | ".join(map(str, cells)) + " |"


def projects(parent: Path, chosen: tuple[str, ...] = ()) -> int:
    """Write, install and check the two projects of each layer, with one wheel of this clone."""
    failed, pip = [], [sys.executable, "-m", "pip"]
    subprocess.run([*pip, "wheel", "-q", "--no-deps", "-w", parent, ROOT], check=True)
    wheel = next(parent.glob("*.whl"))
    for layer in chosen or LAYERS:
        for compiled in (False, True):
            name = f"my-{layer.replace('_', '-')}" + ("-fast" if compiled else "")
            write_project(name, layer, compiled, parent)
            folder = parent / name
            venv.create(folder / "env")
            python = folder / "env" / "bin" / "python"
            command = [python, "-m", "automaton"]
            steps = (
                [
                    *pip,
                    "--python",
                    python,
                    "install",
                    "-q",
                    "--no-compile",
                    wheel,
                    f"{folder}[test]",
                ],
                [python, "-m", "pytest", "-q", str(folder / "tests")],
                [*command, "list"],
                [*command, *LAYERS[layer].example_run(layer, name).split()[1:]],
                [*command, "check-strategy", f"{layer}:{name}", "--floors", "50"],
            )
            begun = time.perf_counter()
            for step in steps:
                done = subprocess.run(step, cwd=folder, capture_output=True, text=True)
                if done.returncode:
                    failed.append(name)
                    print(f"{name}: {' '.join(map(str, step[1:]))}\n{done.stdout}{done.stderr}")
                    break
            else:
                print(f"{name}: all well ({time.perf_counter() - begun:.0f} s)", flush=True)
    return 1 if failed else 0


def compiled() -> int:
    """Check the compiled strategies that break a promise."""
    failed = 0
    for name, check in {"OutsideIndex": "jit", "ScratchMemory": "branches"}.items():
        verdict = checked(CheckRequest(f"broken_strategies:{name}", 12))
        named = [one.name for one in verdict.checks if one.verdict == FAILS]
        print("\n".join(verdict.lines()), end="\n\n")
        failed += named != [check]
    return int(failed > 0)


def main(what: str, *more: str) -> int:
    """Do what the first argument says."""
    if what == "shipped":
        return shipped(int(more[0]) if more else FLOORS, more[1:])
    if what == "compiled":
        return compiled()
    with tempfile.TemporaryDirectory() as folder:
        return projects(Path(more[0]) if more else Path(folder), more[1:])


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
