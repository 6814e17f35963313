"""What tests do with reports: ask for one, and look at its tables."""

from __future__ import annotations

from typing import Any

from automaton.commands import main
from automaton.documents.report_document import Table


def report(capsys: Any, *arguments: str) -> tuple[int, str, str]:
    """The command's exit code, and what it said."""
    capsys.readouterr()
    code = main(["report", *arguments])
    out, err = capsys.readouterr()
    return code, out, err


def tables(blocks: Any) -> list[Table]:
    return [block for block in blocks if isinstance(block, Table)]
