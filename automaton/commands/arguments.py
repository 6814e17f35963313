"""What several commands share: arguments, JSON, and notes and progress on stderr."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from automaton.atomic_write import atomic_writer, cannot_write_error
from automaton.commands.status_line import STATUS_LINE
from automaton.engine.jit.compile_progress import COMPILING
from automaton.errors import InputError
from automaton.printable import wrapped
from automaton.scenario.document import Override, parse
from automaton.scenario.quantities import is_clock_time
from automaton.scenario.schema import MAX_REFINEMENT
from automaton.scenario.text_files import read_text
from automaton.world.resolved import Resolved
from automaton.world.scenario_warnings import scenario_warnings

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

    from automaton.documents.report_document import ReportDocument
    from automaton.world.resolved import Resolved


def add_scenario_arguments(parser: argparse.ArgumentParser) -> None:
    """The scenario and the changes to it: `scenario`, `seed` and `settings`."""
    text = "a scenario file, or the name of a shipped scenario"
    parser.add_argument("scenario", metavar="SCENARIO", help=text)
    text = "use this seed instead of the seed in the scenario"
    parser.add_argument("--seed", type=int, metavar="N", help=text)
    add_settings_argument(parser)


def add_settings_argument(
    parser: argparse.ArgumentParser,
    text: str = "change a value of the scenario, such as fleet.robots=3; may be repeated",
) -> None:
    """The changes to a scenario: `settings`; `text` says which values may change."""
    parser.add_argument(
        "--set",
        action=AppendSettings,
        default=[],
        dest="settings",
        metavar="KEY=VALUE",
        help=f"{text}; @FILE reads settings from a file",
    )


class AppendSettings(argparse.Action):
    """Collect KEY=VALUE; @FILE adds a setting for each key of the first two levels of a file."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Append to the settings given before."""
        more = settings_in(Path(values[1:])) if values.startswith("@") else [values]
        setattr(namespace, self.dest, [*getattr(namespace, self.dest), *more])


def settings_in(path: Path) -> list[str]:
    """The settings in a file, as KEY=VALUE. Raises InputError."""
    if not path.is_file():
        raise InputError("no such file", str(path))
    data, _ = parse(read_text(path), str(path))
    if not isinstance(data, dict):
        text = "a settings file must contain keys of a scenario, such as strategy"
        raise InputError(text, str(path))
    return [
        f"{key}={json.dumps(value)}"
        for section, part in data.items()
        for key, value in (
            ((f"{section}.{name}", one) for name, one in part.items())
            if isinstance(part, dict)
            else ((section, part),)
        )
    ]


def add_refinement_arguments(parser: argparse.ArgumentParser) -> None:
    """The refinement of the tick, and when strategies decide: both go into `settings`."""
    parser.add_argument(
        "--refine",
        type=whole("a refinement", 1, MAX_REFINEMENT),
        metavar="K",
        help="divide each tick into K shorter ones: every number of ticks is multiplied by K",
    )
    parser.add_argument(
        "--decide",
        choices=("coarse", "fine"),
        help="with --refine, let strategies decide as often as without it (coarse, the default) or "
        "in every tick (fine)",
    )


def settings_of(args: argparse.Namespace) -> tuple[str | Override, ...]:
    """The settings of a scenario, its refinement included. Raises InputError."""
    refined = []
    if args.refine is not None:
        refined.append(Override(f"--refine {args.refine}", ("refine",), args.refine))
    if args.decide is not None:
        if args.refine is None:
            raise InputError("needs --refine K", f"--decide {args.decide}")
        refined.append(Override(f"--decide {args.decide}", ("decide",), args.decide))
    return (*args.settings, *refined)


def add_recording_argument(parser: argparse.ArgumentParser, name: str = "FILE") -> None:
    """The recording: `file`."""
    parser.add_argument("file", type=Path, metavar=name, help="a recording; may be incomplete")


def add_json_argument(parser: argparse._ActionsContainer) -> None:
    """Whether to print JSON: `json`."""
    parser.add_argument("--json", action="store_true", help="print one JSON object, not text")


# The formats of an answer. XLSX needs a file; the others may go to stdout.

TEXT, MARKDOWN, HTML, JSON, XLSX = FORMATS = ("text", "markdown", "html", "json", "xlsx")
FORMAT_BY_SUFFIX: Final = {
    ".md": MARKDOWN,
    ".html": HTML,
    ".htm": HTML,
    ".txt": TEXT,
    ".json": JSON,
    ".xlsx": XLSX,
}


class Output(NamedTuple):
    """The format of an answer and its file; None: stdout."""

    format: str
    file: Path | None

    def write(self, document: Callable[[], ReportDocument], data: Callable[[], Any]) -> None:
        """Write the document, or its data as JSON. Raises InputError."""
        if self.format == XLSX and self.file is not None:
            from automaton.documents.workbook import write_sheet

            write_sheet(document(), self.file)
        elif self.file is not None:
            with atomic_writer(self.file) as file:
                file.write(rendered(self.format, document, data).encode())
        elif self.format == TEXT:
            print_document(document())
        else:
            print(rendered(self.format, document, data), end="")
        if self.file is not None:
            note(f"wrote {self.file}")


def add_output_arguments(parser: argparse.ArgumentParser, option: str = "--out") -> None:
    """The format of an answer, and a file for it: `format`, `json`, and `out` or another option."""
    form = parser.add_mutually_exclusive_group()
    formats = ", ".join(FORMATS)
    text = f"set the output format: {formats} (default: by the extension of {option}, else text)"
    form.add_argument("--format", choices=FORMATS, metavar="FORMAT", help=text)
    add_json_argument(form)
    text = "write the report to one self-contained FILE"
    parser.add_argument(option, type=Path, metavar="FILE", help=text)


def output_of(args: argparse.Namespace, option: str = "--out") -> Output:
    """The format and file of the answer, checked before any computation. Raises InputError."""
    file: Path | None = getattr(args, option.strip("-"))
    form = JSON if args.json else args.format
    if form == XLSX and file is None:
        raise InputError(f"needs {option} FILE", "--format xlsx")
    if form is None and file is not None:
        form = FORMAT_BY_SUFFIX.get(file.suffix.lower())
        if form is None:
            known = ", ".join(FORMAT_BY_SUFFIX)
            raise InputError(
                f"no format has this extension (known: {known}); use --format", f"{option} {file}"
            )
    if file is not None:
        check_writable(file)
    if form == XLSX and file is not None:
        from automaton.documents.workbook import check_replaced, openpyxl

        check_replaced(file)
        openpyxl("workbooks are written")
    return Output(form or TEXT, file)


def rendered(form: str, document: Callable[[], ReportDocument], data: Callable[[], Any]) -> str:
    """An answer in a text format."""
    if form == JSON:
        return json.dumps(data(), indent=2, ensure_ascii=False) + "\n"
    if form == HTML:
        from automaton.documents.html_output import as_html

        return as_html(document())
    from automaton.documents.text_output import as_markdown, as_text

    return as_markdown(document()) if form == MARKDOWN else as_text(document())


def check_writable(path: Path) -> None:
    """Check that a file can be written, before a long computation. Raises InputError."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise cannot_write_error("this is not a regular file", path)
    if not path.parent.is_dir():
        raise cannot_write_error(f"there is no folder {path.parent}", path)
    if not os.access(path.parent, os.W_OK):
        raise cannot_write_error("permission denied", path)


def add_workers_argument(parser: argparse.ArgumentParser, most: int | None = None) -> None:
    """The number of processes: `workers`."""
    processes, text = (
        whole("a number of processes", 1, most),
        "use N processes (default: one per core)",
    )
    parser.add_argument("--workers", type=processes, metavar="N", help=text)


def add_timeout_argument(parser: argparse.ArgumentParser) -> None:
    """The time limit of a decision: `strategy_timeout`."""
    parser.add_argument(
        "--strategy-timeout",
        type=whole("a number of seconds", 1),
        metavar="S",
        help="fail a run if a Python strategy takes more than S seconds for one decision",
    )


def print_warnings(resolved: Resolved) -> None:
    """Print a warning for settings that are legal but probably mistakes."""

    for warning in scenario_warnings(resolved):
        note(f"{resolved.scenario.name}: warning: {warning}")


def note(text: str) -> None:
    """Print a sentence on stderr."""
    sys.stdout.flush()  # keeps the order where both streams meet
    print(f"automaton: {text}", file=sys.stderr, flush=True)


def say(text: str) -> None:
    """Print a sentence; on a terminal it wraps at blanks."""
    print(wrapped(text) if sys.stdout.isatty() else text)


def show_line(text: str | Callable[[], str]) -> None:
    """Say in the last line of a terminal what a command does now; "" names the command alone."""
    STATUS_LINE.show(text)


def print_json(data: Any) -> None:
    """Print an object as JSON."""
    print(json.dumps(data, indent=2, ensure_ascii=False))


def print_document(document: ReportDocument) -> None:
    """Print an answer as text."""
    from automaton.documents import text_output

    text_output.print_document(document)


@contextlib.contextmanager
def progress_bar(*columns: str | ProgressColumn) -> Iterator[Progress]:
    """A bar on stderr, for terminals only; it disappears at the end."""
    from rich.console import Console
    from rich.progress import Progress

    COMPILING.on_terminal, before = False, COMPILING.on_terminal  # sentences above the bar
    try:
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            yield bar
    finally:
        COMPILING.on_terminal = before


def whole(name: str, least: int, most: int | None = None) -> Callable[[str], int]:
    """The type of an argument that is a whole number; `name` appears in errors: "a tick"."""

    def read(text: str) -> int:
        number = int(text) if text.isdecimal() and len(text) < 19 else -1
        if not least <= number <= (number if most is None else most):
            raise argparse.ArgumentTypeError(f"{text!r} is not {name}: allowed are {allowed}")
        return number

    allowed = f"whole numbers from {least}" if most is None else f"{least} to {most}"
    return read


tick = whole("a tick", 0)


def tick_or_time(text: str) -> int | str:
    """The type of an argument that is a tick, or a clock time (if the run has a clock)."""
    return text if is_clock_time(text) else tick(text)


frame_rate = whole("a frame rate", 1, 120)


def measured(
    name: str, example: str, read: Callable[[str], Fraction | None]
) -> Callable[[str], Fraction]:
    """The type of an argument above 0 with a unit; `read` converts its text to m, s or m/s."""

    def amount(text: str) -> Fraction:
        value = read(text) if len(text) <= 40 else None
        if value is None or not Fraction(1, 10**6) <= value <= 10**6:
            raise argparse.ArgumentTypeError(f"{text!r} is not {name} such as {example}")
        return value

    return amount
