"""`automaton run`: a run from the outside, what it prints, its exit codes and its errors."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from metrics_of_some_runs import OF_OTHER_RUNS

from automaton.commands import main
from automaton.runs.headless import WINDOW_TICKS, run_once
from automaton.runs.metrics import METRIC_CATALOGUE
from automaton.runs.simulation import RECORD_TICKS, Simulation
from automaton.studies.sizing.fleet_search import read_target
from automaton.units import Unit, listed, number, unit
from automaton.world.resolve import resolve
from automaton.world.rules import tick_length

METRICS = [name for name in METRIC_CATALOGUE if name not in OF_OTHER_RUNS]
NOTHING_LOST = ("lost_leaving_bay", "lost_illegal")  # in the runs below
STRATEGIES = '''
import msgspec
from automaton.engine.jit.structs import field
from automaton.engine.jit.structs import Struct
from automaton.engine.state import Array
from automaton.strategy.contract import Strategy

def one_over(x):
    return 1 / x

class Raises(Strategy):
    layer = "allocation"
    def decide(self, view, batch, decisions, memory, workspace):
        one_over(0)

class RaisesAtReset(Strategy):
    layer = "allocation"
    def reset(self, view):
        raise ValueError("no\\nroom")
    def decide(self, view, batch, decisions, memory, workspace):
        pass

class Quits(Strategy):
    layer = "allocation"
    def decide(self, view, batch, decisions, memory, workspace):
        raise SystemExit(0)

class Short(Strategy):
    layer = "allocation"
    def decide(self):
        pass

class Idle(Strategy):
    """Never does anything."""
    layer = "allocation"
    def decide(self, view, batch, decisions, memory, workspace):
        pass

class Asked(Struct):
    times: Array = field("(n,) int64")

class Counts(Idle):
    """Counts how often each robot was asked about."""
    counters = {"asked_robots": "times"}
    def reset(self, view):
        return Asked.sized({"n": len(view.robots.cell)})
    def decide(self, view, batch, decisions, memory, workspace):
        for k in range(batch.count):
            Asked.of(memory).times[batch.robot[k]] += 1
'''


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with strategies of one's own, as the current one."""
    (tmp_path / "own_strategies.py").write_text(STRATEGIES)
    (tmp_path / "own_broken.py").write_text("class X(:\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "own_strategies", raising=False)
    return tmp_path


def as_json(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    code = main(["run", *arguments, "--json"])
    printed: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert code == (0 if printed["finished"] or printed["stopped"] else 1)
    return printed


def test_json_says_what_was_run_and_what_came_out(capsys: pytest.CaptureFixture[str]) -> None:
    run = as_json(capsys, "tabletop-1", "--seed", "3", "--set", "fleet.robots=2")
    assert (run["scenario"], run["seed"], run["finished"]) == ("tabletop-1", 3, True)
    assert (run["orders"], run["delivered"]) == (50, 50)
    assert len(run["digest"]) == 16 and int(run["digest"], 16) >= 0
    assert list(run["metrics"]) == METRICS
    assert run["metrics"]["makespan"] == run["ticks"]
    assert [robot["robot"] for robot in run["robots"]] == [0, 1]
    assert not any(name in OF_OTHER_RUNS for robot in run["robots"] for name in robot)
    assert 0 < run["wall_s"] < 60


def test_the_command_runs_what_a_simulation_runs(capsys: pytest.CaptureFixture[str]) -> None:
    simulation = Simulation(resolve("tabletop-mini"), seed=5)
    simulation.run()
    run = as_json(capsys, "tabletop-mini", "--seed", "5")
    assert (run["digest"], run["ticks"]) == (simulation.digest, simulation.tick)


def test_looking_at_a_run_now_and_then_does_not_change_it() -> None:
    resolved = resolve("tabletop-2")
    seen: list[int] = []
    watched = run_once(resolved, on_window=lambda simulation: seen.append(simulation.tick))
    assert watched.digest == run_once(resolved).digest
    assert seen == [*range(0, watched.ticks, WINDOW_TICKS), watched.ticks]
    assert WINDOW_TICKS % RECORD_TICKS == 0


def test_the_report_in_a_pipe_has_100_columns_and_no_colours(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    assert main(["run", "tabletop-1"]) == 0
    text, errors = capsys.readouterr()
    lines = text.splitlines()
    assert lines[0].startswith("tabletop-1, 4 robots, seed 1: finished after ")
    assert lines[0].endswith(" cycles, 50 of 50 orders delivered")
    assert lines[1] == "allocation cooperative, routing shortest, right of way retreat"
    assert "\x1b" not in text and errors == ""
    assert max(map(len, lines)) <= 100
    assert all(line == line.rstrip() for line in lines)
    for name in (name for name in METRICS if name not in NOTHING_LOST):
        assert any(line.startswith(name) for line in lines), name
    assert not any(name in text for name in NOTHING_LOST), "no robot lost any time to them"
    assert "…" not in text


def test_times_are_told_in_the_units_of_the_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    settings = ["--set", "units.tick=0.5 s"]
    assert main(["run", "tabletop-mini", *settings]) == 0
    text = capsys.readouterr().out
    run = as_json(capsys, "tabletop-mini", *settings)
    also = f"({number(run['ticks'] / 120)} min, {run['ticks']:,} ticks)"
    assert f"finished after {number(run['ticks'] / 2)} s {also}" in text
    makespan = next(line for line in text.splitlines() if line.startswith("makespan"))
    assert f"{number(run['ticks'] / 2)}  s ({run['ticks']:,} ticks)" in makespan


def test_a_throughput_is_in_orders_by_1000_ticks_whatever_a_tick_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in reports and sizes, which compare scenarios; beside it, by the hour."""
    monkeypatch.setenv("COLUMNS", "80")
    told = []
    for settings in (["--set", "units.tick=1 cycle"], ["--set", "units={tick: 0.5 s, cell: 1 m}"]):
        assert main(["run", "tabletop-mini", *settings]) == 0
        lines = capsys.readouterr().out.splitlines()
        told.append([line.split() for line in lines if line.startswith("throughput")][-1])
        assert max(map(len, lines)) <= 100
    plain, timed = told
    assert plain[:4] == timed[:4] and plain[2:4] == ["orders/1000", "ticks"]
    hourly = number(as_json(capsys, "tabletop-mini")["metrics"]["throughput"] * 7.2)
    assert plain[-1] == "time" and timed[-2:] == [hourly, "/h"]


@pytest.mark.parametrize(
    ("text", "expected", "plural"),
    [
        ("1 cycle", Unit(1.0, "cycle"), "cycles"),
        ("0.5 s", Unit(0.5, "s"), "s"),
        ("2min", Unit(2.0, "min"), "min"),
        ("beat", Unit(1.0, "beat"), "beats"),
        ("0 s", Unit(1.0, "0 s"), "0 s"),
    ],
)
def test_units_are_a_number_and_a_name(text: str, expected: Unit, plural: str) -> None:
    assert unit(text) == expected
    assert expected.plural == plural


@pytest.mark.parametrize(
    ("tick", "seconds"),
    [
        ("0.635 seconds", 0.635), ("0.635 s", 0.635), ("1 sec", 1), ("250 ms", 0.25),
        ("10 milliseconds", 0.01), ("2 min", 120), ("1 minute", 60), ("0.5 hours", 1800), ("1 h", 3600),
        ("1 cycle", None), ("0 s", None),
    ],
)  # fmt: skip
def test_a_time_is_the_same_to_reports_zoning_and_sizes(tick: str, seconds: float | None) -> None:
    assert unit(tick).seconds == (None if seconds is None else pytest.approx(seconds))
    assert tick_length(tick) == (0 if seconds is None else round(1e6 * seconds))
    if seconds is not None:
        assert read_target("makespan<=2 hours", unit(tick)).value == pytest.approx(7200 / seconds)


def test_zoning_says_that_it_counts_a_tick_as_a_second(capsys: pytest.CaptureFixture[str]) -> None:
    for tick, told in (("1 hop", True), ("0.6 seconds", False), ("1 tick", False)):
        assert main(["check", "factory", "--set", f"units.tick={tick}"]) == 0
        assert ("zoning counts a tick as a second" in "".join(capsys.readouterr())) == told


def test_numbers_in_a_row_as_text() -> None:
    assert listed([3]) == "3"
    assert listed([1, 2, 5]) == "1, 2 and 5"
    assert listed(list(range(9)), most=3) == "0, 1, 2 ... (9 in all)"


def test_a_run_that_reaches_its_limit_exits_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "tabletop-1", "--set", "stop.max_duration=1500"]) == 1
    text, errors = capsys.readouterr()
    assert "NOT FINISHED after 1,500 cycles" in text
    assert errors.startswith("automaton: tabletop-1 did not finish within 1,500 ticks: ")
    assert "orders undelivered" in errors and errors.count("\n") == 1


def test_a_limit_is_named_in_ticks_and_in_the_unit_of_the_scenario(
    capsys: pytest.CaptureFixture[str],
) -> None:
    settings = ["--set", "units.tick=0.5 s", "--set", "stop.max_duration=12.5 min"]
    assert main(["run", "tabletop-1", *settings]) == 1
    _, errors = capsys.readouterr()
    assert "tabletop-1 did not finish within 1,500 ticks (12.5 min): " in errors


def test_driving_slowly_is_told_beside_lost_time(capsys: pytest.CaptureFixture[str]) -> None:
    slow = ("tabletop-1", "--set", "world.slowdown=zones", "--set", "fleet.robots=5")
    run = as_json(capsys, *slow)
    ticks = run["metrics"]["slowdown_ticks"]
    assert ticks > 0 and ticks == sum(robot["slowdown_ticks"] for robot in run["robots"])
    assert main(["run", *slow]) == 0
    figures, robots = capsys.readouterr().out.split("\nAll metrics")[1].split("\nrobot ")
    row = next(line for line in figures.splitlines() if line.startswith("slowdown_ticks"))
    assert row.split()[:2] == ["slowdown_ticks", number(ticks)]
    assert "extra duration of moves" in row
    assert "slowdown" in robots.splitlines()[0]
    shown = sum(int(line.split()[-1].replace(",", "")) for line in robots.splitlines()[2:7])
    assert shown == ticks and all(len(line) <= 80 for line in robots.splitlines())
    assert main(["run", "tabletop-mini"]) == 0
    assert "slowdown" not in capsys.readouterr().out


@pytest.mark.parametrize("command", [["list"], ["check", "tabletop-mini"]])
def test_a_reader_that_goes_away_is_no_failure(command: list[str]) -> None:
    """As a shell says of programs that end by SIGPIPE: 141."""
    reads, writes = os.pipe()
    os.close(reads)
    done = subprocess.run(
        [sys.executable, "-m", "automaton", *command], stdout=writes, stderr=subprocess.PIPE
    )
    os.close(writes)
    assert (done.returncode, done.stderr) == (141, b"")


def test_a_deadlock_names_the_robots_that_stand_still(capsys: pytest.CaptureFixture[str]) -> None:
    # Four robots that only ever wait meet head-on in an alley sooner or later.
    assert main(["run", "tabletop-1", "--set", "strategy.right_of_way=wait"]) == 1
    errors = capsys.readouterr().err
    assert "robots 0, 1, 2 and 3 have only waited since tick " in errors
    assert "deadlock: robots 1 and 2 form a wait cycle\n" in errors


def test_a_gridlock_is_named_though_the_run_has_no_other_end(
    capsys: pytest.CaptureFixture[str],
) -> None:
    crowd = ("warehouse-100", "--set", "layout.capacity=1", "--set", "fleet.robots=300")
    run = as_json(capsys, *crowd)
    assert run["finished"] and len(run["wait_cycles"]) > 2
    assert all(len(circle) > 1 and circle[0] == min(circle) for circle in run["wait_cycles"])
    assert main(["run", *crowd]) == 0
    first, more = run["wait_cycles"][0], len(run["wait_cycles"]) - 1
    said = f"deadlock: robots {listed(first)} form a wait cycle, and there are "
    assert f"{said}{more} more wait cycles\n" in capsys.readouterr().out


def test_robots_that_have_not_stood_for_long_are_in_no_deadlock(
    capsys: pytest.CaptureFixture[str],
) -> None:
    resolved = resolve("tabletop-1", ["fleet.robots=5", "strategy.right_of_way=wait"])
    until = 1024 + 63  # robots 1 and 2 have met head-on, but the last window is a short one
    assert run_once(resolved, until=until).circles == []
    assert run_once(resolved, until=until + 1).circles == [(1, 2)]
    assert as_json(capsys, "tabletop-1")["wait_cycles"] == []


def test_a_scenario_without_an_end_is_finished_at_its_limit(
    capsys: pytest.CaptureFixture[str],
) -> None:
    settings = ("--set", "stop.when=never", "--set", "stop.max_duration=100")
    assert as_json(capsys, "tabletop-1", *settings)["ticks"] == 100
    assert main(["run", "tabletop-1", *settings]) == 0
    assert "ran for 100 cycles" in capsys.readouterr().out


def test_stopped_before_its_last_tick_a_run_without_an_end_is_not_finished(
    capsys: pytest.CaptureFixture[str],
) -> None:
    settings = ("--set", "stop.when=never", "--set", "stop.max_duration=100")
    run = as_json(capsys, "tabletop-1", *settings, "--until", "60")
    assert (run["finished"], run["stopped"], run["ticks"]) == (False, True, 60)
    assert main(["run", "tabletop-1", *settings, "--until", "60"]) == 0
    assert "stopped after 60 cycles" in capsys.readouterr().out
    run = as_json(capsys, "tabletop-1", *settings, "--until", "100")
    assert (run["finished"], run["stopped"]) == (True, False)


def test_a_run_says_when_its_orders_ran_out(capsys: pytest.CaptureFixture[str]) -> None:
    settings = ("warehouse-100", "--set", "orders.count=30", "--set", "stop.max_duration=900")
    run = as_json(capsys, *settings)
    simulation = Simulation(resolve("warehouse-100", settings[2::2]))
    simulation.run()
    orders = simulation.world.orders
    taken, delivered = int(orders.dispatched.max()), int(orders.delivered.max())
    assert 0 < taken < delivered < 900
    assert run["orders_exhausted"] == {"taken": taken, "delivered": delivered}
    assert main(["run", *settings]) == 0
    assert (
        f"orders ran out: the last of 30 was taken at tick {taken}, the last delivered at "
        f"{delivered}; metrics include the idle robots after it\n"
    ) in capsys.readouterr().out.replace("\n  ", " ")
    early = as_json(capsys, *settings, "--until", str(delivered - 1))
    assert early["orders_exhausted"] == {"taken": taken, "delivered": None}
    assert as_json(capsys, *settings, "--until", str(taken))["orders_exhausted"] is None
    assert as_json(capsys, "tabletop-mini")["orders_exhausted"] is None  # it ends with its orders


def test_orders_that_are_still_to_come_have_not_run_out(capsys: pytest.CaptureFixture[str]) -> None:
    now_and_then = ("--set", "orders.count=30", "--set", "orders.mean_interarrival_time=60")
    run = as_json(capsys, "warehouse-100", *now_and_then, "--set", "stop.max_duration=900")
    assert 0 < run["delivered"] < 30 and run["orders_exhausted"] is None
    run = as_json(capsys, "warehouse-100", *now_and_then, "--set", "stop.max_duration=5000")
    assert run["delivered"] == 30 and run["orders_exhausted"] is not None


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["tabletop-7"], "tabletop-"),
        (["tabletop-1", "--seed", "-1"], "--seed -1: seed must be a whole number"),
        (["tabletop-1", "--seed", "x"], "--seed: 'x' is not a whole number"),
        (["tabletop-1", "--sed", "1"], "did you mean '--seed'?"),
        (["tabletop-1", "--set", "flet.robots=3"], "did you mean"),
        (["tabletop-1", "--set", "strategy.allocation=coperative"], "did you mean 'cooperative'?"),
        (["tabletop-1", "--record", "no/such/folder/x.rec"], "cannot write the recording"),
        ([], "SCENARIO"),
    ],
)
def test_bad_input_is_one_sentence(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", *arguments]) == 2
    text, errors = capsys.readouterr()
    assert text == "" and sentence in errors
    assert errors.startswith("automaton: ") and errors.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        (
            "own_strategies:Raises",
            "the allocation strategy 'own_strategies:Raises' raised "
            "ZeroDivisionError: division by zero ({file}:9)",
        ),
        ("own_strategies:RaisesAtReset", "raised ValueError: no room ({file}:19)"),
        ("own_strategies:Quits", "raised SystemExit: 0 ({file}:26)"),
        ("own_strategies:Short", "raised TypeError: Short.decide() takes 1 positional argument"),
        ("own_strategies:Idel", "did you mean 'Idle'?"),
        ("own_broken:X", "importing 'own_broken' raised SyntaxError"),
        ("own_missing:X", "cannot import 'own_missing'"),
    ],
)
def test_a_strategy_that_fails_is_named_with_its_line(
    own: Path, name: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["run", "tabletop-mini", "--set", f"strategy.allocation={name}"]
    assert main(arguments) == 2
    errors = capsys.readouterr().err
    assert sentence.format(file=own / "own_strategies.py") in errors
    assert errors.count("\n") == 1 and "Traceback" not in errors
    main([*arguments, "--debug"])
    assert "Traceback" in capsys.readouterr().err


def test_a_strategy_of_ones_own_is_found_in_the_current_folder(
    own: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ["--set", "strategy.allocation=own_strategies:Idle", "--set", "stop.max_duration=50"]
    assert main(["run", "tabletop-mini", *settings]) == 1
    text, errors = capsys.readouterr()
    assert "allocation own_strategies:Idle" in text
    assert "25 of 25 orders undelivered, nothing was delivered" in errors


def test_a_recorded_run_is_the_same_run_and_can_be_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "run.rec"
    plain = as_json(capsys, "tabletop-mini")
    recorded = as_json(capsys, "tabletop-mini", "--record", str(file))
    assert recorded["digest"] == plain["digest"]
    assert file.exists()
    assert main(["verify", str(file)]) == 0


def test_json_needs_neither_rich_nor_textual() -> None:
    code = (
        "import sys; from automaton.commands import main; main(['run', 'tabletop-mini', '--json']);"
        "print({m.partition('.')[0] for m in sys.modules} & {'rich', 'textual'}, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "set()"


def test_a_run_stops_where_it_is_told_and_draws_the_grid(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = str(tmp_path / "run.rec")
    until = ["--until", "200"]
    assert main(["run", "tabletop-mini", *until, "--picture", "--record", recording]) == 0
    out = capsys.readouterr().out
    assert "bB-+-C-+-+-+d\nb|s|s|$|$|s|d\n" in out
    assert "stopped after 200 cycles, 6 of 25" in out
    assert main(["verify", recording]) == 0


@pytest.mark.parametrize("tick", ["0", "-3", "soon"])
def test_a_tick_is_counted_from_one(tick: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "tabletop-mini", f"--until={tick}"]) == 2
    assert f"'{tick}' is not a tick" in capsys.readouterr().err


def test_what_a_strategy_counts_is_reported(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["tabletop-mini", "--set", "strategy.allocation=own_strategies:Counts"]
    arguments += ["--set", "stop.max_duration=5"]
    main(["run", *arguments])
    [line] = [x for x in capsys.readouterr().out.splitlines() if x.startswith("asked_robots")]
    assert line.split() == ["asked_robots", "3", "times", "counted", "by", "a", "strategy"]
    main(["run", *arguments, "--json"])
    assert json.loads(capsys.readouterr().out)["metrics"]["asked_robots"] == 3
