"""`automaton calibrate --orders FILE` without a log: fit the demand of a week to a file of orders.

`compare` reads orders with these options, too.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Mapping
from pathlib import Path

from automaton.atomic_write import atomic_writer
from automaton.calibration.demand import check_weeks, fit_demand, read_releases, week_csv
from automaton.commands.arguments import check_writable, note, output_of
from automaton.errors import InputError, nearest
from automaton.scenario.orders import LineColumns, TransportColumns

CSV: tuple[str, ...] = (".csv",)
FIELDS_OF_FORMS = (TransportColumns.__struct_encode_fields__, LineColumns.__struct_encode_fields__)
ORDER_FIELDS = tuple(dict.fromkeys(itertools.chain(*FIELDS_OF_FORMS)))


def add_orders_arguments(parser: argparse.ArgumentParser, text: str, several: bool = False) -> None:
    """The file of orders and how to read it: `orders`, `order_columns` and `order_time`."""
    add = parser.add_argument
    action = "append" if several else "store"
    add("--orders", type=Path, action=action, metavar="FILE", help=text)
    add(
        "--order-column",
        action="append",
        default=[],
        dest="order_columns",
        metavar="FIELD=NAME",
        help="the column of a field of --orders, such as released=CREATED; may be repeated",
    )
    text = 'the format of times in --orders, such as "%%d.%%m.%%Y %%H:%%M" (default: ISO 8601)'
    add("--order-time", metavar="FORMAT", help=text)


def order_columns(
    args: argparse.Namespace, fields: tuple[str, ...] = ORDER_FIELDS
) -> dict[str, str] | None:
    """The names of columns by field; None: columns have the names of fields. Raises InputError."""
    columns = {}
    options = {"--order-column": args.order_columns, "--order-time": args.order_time}
    if not args.orders:
        refuse_alone(options, "--orders FILE")
    for text in args.order_columns:
        field, sign, name = text.partition("=")
        if field not in fields or not sign or not name:
            hint = nearest(field, fields)
            known = ", ".join(fields)
            raise InputError(
                f"'{text}' is not FIELD=NAME{hint}; fields are {known}", "--order-column"
            )
        columns[field] = name
    return columns or None


def refuse_alone(options: Mapping[str, object], needed: str) -> None:
    """Refuse options that do nothing without another argument. Raises InputError."""
    for name, value in options.items():
        if value:
            raise InputError(f"{name} does nothing without {needed}")


def fit_orders(args: argparse.Namespace) -> int:
    """Fit the demand, write the file of rates, print. Raises InputError."""
    if args.out is None or args.out.suffix.lower() not in CSV:
        text = "without a log, --orders needs --out FILE.csv for the rates of the week"
        raise InputError(text)
    output = output_of(args, "--report")
    check_writable(args.out)
    columns = order_columns(args, ("released",))
    demand = fit_demand(read_releases(args.orders, columns, args.order_time))
    check_weeks(demand, str(args.orders))
    with atomic_writer(args.out) as stream:
        stream.write(week_csv(demand.rates).encode())
    note(f"wrote {args.out}")
    from automaton.calibration.demand_report import demand_document, demand_record

    named = str(args.orders), str(args.out)
    output.write(lambda: demand_document(demand, *named), lambda: demand_record(demand, *named))
    return 0
