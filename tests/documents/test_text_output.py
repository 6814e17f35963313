"""Documents as text: where prose and tables break, and what a terminal gets besides."""

from __future__ import annotations

import io

import pytest

from automaton.documents.html_output import as_html
from automaton.documents.report_document import (
    INDENT,
    CharacterPicture,
    Heading,
    Listed,
    ReportDocument,
    ShareBars,
    StyledText,
    Table,
    Text,
)
from automaton.documents.text_output import as_markdown, as_text, print_document

PATH = "/some/long/path/of-a-recording-with-hyphens.rec"


def lines(*blocks: object, width: int) -> list[str]:
    return as_text(ReportDocument("", list(blocks)), width).splitlines()  # type: ignore[arg-type]


def test_prose_breaks_at_blanks_alone() -> None:
    told = Text(f"recorded in {PATH} by --strategy-timeout 5")
    assert lines(told, width=20) == ["recorded in", PATH, "by", "--strategy-timeout 5"]


def test_a_number_keeps_its_unit_of_per_cent() -> None:
    assert lines(Text("a share of 83 %"), width=13) == ["a share of", "83 %"]


def test_lines_of_a_list_hang() -> None:
    assert lines(Listed(["one two three"]), width=9) == ["- one two", "  three"]
    first, more = Listed(["one two three"], mark=""), Listed(["four five six"], mark=INDENT)
    assert lines(first, more, width=11) == ["one two", "  three", "  four five", "    six"]


def test_blank_lines_stand_between_blocks_that_do_not_belong_together() -> None:
    parts = Heading("title", 3), Text("one"), Text("two"), Listed(["of two"], mark=INDENT)
    assert lines(*parts, Listed([], mark=""), width=80) == ["title", "one", "", "two", "  of two"]


def test_a_table_loses_silent_columns_before_its_heads_wrap() -> None:
    table = Table(["name", "never", "much said"], [["a", "-", "1"], ["b", "-", "2"]])
    assert lines(table, width=22) == [
        "name  never  much said",
        "----  -----  ---------",
        "a         -          1",
        "b         -          2",
    ]
    assert lines(table, width=21)[0] == "name never much said"
    assert lines(table, width=19)[0] == "name  much said"
    assert lines(table, width=14)[0] == "name much said"
    assert lines(table, width=10) == [
        "      much",
        "name  said",
        "----  ----",
        "a        1",
        "b        2",
    ]


def test_cells_wrap_at_blanks() -> None:
    table = Table(["name", "meaning"], [["a", "what it is good for"]], left=2)
    assert lines(table, width=18) == [
        "name  meaning",
        "----  ------------",
        "a     what it is",
        "      good for",
    ]


def test_a_table_that_cannot_be_narrow_comes_in_parts() -> None:
    table = Table(["robot", "moves", "turns", "waits"], [["0", "11", "22", "33"]], left=0)
    assert lines(table, width=12) == [
        "robot moves",
        "----- -----",
        "    0    11",
        "",
        "robot turns",
        "----- -----",
        "    0    22",
        "",
        "robot waits",
        "----- -----",
        "    0    33",
    ]


def test_columns_below_one_name_stay_together() -> None:
    groups = [("T_total", 2), ("T_R", 2)]
    table = Table(["N", *["paper", "ours"] * 2], [list("12345"), [], list("67890")], groups=groups)
    whole = ["   T_total      T_R", "N  paper  ours  paper  ours"]
    assert lines(table, width=40)[:2] == whole and lines(table, width=40)[4] == ""
    parts = lines(table, width=14)
    assert [line.split() for line in parts if "ours" in line] == [["N", "paper", "ours"]] * 2
    assert as_markdown(ReportDocument("", [table])).startswith("| N | T\\_total paper | ours |")


def test_wide_signs_are_aligned() -> None:
    table = Table(["type", "n"], [["機器人", "1"], ["tug", "2"]])
    assert lines(table, width=80)[2:] == ["機器人  1", "tug     2"]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def on_terminal(document: ReportDocument) -> str:
    out = Terminal()
    print_document(document, out)
    return out.getvalue()


STYLED = ReportDocument(
    "",
    [
        Heading("title", 2),
        Table(["claim"], [[StyledText("holds", "green")]]),
        CharacterPicture([[("d", "bold #009e73"), (".", "")]]),
    ],
)


def test_a_terminal_gets_emphasis_in_place_of_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.delenv("COLORTERM", raising=False)
    text = on_terminal(STYLED)
    assert text.startswith("\x1b[1mtitle\x1b[0m\n\n\x1b[1;4mclaim\x1b[0m\n\x1b[32mholds\x1b[0m\n")
    assert text.endswith("\x1b[1;38;5;36md\x1b[0m.\n")
    monkeypatch.setenv("COLORTERM", "truecolor")
    assert on_terminal(STYLED).endswith("\x1b[1;38;2;0;158;115md\x1b[0m.\n")
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b[1mtitle" in on_terminal(STYLED) and "\nholds\n" in on_terminal(STYLED)
    monkeypatch.setenv("TERM", "dumb")
    assert on_terminal(STYLED) == as_text(STYLED)


def test_shares_are_a_bar_on_terminals_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "20")
    bar = ShareBars("time", [("", [("driving", 0.75, "#e69f00"), ("idle", 0.25, "#bdbdbd")])])
    text = on_terminal(ReportDocument("", [bar])).splitlines()
    assert text[1:] == ["█" * 15 + "▓" * 5, "█ driving 75 %", "▓ idle 25 %"]
    assert (
        as_text(ReportDocument("", [bar])) == as_markdown(ReportDocument("", [bar])).strip() == ""
    )
    drawing = as_html(ReportDocument("", [bar]))
    assert 'width="480.0"' in drawing and "driving 75.0 %" in drawing


def test_several_bars_share_one_legend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "20")
    driving, idle = ("driving", 0.5, "#e69f00"), ("idle", 0.5, "#bdbdbd")
    bars = ShareBars("time", [("one", [driving, idle]), ("two", [("idle", 1.0, "#bdbdbd")])])
    text = on_terminal(ReportDocument("", [bars])).splitlines()
    assert text == ["one  ████████▓▓▓▓▓▓▓", "two  " + "▓" * 15, "█ driving  ▓ idle"]
    named = ShareBars("time", [("a name of the bar", [driving, idle]), ("two", [idle])])
    text = on_terminal(ReportDocument("", [named])).splitlines()
    assert text[:2] == ["a name of the bar", "█" * 10 + "▓" * 10]  # a long name is above its bar
    assert [*map(list, bars.table.rows)] == [
        ["one", "50.0 %", "50.0 %"],
        ["two", "0.0 %", "100.0 %"],
    ]
    drawing = as_html(ReportDocument("", [bars]))
    assert drawing.count('fill="#bdbdbd"') == 3 and ">two</text>" in drawing
