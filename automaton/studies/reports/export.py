"""Reports for other programs: records as CSV, rows as CSV and Parquet, a workbook, a JSON object.

Each record is a point and metric, or a comparison, in the units of the rows: ticks and cells. Column
names of factors have no dots, which pandas, DuckDB and spreadsheets interpret; empty columns are
omitted. In CSV, text is quoted, including seeds, since spreadsheets keep only 15 digits of a number. A
text that looks like a formula gets a leading apostrophe.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from automaton.atomic_write import atomic_writer
from automaton.documents.report_document import (
    Block,
    Folded,
    NumberText,
    PageBreak,
    ReportDocument,
    Text,
)
from automaton.documents.workbook import fill_sheet, openpyxl, sheet_lines
from automaton.printable import FORMULA_SIGNS
from automaton.studies.inference.intervals import Interval
from automaton.studies.reports.build_report import StudyReport
from automaton.studies.reports.comparison_tables import factor_effects
from automaton.studies.reports.comparisons import (
    Answer,
    Comparison,
    is_what_if,
    mean_of,
    point_name,
)
from automaton.studies.reports.first_page import (
    answer_sentence,
    decision,
    question,
    recommended,
)
from automaton.studies.reports.metric_tables import Scenarios, summary
from automaton.studies.reports.site_pages import period_records
from automaton.studies.reports.study_results import Results, described
from automaton.studies.reports.what_if import what_if_question, what_if_records
from automaton.studies.sweeps.study import (
    PERIODS_COLUMN,
    SCENARIO_FACTOR,
    SERIES_COLUMN,
    SUMS_COLUMN,
    USES_COLUMN,
    Point,
)
from automaton.tables.table_files import MAX_SHEET_ROWS, too_many_in_sheet

Record = dict[str, Any]
ROWS_BEGIN: Final = b"key,"  # the first column
SUMMARY_BEGINS: Final = b"point,"
COMPARISONS_BEGIN: Final = b"metric,"
PERIODS_BEGIN: Final = b"point,point_name,runs,"
PARQUET_BEGINS: Final = b"PAR1"
SHARE_COLUMNS: Final = ("mean", "low", "high", "sd", "bound", "difference")  # of a share
SEED_COLUMN: Final = "seed"  # a number of 63 bits
Records = Sequence[Mapping[str, Any]]


def column_names(names: Sequence[str]) -> list[str]:
    """Column names without dots, such as `fleet_robots`; duplicates get an additional _."""
    out: list[str] = []
    for name in names:
        plain = name.replace(".", "_")
        while plain in out:
            plain += "_"
        out.append(plain)
    return out


def summary_records(results: Results, scenarios: Scenarios) -> Iterator[Record]:
    """One record for each metric of the report and each point."""
    for metric in results.reported:
        unit, _ = described(metric)
        for point in results.points:
            one = summary(results, scenarios, point, metric)
            yield {
                "point": point.number,
                **level_columns(results, point),
                "metric": metric,
                "unit": unit,
                **interval_columns("mean", one.interval),
                "sd": one.sd,
                "skew": one.skew if one.interval else None,
                "bound": one.bound,
                "measured": one.interval.n if one.interval else 0,
                "runs": one.counts.done,
                "unfinished": one.counts.censored,
                "failed": one.counts.failed,
                "same_runs_as": _first_same(results, point),
            }


def _first_same(results: Results, point: Point) -> int | None:
    first = results.first_same[point.number]
    return None if first == point.number else first


def level_columns(results: Results, point: Point) -> Record:
    """The scenario and the levels of a point, by column."""
    names = results.study.factor_names
    plain = column_names(names)
    levels = {column: point.levels.get(name) for name, column in zip(names, plain, strict=True)}
    return {SCENARIO_FACTOR: point.scenario, **levels}


def interval_columns(name: str, interval: Interval | None) -> Record:
    """A value under its name, with the ends of its interval."""
    if interval is None:
        return {name: None, "low": None, "high": None}
    return {name: interval.value, "low": interval.low, "high": interval.high}


def comparison_records(results: Results, compared: Sequence[Comparison]) -> Iterator[Record]:
    """One record for each declared comparison."""
    for one in compared:
        found = one.effect
        needed = one.needed
        yield {
            "metric": one.metric,
            "unit": described(one.metric)[0],
            "point": one.a.number,
            "against": one.b.number,
            "point_name": point_name(results.study, one.a),
            "against_name": point_name(results.study, one.b),
            **interval_columns("difference", found.difference),
            "relative": found.relative.value if found.relative else None,
            "relative_low": found.relative.low if found.relative else None,
            "relative_high": found.relative.high if found.relative else None,
            "p": found.p,
            "p_adjusted": one.adjusted,
            "family": one.family,
            "paired": found.paired,
            "correlation": found.correlation,
            "variance_ratio": found.variance_ratio,
            "needs_paired": needed.paired if needed else None,
            "needs_unpaired": needed.unpaired if needed else None,
            "runs": one.runs[0],
            "runs_against": one.runs[1],
        }


def answer_records(
    results: Results, answers: Sequence[Answer], sentences: Sequence[str]
) -> Iterator[Record]:
    """One record for each answer, with points by number."""
    for answer, sentence in zip(answers, sentences, strict=True):
        leading, best = answer.leading, answer.best
        yield {
            "conditions": answer.conditions,
            "metric": answer.metric,
            "better": answer.better,
            "decision": decision(results, answer),
            "recommended": None if (point := recommended(answer)) is None else point.number,
            "sentence": sentence,
            "certainty": 1 - results.analysis.error,  # of all answers together
            "best": None if best is None else best.number,
            "leading": None if leading is None else leading.number,
            "mean": None if leading is None else mean_of(results, leading, answer.metric),
            "candidates": [point.number for point in answer.candidates],
            "compared": [point.number for point in answer.compared],
            "incomplete": [point.number for point in answer.incomplete],
        }


def periods_of_points(report: StudyReport, every: str | None) -> list[Record]:
    """One record for each point and period. Raises InputError for a period that runs do not have."""
    return without_empty(list(period_records(report.results, report.scenarios, every)))


def without_empty(records: Sequence[Mapping[str, Any]]) -> list[Record]:
    """The records without columns that are empty in all of them."""
    used = {name for record in records for name, value in record.items() if not is_empty(value)}
    return [{name: v for name, v in record.items() if name in used} for record in records]


def is_empty(value: Any) -> bool:
    """Whether a cell is empty."""
    return value is None or (isinstance(value, float) and math.isnan(value))


# CSV and Parquet.


def rows_table(table: Any) -> Any:
    """An Arrow table for export, with plain column names and without empty columns."""
    used = [name for name in table.column_names if table.column(name).null_count < len(table)]
    out = table.select(used)
    return out.rename_columns(column_names(used))


def without_sums(table: Any) -> Any:
    """A table without sums by stretch, use and period, which spreadsheets cannot read."""
    hidden = (SUMS_COLUMN, USES_COLUMN, PERIODS_COLUMN)
    names = [name for name in table.column_names if name not in hidden]
    return table.select(names)


def columns_for_sheets(table: Any) -> dict[str, list[Any]]:
    """The columns of rows for spreadsheets: lists as JSON, seeds as text."""
    return {
        name: [cell_value(name, value) for value in table.column(name).to_pylist()]
        for name in without_sums(table).column_names
    }


def cell_value(name: str, value: Any) -> Any:
    """A value in a form that spreadsheets can hold."""
    if isinstance(value, list | dict):
        return json.dumps(value, ensure_ascii=False)
    return str(value) if name == SEED_COLUMN and value is not None else value


def write_rows_csv(table: Any, path: Path) -> None:
    """Write all rows as CSV. Raises InputError."""
    columns = columns_for_sheets(rows_table(table))
    write_csv(list(columns), zip(*columns.values(), strict=True), path)


def write_records_csv(
    records: Sequence[Mapping[str, Any]], head: Sequence[str], path: Path
) -> None:
    """Write records as CSV; `head`: the columns if there are no records. Raises InputError."""
    names = list(records[0]) if records else list(head)
    lines = ([cell_value(name, record[name]) for name in names] for record in records)
    write_csv(names, lines, path)


def write_csv(head: Sequence[str], lines: Iterable[Iterable[Any]], path: Path) -> None:
    """Write a table as CSV, completely or not at all. Raises InputError."""
    with atomic_writer(path) as file:
        file.write((",".join(map(_csv_head, head)) + "\n").encode())
        for line in lines:
            file.write((",".join(map(csv_cell, line)) + "\n").encode())


def _csv_head(name: str) -> str:
    return csv_cell(name) if set(name) & set(',"\r\n') else name


def csv_cell(value: Any) -> str:
    """Quote text, write numbers as they are, and leave missing values empty.

    Text that spreadsheets would read as a formula gets an apostrophe.
    """
    if isinstance(value, str):
        text = f"'{value}" if value.startswith(FORMULA_SIGNS) else value
        return '"' + text.replace('"', '""') + '"'
    return "" if value is None else str(value)


def write_parquet(table: Any, path: Path) -> None:
    """Write all rows as Parquet. Raises InputError."""
    import pyarrow.parquet

    with atomic_writer(path) as file:
        pyarrow.parquet.write_table(rows_table(table), file, write_page_checksum=True)


# An Excel workbook, by openpyxl (extra `excel`):
#
#     answer       the first page, in the units of the reader
#     summary      a line for each point and metric, in the units of the runs
#     tables       the tables of the report, in the units of the reader
#     comparisons  a line for each declared comparison, in the units of the runs
#     periods      a line for each point and period, in the units of the runs
#     rows         a line for each run


def write_workbook(
    document: ReportDocument,
    summaries: Records,
    compared: Records,
    periods: Records,
    rows: Any,
    path: Path,
) -> None:
    """Write a workbook with a report and its rows. Raises InputError, also without openpyxl."""
    book = openpyxl("workbooks are written").Workbook(write_only=True)
    if len(rows) >= MAX_SHEET_ROWS:
        raise too_many_in_sheet("rows", len(rows))
    end = next((i for i, b in enumerate(document.blocks) if isinstance(b, PageBreak)), 0)
    columns = columns_for_sheets(rows_table(rows))
    columns.pop(SERIES_COLUMN, None)  # a list by window, longer than a cell may be
    fill_sheet(book, "answer", (line for b in document.blocks[:end] for line in sheet_lines(b)))
    fill_sheet(book, "summary", record_lines(with_percent(summaries)), has_head=True)
    fill_sheet(book, "tables", (line for b in document.blocks[end:] for line in table_lines_of(b)))
    fill_sheet(book, "comparisons", record_lines(with_percent(compared)), has_head=True)
    fill_sheet(book, "periods", record_lines(with_percent(periods)), has_head=True)
    shares = {name for name in columns if described(name)[0] == "share"}
    columns |= {name: list(map(as_percent, columns[name])) for name in shares}
    lines = [list(columns), *zip(*columns.values(), strict=True)]
    fill_sheet(book, "rows", lines, has_head=True)
    with atomic_writer(path) as file:
        book.save(file)


def with_percent(records: Records) -> Records:
    """The records with shares as percentages, whose cells keep their fractions."""
    return [
        {
            name: as_percent(value)
            if name.startswith(("relative", "stations", "chargers"))
            or (record.get("unit") == "share" and name in SHARE_COLUMNS)
            else value
            for name, value in record.items()
        }
        for record in records
    ]


def as_percent(value: Any) -> Any:
    """A share as a cell in percent."""
    return NumberText(f"{100 * value:.2f} %", value) if isinstance(value, float) else value


def record_lines(records: Records) -> Iterable[Sequence[Any]]:
    """A header line, then the records."""
    if not records:
        return [["none"]]
    names = list(records[0])
    return [names, *([cell_value(name, record[name]) for name in names] for record in records)]


def table_lines_of(block: Block) -> list[Sequence[Any]]:
    """The lines of a block in the sheet of tables: headings, notes and tables, but no files."""
    is_file = isinstance(block, Folded) or (isinstance(block, Text) and block.code)
    return [] if is_file else sheet_lines(block)


# One JSON object.


def as_json(report: StudyReport, every: str | None = None) -> dict[str, Any]:
    """The report as printed by `automaton report --json`; missing values are null.

    `every`: the period of results by hour. Raises InputError.
    """
    results = report.results
    study, analysis = results.study, results.analysis
    is_compared = is_what_if(results)
    asked = (what_if_question if is_compared else question)(results) if analysis.metrics else None
    sentences = [answer_sentence(results, answer) for answer in report.answers]
    return {
        "study": study.name,
        "summary": study.summary,
        "question": asked,
        "answers": list(answer_records(results, report.answers, sentences)),
        "remarks": list(report.notes),
        "design": {
            "design": study.design,
            "replications": study.max_replications,
            "seed": study.seed,
            "common_random_numbers": study.common_random_numbers,
            "paired": study.paired,
            "error": analysis.error,
            "warm_up": max(results.warm_ups) if results.cut is None else results.cut.ticks,
            "code": results.version,
        },
        "points": [
            {"point": point.number, "scenario": point.scenario, **point_keys(point)}
            for point in results.points
        ],
        "metrics": list(summary_records(results, report.scenarios)),
        "periods": list(period_records(results, report.scenarios, every)),
        "effects": list(effect_records(results)),
        "comparisons": list(comparison_records(results, report.compared)),
        "what_if": list(what_if_records(results, report.compared)) if is_compared else [],
    }


def point_keys(point: Point) -> Record:
    """The name of a point and what it sets, or its levels."""
    return {"name": point.name, "set": point.settings} if point.name else {"levels": point.levels}


def effect_records(results: Results) -> Iterator[dict[str, Any]]:
    """The effects of the factors on each metric; empty if factors are not crossed."""
    metrics = () if results.study.is_named else results.analysis.metrics
    for metric in metrics:
        effects = factor_effects(results, metric) if results.has(metric) else None
        if effects is None:
            continue
        yield {
            "metric": metric,
            "family": effects.family,
            "shares": [
                {"factors": list(factors), "share": share}
                for factors, share in effects.shares.items()
            ],
            "main": [
                {
                    "factor": one.factor,
                    "level": one.level,
                    "mean": one.mean,
                    "against": one.against or None,
                    **interval_columns("difference", one.difference),
                }
                for one in effects.main
            ],
            "interactions": [
                {
                    "factors": list(one.factors),
                    "levels": list(one.levels),
                    "against": list(one.against),
                    **interval_columns("difference", one.difference),
                }
                for one in effects.interactions
            ],
        }
