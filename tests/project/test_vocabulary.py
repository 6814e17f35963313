"""One vocabulary: every state has a word, and no other module keeps a table of such words.

tests/tui/widgets/test_one_vocabulary.py compares what all displays call one robot.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from automaton.engine import state as codes
from automaton.engine.observation import CAUSES
from automaton.engine.robot_states import Task
from automaton.vocabulary import (
    ACTION_PHRASES,
    CONDITION_WORDS,
    ORDER_WORDS,
    STATE_WORDS,
    RobotState,
    phrase_of,
)

ROOT = Path(__file__).parents[2]
# What programs read, and names of other things.
EXCEPTIONS = {
    "automaton/engine/state.py": "names of actions",
    "automaton/engine/observation.py": "names of events",
    "automaton/drawings/looks.py": "names of colours",
    "automaton/history/narration.py": "kinds of sentences, which --only names",
    "automaton/calibration/log_lines.py": "fields of messages",
    "automaton/runs/metric_sums.py": "names of sums",
    "automaton/runs/run_report.py": "names of metrics",
}
# Of the same states in other forms: tables of them are other vocabularies.
VERBS = (
    *(
        "moves",
        "drives",
        "turns",
        "picks",
        "picks up",
        "drops",
        "tries",
        "waits",
        "charges",
        "queues",
    ),
    *("waits to be picked up", "on its way", "broken", "empty", "served"),
)


def test_each_action_state_condition_and_cause_has_a_word() -> None:
    assert len(ACTION_PHRASES) == codes.ACTION_COUNT == len(codes.ACTION_NAMES)
    texts = [text for one in ACTION_PHRASES for text in (one.present, one.past)]
    assert all(texts) and len(set(texts)) == len(texts), "pictures are read, too"
    assert len(set(STATE_WORDS)) == len(RobotState)
    assert len(CONDITION_WORDS) == codes.STATUS_REMOVED + 1
    assert len({cause.name for cause in CAUSES}) == len(CAUSES)
    orders = [value for name, value in vars(codes).items() if name.startswith("ORDER_")]
    assert set(ORDER_WORDS) == set(orders) - {codes.ORDER_LIST}


def test_words_are_those_of_the_page_on_robot_states() -> None:
    """A robot that works where it stands has the word of its task."""
    page = (ROOT / "docs/explanation/robot-states.md").read_text(encoding="utf-8")
    rows = {line.split(" | ")[0].removeprefix("| ") for line in page.splitlines()}
    assert rows >= set(CONDITION_WORDS) - {"gone"}
    tasks = {task.name.lower().replace("_", " ") for task in Task}
    by_task = (RobotState.IDLE, RobotState.PICKING, RobotState.DROPPING, RobotState.TRYING)
    by_task += (RobotState.AT_STOP, RobotState.CHARGING, RobotState.QUEUEING, RobotState.PARKED)
    assert {STATE_WORDS[state] for state in by_task} <= tasks & rows
    by_motion = {STATE_WORDS[RobotState.DRIVING], STATE_WORDS[RobotState.WAITING]}
    assert by_motion <= rows


def words_in(node: ast.AST) -> Iterator[str]:
    """Yield the texts of a literal, those of a dict's values alone."""
    inner: list[ast.expr] = []
    if isinstance(node, ast.Dict):
        inner = node.values
    elif isinstance(node, ast.Tuple | ast.List | ast.Set):
        inner = node.elts
    elif isinstance(node, ast.Starred):
        inner = [node.value]
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    for one in inner:
        yield from words_in(one)


def test_no_other_module_keeps_such_words() -> None:
    known = {
        *STATE_WORDS,
        *map(phrase_of, RobotState),
        *CONDITION_WORDS,
        *ORDER_WORDS.values(),
        *VERBS,
    }
    known |= {text for one in ACTION_PHRASES for text in (one.present, one.past)}
    tables = {}
    for path in sorted(path for top in ("automaton", "tui") for path in (ROOT / top).rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Dict | ast.Tuple | ast.List | ast.Set):
                words = known & set(words_in(node))
                if len(words) >= 3 and name != "automaton/vocabulary.py":
                    tables[name] = words
    assert tables.keys() == EXCEPTIONS.keys(), tables


def test_the_words_are_there_without_numba_and_textual() -> None:
    text = (
        "import sys, automaton.vocabulary; sys.exit(bool({'numba', 'textual'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", text], check=False).returncode == 0
