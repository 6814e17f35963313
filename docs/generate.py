"""Generate reference pages from the code: `python docs/generate.py`.

Each page uses the data of the program: argument parsers, the structs of scenarios and studies, the
catalogue of strategies, metrics, key bindings, columns and frames. Plug-ins from other installed
packages are left out. A test compares the files with the pages that this module returns.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import json
import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import automaton
from automaton import python_api
from automaton.commands import COMMANDS
from automaton.engine import decisions, facilities, state, visibility
from automaton.engine.jit import structs
from automaton.engine.jit.field_kernels import hidden_fields
from automaton.engine.jit.structs import SCRATCH, Struct
from automaton.engine.observation import CAUSES, DEADLOCK_TICKS, EVENT_NAMES
from automaton.engine.record_codes import KEYFRAME_TICKS
from automaton.engine.refusals import DECISION_RULES, RULE_BITS, DecisionRule
from automaton.environments import Environment
from automaton.floor.floor_plan import CELL_KINDS, SYMBOLS, Symbol
from automaton.history.breakpoints import FIELDS
from automaton.recording import contents, frames
from automaton.runs import headless
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.scenario import quantities
from automaton.scenario.floor_section import generator_type, generators, json_schema
from automaton.scenario.quantities import SCHEMA_KEY, Quantity
from automaton.scenario.schema import LAYER_NAMES, Scenario
from automaton.scenario.validation import Plan, plan_of
from automaton.strategy import api, lookup, orders, paths, per_robot, weighted_tables
from automaton.studies.sweeps import run_keys, study
from automaton.studies.sweeps.study import study_schema
from automaton.tables.columns import TABLES
from automaton.units import LENGTH_UNITS, SPELLED, TIME_UNITS
from tui.registration import layers, panels
from tui.widgets.bindings import COMPARING, TOPICS, key_text

EVENTS: Final = {
    "deadlock": f"a wait cycle has lasted {DEADLOCK_TICKS} ticks",
    "wait cycle": "robots have begun to wait for each other in a cycle",
    "delivered": "a load is delivered; `delivered 7` means load 7",
    "zones redesigned": "stations move to another service zone",
    "stalled > 50": "a robot has waited for more than 50 ticks",
}
FOLDER: Final = Path(__file__).parent / "reference"
COMMAND: Final = "python docs/generate.py"
MARK: Final = f"<!-- Generated: `{COMMAND}` writes this page again. -->\n"
LONGEST_DEFAULT: Final = 60  # characters of a default value in a table

Schema = dict[str, Any]


def pages() -> dict[str, str]:
    """Return the text of each generated page by its file name."""
    return {
        "commands.md": commands_page(),
        "scenario.md": scenario_page(),
        "study.md": study_page(),
        "quantities.md": quantities_page(),
        "strategies.md": strategies_page(),
        "strategy-contract.md": contract_page(),
        "floors.md": floors_page(),
        "metrics.md": metrics_page(),
        "keys.md": keys_page(),
        "conditions.md": conditions_page(),
        "formats.md": formats_page(),
        "tables.md": tables_page(),
        "python.md": python_page(),
    }


def table(heading: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a Markdown table."""
    heading = list(heading)
    lines = [heading, ["---"] * len(heading), *(map(cell_text, row) for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def cell_text(text: str) -> str:
    """Return text escaped for a cell of a Markdown table."""
    return " ".join(text.split()).replace("|", "\\|")


def page(title: str, introduction: str, *sections: str) -> str:
    """Return a page: the mark of generated pages, title, introduction and sections."""
    return "\n".join([MARK, f"# {title}\n", introduction.strip() + "\n", *sections]).rstrip() + "\n"


def code(text: Any) -> str:
    return f"`{text}`"


# Commands


def commands_page() -> str:
    """Every command with its arguments, from the parsers."""
    overview = table(
        ("command", "what it does"),
        ((f"[{code(name)}](#{name})", summary) for name, (_, summary) in COMMANDS.items()),
    )
    return page(
        "Commands",
        "`automaton COMMAND --help` prints the same texts. Every command accepts `--debug`, "
        "which shows the traceback of an error. Errors go to standard error: one sentence "
        "each, with file and line if known. See also [exit codes and JSON output](json.md).",
        overview,
        *(_command_section(name) for name in COMMANDS),
    )


def parser_of(name: str) -> tuple[argparse.ArgumentParser, str]:
    """Return a command's parser and description."""
    module = importlib.import_module(COMMANDS[name][0])
    parser = argparse.ArgumentParser(prog=f"automaton {name}", add_help=False)
    module.add_arguments(parser)
    return parser, (module.__doc__ or "").split("\n\n")[0]


def _command_section(name: str) -> str:
    parser, description = parser_of(name)
    rows = [
        (_argument(action), (action.help or "").replace("%%", "%")) for action in parser._actions
    ]
    return f"## {name}\n\n{' '.join(description.split())}\n\n" + table(
        ("argument", "meaning"), rows
    )


def _argument(action: argparse.Action) -> str:
    value = action.metavar or (
        "{" + ",".join(map(str, action.choices)) + "}" if action.choices else action.dest.upper()
    )
    if not action.option_strings:
        optional = action.nargs in ("?", "*")
        return code(f"[{value}]" if optional else value)
    values = " ".join(value) if isinstance(value, tuple) else value
    suffix = "" if action.nargs == 0 else f" {values}"
    return ", ".join(code(option + suffix) for option in action.option_strings)


# Scenarios and studies


def scenario_page() -> str:
    """Every key of a scenario file, from the structs that read it."""
    definitions = json_schema()["$defs"]
    definitions["Scenario"]["properties"]["layout"] |= {
        "oneOf": [{"type": "`generator`, `picture`, `file` or `matrix`: see [floors](floors.md)"}]
    }
    layers = definitions["Strategies"]["properties"]
    for layer in LAYER_NAMES:
        layers[layer]["anyOf"] = [{"type": f"see [strategies](strategies.md#{layer})"}]
    own = definitions["TypeStrategy"]["properties"]["allocation"]
    own["anyOf"] = layers["allocation"]["anyOf"]
    sections = list(reachable("Scenario", definitions))
    return page(
        "Keys of a scenario",
        "A scenario is a YAML file. An unknown key, a wrong type and a value out of range are errors, "
        "reported with file and line. `automaton check FILE` checks a file without running it, and "
        "`automaton schema` prints the JSON Schema for an editor. Strategies and their parameters: "
        "[strategies](strategies.md). Layouts, cells and symbols: [floors](floors.md). "
        "A floor, a fleet and orders from scratch: [your own floor](../tutorials/your-own-floor.md).",
        *(struct_section(name, definitions, sections) for name in sections),
    )


def study_page() -> str:
    """Every key of a study file."""
    definitions = study_schema()["$defs"]
    return page(
        "Keys of a study",
        "A study is a YAML file: which scenarios run, what varies, how many replications, and which "
        "questions the runs answer. `automaton check FILE` checks it, and `automaton schema study` "
        "prints its JSON Schema. "
        "How to run one: [sweep a study](../how-to/sweep-a-study.md).",
        *(struct_section(name, definitions, definitions) for name in definitions),
    )


def reachable(name: str, definitions: Schema) -> dict[str, None]:
    """Return a struct and the structs it contains, in the order of its keys."""
    found = {name: None}
    for reference in re.findall(r"#/\$defs/([^\"]+)", json.dumps(definitions[name])):
        if reference not in found:
            found |= reachable(reference, definitions)
    return found


def struct_section(name: str, definitions: Schema, here: Iterable[str]) -> str:
    """Return a table of the keys of one struct."""
    definition = definitions[name]
    description = " ".join(definition.get("description", "").split())
    return f"## {name}\n\n{description}\n\n" + keys_table(definition, definitions, set(here))


def keys_table(definition: Schema, definitions: Schema, here: set[str], skip: str = "") -> str:
    """Return a table of keys: type, default, meaning."""
    required = definition.get("required", ())
    rows = [
        (
            code(key),
            type_text(value, definitions, here),
            "required" if key in required else _default(value),
            _meaning(value, definitions),
        )
        for key, value in definition.get("properties", {}).items()
        if key != skip
    ]
    return table(("key", "value", "default", "meaning"), rows)


def _meaning(schema: Schema, definitions: Schema) -> str:
    references = [one for one in (schema, *schema.get("anyOf", ())) if "$ref" in one]
    inherited = [definitions[_name(one)].get("description", "") for one in references]
    return str(schema.get("description") or "".join(inherited[:1]))


def _default(schema: Schema) -> str:
    if "default" not in schema:
        return ""
    text = json.dumps(schema["default"], ensure_ascii=False)
    text = text[1:-1] if text.startswith('"') else text
    return "see there" if len(text) > LONGEST_DEFAULT else code(text)


def _name(schema: Schema) -> str:
    return str(schema["$ref"]).rpartition("/")[2]


def type_text(schema: Schema, definitions: Schema, here: set[str]) -> str:
    """Return the values that a JSON Schema allows, in words."""
    if "$ref" in schema:
        name = _name(schema)
        if name in here:
            heading = name.lower().replace(".", "")
            return f"[{name}](#{heading})"
        return type_text(definitions[name], definitions, here)
    for choice in ("anyOf", "oneOf"):
        if choice in schema:
            forms = [type_text(one, definitions, here) for one in schema[choice]]
            return " or ".join(dict.fromkeys(forms))
    if "enum" in schema:
        return ", ".join(code("null" if one is None else one) for one in schema["enum"])
    if "const" in schema:
        return code(schema["const"])
    kind = schema.get("type", "anything")
    if kind == "array":
        return _array(schema, definitions, here)
    if kind == "object":
        return _object(schema, definitions, here)
    if SCHEMA_KEY in schema:
        return f"[{schema[SCHEMA_KEY]}](quantities.md)"
    words = {
        "string": "text",
        "integer": "whole number",
        "boolean": "true or false",
        "null": "`null`",
    }
    return words.get(kind, kind) + _range(schema)


def _array(schema: Schema, definitions: Schema, here: set[str]) -> str:
    if "prefixItems" in schema:
        items = ", ".join(type_text(one, definitions, here) for one in schema["prefixItems"])
        return f"[{items}]"
    if "items" in schema:
        return f"list of {type_text(schema['items'], definitions, here)}"
    return "list"


def _object(schema: Schema, definitions: Schema, here: set[str]) -> str:
    others = schema.get("additionalProperties")
    if isinstance(others, dict):
        return f"mapping to {type_text(others, definitions, here)}"
    named = ", ".join(schema.get("properties", {}))
    return f"mapping with {named}" if named else "mapping"


def _range(schema: Schema) -> str:
    bounds = [("minimum", "from {}"), ("exclusiveMinimum", "above {}")]
    bounds += [("maximum", "to {}"), ("exclusiveMaximum", "below {}")]
    said = [form.format(f"{schema[key]:,}") for key, form in bounds if key in schema]
    return f" {' '.join(said)}" if said else ""


# Units and quantities


READ_AS: Final = {  # quantity: the value that its text becomes
    "TIME": "ticks, rounded; not rounded if the key is a mean",
    "MOMENT": "the tick, rounded",
    "DUE": "ticks after the release, or {at: the tick of the clock time}, rounded",
    "STEP": "ticks of a move: `units.cell` / speed, rounded",
    "TURN": "ticks of a turn by 90 degrees, rounded",
    "GAP": "ticks between two events: 1 / rate; rounded, except for means",
    "PROBABILITY": "the probability per tick, not rounded",
    "SHARE_LIMIT": "a share from 0 to 1, not rounded",
    "CHARGE_RATE": "percent of a full battery per tick, not rounded",
    "CELLS": "cells, rounded",
    "LENGTH": "the unit of `units.cell`, not rounded",
    "METRES": "m, not rounded",
    "SECONDS": "seconds, not rounded",
    "MINUTES": "minutes, not rounded",
}
QUANTITY_RULES: Final = """
A plain number is in ticks, in cells, or a probability or percentage per tick. The keys in the table
below also accept text with a unit: `20 s` or `20s`, `1.5min`, `1e3 ms`, `00:10:00` (hours, minutes,
seconds). Such text requires that `units.tick` is a time; speeds and lengths in metres or feet also
require `units.cell`:

```yaml
units: {tick: 0.5 s, cell: 1.2 m, clock: "2026-03-02 06:00"}
durations: {move: 1.5 m/s, turn: 90 deg/s, pick: 8 s, drop: 00:00:08}
stop: {max_duration: 8 h}
faults: {mtbf: 400 h, repair_time: 2 h}
```

Text is read as an exact fraction. A duration is rounded to floor(duration / tick + 1/2) ticks;
means, rates and probabilities are not rounded. `automaton check` lists every inexact conversion
(`durations.move 1.5 m/s: 1.6 ticks -> 2, 25 % slower`) and warns of errors above 2 %. The warning
names the largest tick (of 1, 0.5, 0.25, 0.2, 0.1, 0.05, 0.02 and 0.01 s) that keeps all errors
within 2 %. A time above 0 that would become 0 ticks is an error.

A **clock time** is a date with a time, such as `2026-03-02 06:30`, or only a time, such as
`"06:30"`, on the day of `units.clock`. Tick 0 is at `units.clock`. A clock time has two parts and a
duration has three, so never write a duration as `00:10`. If a key accepts both and the scenario has
a clock, a text of three parts needs a date. Quote a time that YAML would read as a number to base
60: `"10:00"`.

`--set` and the levels of a study accept the same texts. Files of orders accept
[some of them](../how-to/orders-from-a-warehouse-system.md), and `--target` of `size` accepts times:
`'lead_time_p95<=15min'`.

A parameter of your own strategy accepts such text if you declare it as a quantity, for example
`Annotated[int, quantity(TIME, ge=1)]`; import both names from `automaton.scenario.quantities`.
"""


def quantities_page() -> str:
    """Units, texts with units, and the keys that accept them."""
    units = [
        (code(symbol), ", ".join(map(code, SPELLED.get(symbol, ()))), f"{decimal(size)} {base}")
        for table_of_units, base in ((TIME_UNITS, "s"), (LENGTH_UNITS, "m"))
        for symbol, size in table_of_units.items()
    ]
    units += [("`cells`", "`cell`", "`units.cell`"), ("`deg`", "`°`", ""), ("`%`", "", "")]
    kinds = {getattr(quantities, name): name for name in READ_AS}
    places: dict[str, list[str]] = {name: [] for name in READ_AS}
    for key, quantity in quantity_keys():
        places[kinds[quantity]].append(code(key))
    rows = [
        (getattr(quantities, name).described, read_as, ", ".join(dict.fromkeys(places[name])))
        for name, read_as in READ_AS.items()
    ]
    return page(
        "Units and quantities",
        QUANTITY_RULES,
        "## What may be written\n\n" + table(("text", "read as", "keys"), rows),
        "## Units\n\nA speed is a length, `cells` or `deg` per time (`m/s`, `km/h`, `cells/s`, "
        "`deg/s`). A rate is `/` and a time (`/h`), or percent per time (`%/h`).\n\n"
        + table(("unit", "also", "is"), units),
    )


def decimal(size: Fraction) -> str:
    """Return a fraction as a decimal number."""
    return f"{float(size):g}" if size < 1000 else f"{int(size):,}"


def quantity_keys() -> Iterator[tuple[str, Quantity]]:
    """Yield each key of a scenario that is a quantity."""
    yield from _keys_of(plan_of(Scenario), "")
    for layer in LAYER_NAMES:
        for name in _shipped(layer):
            yield from _keys_of(plan_of(lookup.parameters_type(layer, name)), f"strategy.{layer}.")


def _keys_of(plan: Plan, key: str) -> Iterator[tuple[str, Quantity]]:
    if plan.place is not None:
        yield key.rstrip("."), plan.place.quantity
    for name, inner in plan.fields.items():
        yield from _keys_of(inner, f"{key}{name}.")
    for inner in (*plan.items, *([plan.values] if plan.values else [])):
        yield from _keys_of(inner, key)


# Strategies


QUESTIONS: Final = {
    "zoning": "Which robot serves which part of the floor?",
    "charging": "When, where and how long does a robot charge?",
    "allocation": "Which order does a robot do next, and where does it drop the load?",
    "routing": "Which cells does a robot drive through?",
    "right_of_way": "Who moves, and what does a blocked robot do?",
}


def strategies_page() -> str:
    """Every shipped strategy with its parameters, from the catalogue."""
    definitions = json_schema()["$defs"]
    sections = [
        f"## {layer}\n\n{question}\n\n"
        + "\n".join(_strategy_section(layer, name, definitions) for name in _shipped(layer))
        for layer, question in QUESTIONS.items()
    ]
    return page(
        "Strategies and their parameters",
        "A scenario selects one strategy for each layer, by name (`strategy: {routing: "
        "astar}`) or with parameters (`strategy: {routing: {name: astar, tie_break: fifo}}`). "
        "`none` means no zoning or no charging. Lengths are in the unit of `units.cell`, or "
        "in cells if the scenario does not set it. If `units.tick` is not a time, a tick "
        "counts as one second. Name a strategy of your own as `module:Class`; see [your own "
        "strategy](../tutorials/your-own-strategy.md).",
        *sections,
    )


def _shipped(layer: str) -> list[str]:
    built_in = (name for name in lookup.names(layer) if lookup.is_built_in(layer, name))
    return [name for name in built_in if name != lookup.NO_STRATEGY]


def _strategy_section(layer: str, name: str, definitions: Schema) -> str:
    definition = definitions[f"{layer}-{name}"]
    summary = lookup.summary(layer, name)
    text = f"### {name}\n\n{summary[0].upper()}{summary[1:]}.\n\n"
    if list(definition["properties"]) == ["name"]:
        return text + "It has no parameters.\n"
    return text + keys_table(definition, definitions, set(), "name")


# The contract of a strategy


SEEN: Final = {
    "robots": state.Robots,
    "orders": state.Orders,
    "stops": facilities.Stops,
    "slots": facilities.Slots,
    "grid": facilities.Grid,
    "rules": facilities.Rules,
    "traffic": state.Traffic,
    "chargers": facilities.Chargers,
    "stations": facilities.Stations,
    "pods": facilities.Pods,
    "lines": facilities.Lines,
    "trips": facilities.Trips,
    "pod_stations": facilities.PodStations,
    "gates": facilities.Gates,
    "delays": facilities.Delays,
    "service_zones": facilities.ServiceZones,
    "service_zones.roads": facilities.Roads,
    "service_zones.design": facilities.Design,
}
DECIDED: Final = {
    "zoning": decisions.ZoningDecisions,
    "charging": decisions.ChargingDecisions,
    "allocation": decisions.AllocationDecisions,
    "routing": decisions.RoutingDecisions,
    "right_of_way": decisions.RightOfWayDecisions,
}
PUBLIC_SCRATCH: Final = ("holder", "order_taken")
HIDDEN_EXTENTS: Final = {  # along which limited sight hides rows (automaton.engine.visibility)
    state.Robots: ("n",),
    state.Orders: ("m",),
    facilities.Stations: ("k", "j"),
    facilities.ServiceZones: ("n", "m", "Z"),
    facilities.Design: ("S", "Z", "M"),
}
COMMAND_MEANINGS: Final = {
    "CMD_TAKE_ORDER": "allocation: reserve an order and drive to the pickup of its load, or to its "
    "next stop",
    "CMD_DROP_AT": "allocation: reserve a slot and drive to drop the load there",
    "CMD_PARK": "allocation: drive home; illegal for a robot that has an order or a load",
    "CMD_STEP": "right of way: one move, or the turn before it",
    "CMD_WAIT": "right of way: wait for some ticks",
    "CMD_RETREAT": "right of way: begin a retreat; the strategy is asked for each of its moves. A "
    "retreat of no moves plans again from the robot's cell",
    "CMD_HOLD": "right of way that steers: wait one tick (counted in `lost_held_back`)",
    "CMD_GO": "right of way that steers: turn towards a direction, move in it, or leave the parking bay",
    "CMD_TURN": "right of way: a quarter turn, 1 clockwise or 3 to the left, whatever lies ahead",
}
NAMED_VALUES: Final = {state.NIL: "NIL", state.KEEP: "KEEP", state.NEVER: "NEVER"}
FULL_SHELF: Final = (
    "A shelf holds one load. It is illegal to drop a load at a shelf that is full or reserved by "
    "another robot. A robot may take an order that another robot has reserved only if the order has "
    "no load and none of its stops has begun. The other robot then loses the order and is asked "
    "again. A batch gives an order to at most one robot. The view shows the reservations made before "
    "this batch. In `order_taken` and `slot_taken` a strategy may mark what it assigned earlier in "
    "this batch; the engine ignores these marks. A robot that gets nothing is asked again once an "
    "order or a reservation has changed. With `ask_again` it is asked in the next tick; so is a robot "
    "that cannot drop its load because the target is full.\n"
)
PUBLIC_CLOCK: Final = (
    *("tick", "undelivered", "revision", "next_release", "robots_down", "open_jobs"),
    *("zones_redesigned", "known_orders", "first_open"),
)
ENUMERATIONS: Final = {
    "orders.state": (state, "ORDER_"),
    "robots.goal_type": (state, "GOAL_"),
    "robots.action, rules.duration": (state, "ACTION_"),
    "robots.retry_state": (state, "RETRY_"),
    "robots.need": (state, "NEED_"),
    "robots.status": (state, "STATUS_"),
}
NO_VALUES: Final = "ORDER_LIST", "ACTION_COUNT"  # of an enumeration


def contract_page() -> str:
    """What a strategy is asked, sees and decides, from the declarations of the structs."""
    return page(
        "What a strategy sees and decides",
        "A strategy is called as `decide(view, batch, decisions, memory, workspace)`. How to write one: "
        "[your own strategy](../tutorials/your-own-strategy.md). These conventions hold:\n\n"
        "* Import everything from `automaton.strategy.api`: the class `Strategy`, the names in capitals, "
        "declarations of states, and kernels.\n"
        "* `NIL` (-1) means none.\n"
        "* `view.robots` and `batch.robot` use storage indices of the n robots. All other references to "
        "a robot are its identity; `view.robots.at_index` maps an identity to an index.\n"
        "* The other dimensions are m orders, s slots, K types of robots and C cells.\n"
        "* A flat cell is `y * view.grid.width + x`, counted with the border: cell [0, 0] of a scenario "
        "has x = y = 1.\n"
        "* Directions are 0 east, 1 south, 2 west, 3 north.",
        "## What it is asked\n",
        "The first `batch.count` rows are the robots that the layer must decide about, ordered by "
        "identity. A field of kind `() int64` is a number, which Python and kernels read and write as an "
        "attribute.\n",
        _fields_table(state.Batch, "", {}),
        table(("reason", "meaning"), _constants("REASON_")),
        "## What it sees\n",
        "`view` is the whole world, read-only. If a strategy sees only a part of it "
        "([what robots know](../explanation/information.md)), rows out of sight have the value in the "
        "last column; fields without such a value are always visible. "
        "`view.traffic.holder` is filled only for strategies with `holders = True`.\n",
        *(f"### view.{name}\n\n{_seen_section(one)}" for name, one in SEEN.items()),
        f"### view.clock\n\n{_summary(state.Clock)} Kernels and Python read `view.clock.tick`.\n",
        table(
            ("number", "meaning"),
            ((code(name), state.Clock.meanings[name]) for name in PUBLIC_CLOCK),
        ),
        "### Values\n",
        table(
            ("field", "its values"),
            (
                (code(field), ", ".join(map(code, _names(module, prefix))))
                for field, (module, prefix) in ENUMERATIONS.items()
            ),
        ),
        "## What it decides\n",
        "Row k of `decisions.<layer>` is for robot `batch.robot[k]`. The last column has the initial "
        "value of each decision; KEEP lets a robot continue. An illegal decision costs the robot a tick "
        "and is counted.\n",
        *(f"### decisions.{name}\n\n{_decided_section(one)}" for name, one in DECIDED.items()),
        "### Commands\n",
        table(
            ("command", "meaning"),
            ((code(n), COMMAND_MEANINGS[n]) for n in _names(decisions, "CMD_")),
        ),
        "### Rules\n",
        "A decision that breaks one of these rules is illegal. `run` lists the first three of "
        "a run and the number by rule; `run --events`, `explain` and `verify` name layer, "
        "robot, decision and what is allowed. N and D stand for values that a strategy gave, "
        "M for a limit of the run.\n",
        table(
            ("layer", "rule", "decision", "what is allowed"),
            (
                (LAYER_NAMES[number >> RULE_BITS], rule.name, *_rule_texts(rule))
                for number, rule in DECISION_RULES.items()
            ),
        ),
        "## What it remembers\n",
        "Declare a state in the same way as the world: `field(kind, meaning, role=CONSTANT)`. "
        'Declare a number that the strategy writes as `calls: int = field("() int64")` and '
        "write `state.calls += 1`; a number declared as `int64` cannot be written. The roles "
        "for strategies are CONSTANT, SCRATCH and STOP. A field without a role persists from "
        "tick to tick and continues in a branch, like a field of role STATE. It is not part "
        "of the digest, which covers only the world. Under a radius, a robot sees only its "
        "own row of fields whose first dimension is `n`; all other fields except CONSTANT "
        "ones are zeros.\n",
        table(("role", "meaning"), _roles()),
        "## One robot at a time\n",
        "With `@per_robot(layer)` a strategy is a function `decide(me, view)` that returns one of the "
        "decisions below, or None to continue (`automaton.strategy.per_robot`). "
        "`@per_robot(layer, memory=2)` gives each robot two numbers of its own, 0 at first, in "
        "`me.memory`.\n",
        *(
            f"### {name}\n\n" + table(("attribute", "meaning"), _members(one))
            for name, one in (
                ("me", per_robot.Me),
                ("view", per_robot.LocalView),
                ("order", per_robot.Order),
            )
        ),
        "### Decisions\n",
        table(("decision", "meaning"), _functions(per_robot, "Decision")),
        "## What it may call\n",
        "In Python, robots are storage indices and cells are flat. From `automaton.strategy.orders`, "
        "where `out` is `decisions.allocation` and `k` is the row of a robot in the batch:\n",
        table(("function", "meaning"), _functions(orders)),
        "From `automaton.strategy.paths`:\n",
        table(("function", "meaning"), _functions(paths)),
        "In kernels, from `automaton.strategy.api`:\n",
        table(("kernel", "meaning"), _kernels()),
        "`automaton.strategy.api` also has distance tables with a strategy's own weights, in addition to "
        "the tables of robot types. The strategy's state holds them, and its `reset` builds them.\n",
        table(("function", "meaning"), _functions(weighted_tables)),
        "These functions use `workspace` as scratch memory; `workspace.stop[0]` becomes nonzero when the "
        "run is aborted.\n",
    )


def _fields_table(struct: type[Struct], column: str, values: dict[str, int]) -> str:
    """Return a table of the fields of a struct, with a last column of `values` if given."""
    rows = (
        (code(name), code(one.kind), one.meaning, _value(values.get(name)))
        for name, one in struct._declared.items()
        if one.kind and (one.role != SCRATCH or name in PUBLIC_SCRATCH)
    )
    columns = 4 if values else 3
    heading = ("field", "kind", "meaning", column)
    return table(heading[:columns], (row[:columns] for row in rows))


def _rule_texts(rule: DecisionRule) -> tuple[str, str]:
    """Return the decision and what is allowed, with letters in place of numbers of a run."""
    cells = {"{value}": "N", "{cell}": "(x, y)", "{step}": "N", "{direction}": "D"}
    texts = []
    for text in (rule.decision, rule.allowed):
        for name, letter in cells.items():
            text = text.replace(name, letter)
        texts.append(re.sub(r"\{\w+\}", "M", text))
    return texts[0], texts[1]


def _value(number: int | None) -> str:
    return "" if number is None else code(NAMED_VALUES.get(number, number))


def _seen_section(struct: type[Struct]) -> str:
    hidden = {
        name: one.hidden
        for extent in HIDDEN_EXTENTS.get(struct, ())
        for name, one in hidden_fields(struct, extent).items()
    }
    if struct is facilities.Design:
        hidden["held"] = visibility.HIDDEN_POINT
    return f"{_summary(struct)}\n\n" + _fields_table(struct, "out of sight", hidden)


def _decided_section(struct: type[Struct]) -> str:
    defaults = {name: one.default for name, one in struct._declared.items()}
    text = _fields_table(struct, "initially", defaults)
    return f"{text}\n{FULL_SHELF}" if struct is decisions.AllocationDecisions else text


def _names(module: Any, prefix: str) -> list[str]:
    """The names with this prefix of whole numbers in a module."""
    numbers = (name for name, value in vars(module).items() if isinstance(value, int))
    return [name for name in numbers if name.startswith(prefix) and name not in NO_VALUES]


def _constants(prefix: str) -> Iterator[tuple[str, str]]:
    """Yield the constants of `state` with this prefix, each with its trailing comment."""
    for name in _names(state, prefix):
        yield code(name), _comment(state, name)


def _roles() -> Iterator[tuple[str, str]]:
    """Yield the roles of fields, each with its trailing comment."""
    for name, value in vars(structs).items():
        if name.isupper() and not name.startswith("_") and isinstance(value, str):
            yield code(name), _comment(structs, name)


def _comment(module: Any, name: str) -> str:
    """The trailing comment of a constant."""
    found = re.search(
        rf"^{name}: Final = .*?(?:  # (.*))?$", inspect.getsource(module), re.MULTILINE
    )
    return (found[1] if found else "") or ""


def _members(kind: type) -> Iterator[tuple[str, str]]:
    """Yield the public attributes of a class: fields with their comments, then the others."""
    stored = r"^ +(?:self\.([a-z]\w*) = \w+|([a-z]\w*): int(?: = \w+)?)(?:  # (.*))?$"
    for assigned, declared, comment in re.findall(stored, inspect.getsource(kind), re.MULTILINE):
        yield code(assigned or declared), comment
    for name, member in vars(kind).items():
        if not name.startswith("_") and isinstance(member, property):
            yield code(name), _summary(member)
        elif not name.startswith("_") and inspect.isfunction(member):
            yield code(_call(name, member)), _summary(member)


def _functions(module: Any, result: str = "") -> Iterator[tuple[str, str]]:
    """Yield the public functions of a module, only those that return `result` if given."""
    for name, one in vars(module).items():
        is_own = inspect.isfunction(one) and one.__module__ == module.__name__
        if (
            is_own
            and not name.startswith("_")
            and result in ("", inspect.signature(one).return_annotation)
        ):
            yield code(_call(name, one)), _summary(one)


def _kernels() -> Iterator[tuple[str, str]]:
    """Yield the public kernels for strategies, by name."""
    for name, one in sorted(vars(api).items()):
        function = getattr(one, "py_func", None)
        if function is not None:
            yield code(_call(name, function)), _summary(function)


def _call(name: str, function: Callable[..., Any]) -> str:
    """A call with the names of the arguments and their defaults."""
    arguments = inspect.signature(function).parameters.values()
    shown = (str(one.replace(annotation=one.empty)) for one in arguments if one.name != "self")
    return f"{name}({', '.join(shown)})"


def _summary(thing: Any) -> str:
    """The first paragraph of a docstring."""
    return " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())


# Floors


DRAWN: Final = ("PictureLayout", "FileLayout", "MatrixLayout", "LegendEntry")
EXITS: Final = "east", "south", "west", "north"


def floors_page() -> str:
    """Symbols and kinds of cells, and the parameters of generators."""
    definitions = json_schema()["$defs"]
    symbols = [
        (code(sign if sign != " " else "blank"), *_symbol(symbol))
        for sign, symbol in SYMBOLS.items()
    ]
    layouts = [
        f"### {name}\n\n{(generator_type(name).__doc__ or '').splitlines()[0]}\n\n"
        + keys_table(definitions[f"layout-{name}"], definitions, set(), "generator")
        for name in generators()
    ]
    return page(
        "Floors",
        "A floor is drawn (`layout: {picture: ...}`), read from a file (`file`, or `matrix` for a "
        "table of codes), or made by a generator (`layout: {generator: NAME}`). Cells are [x, y], "
        "from 0 at the upper left. Stations are numbered from 1, row by row from above and each row "
        "from the left.",
        "## Symbols\n",
        "`A` to `Z` mark start cells of robots, on plain floor or on a crossing. Define your "
        "own symbols in `legend`: `x: {kind: floor, capacity: 2, exits: [east, west]}`.\n",
        table(("symbol", "kind", "robots at a time", "exits", "load"), symbols),
        "* Robots do not drive over shelves, destinations, racks and docks, but serve them from an "
        "adjacent cell. With `world: {access_cell: fixed}` this is the first drivable side in the order "
        "east, west, south, north to pick, and west, east, north, south to drop. With `nearest` it is "
        "the adjacent cell nearest to the robot, in rows and columns. A strategy of your own may choose "
        "any.\n"
        "* `=` is a passing aisle: one robot each way.\n"
        "* Floor with a single exit is one-way: robots enter it from behind and from the sides.\n"
        "* A parking bay opens to one neighbour. If the first column of a picture holds parking bays, it "
        "is x = -1.\n"
        "* A matrix cannot have stations or chargers; draw such floors.\n"
        "* In pictures of a run, `@` is a cell with several robots.\n",
        "## Kinds of cells\n",
        table(("kind", "meaning"), ((code(kind.name), kind.meaning) for kind in CELL_KINDS)),
        "## Drawn floors\n",
        *(struct_section(name, definitions, DRAWN).replace("## ", "### ", 1) for name in DRAWN),
        "## Generators\n",
        *layouts,
    )


def _symbol(symbol: Symbol) -> Iterator[str]:
    kind = CELL_KINDS[symbol.kind]
    yield code(kind.name)
    yield {0: "any number"}.get(symbol.capacity, str(symbol.capacity)) if kind.drivable else ""
    ways = [way for bit, way in enumerate(EXITS) if symbol.exits >> bit & 1]
    yield "all" if len(ways) == len(EXITS) else ", ".join(ways)
    yield "yes" if symbol.loaded else ""


# Metrics, keys, formats


def metrics_page() -> str:
    """Every metric of a run, with its unit and meaning."""
    return page(
        "Metrics",
        "`run` prints the metrics in this order, `run --json` contains them under `metrics`, and each is "
        "a column in the rows of a sweep.\n\n"
        "* A metric that a run did not measure is absent, not 0. Metrics that a strategy adds come "
        "last.\n"
        "* Robot ticks are summed over all robots.\n"
        "* A tick of a robot is active if the robot moves, turns, picks up, drops, stands at a stop, "
        "charges or waits for a charger, or if it loses the tick by a wait, a refused move or a "
        "retreat. A tick is not active if the robot queues at a station, is held back, waits at a gate, "
        "is delayed or is down.\n"
        "* `measure: {warm_up: N}` in a scenario adds metrics of the tasks taken after N ticks. With "
        "`stop: {when: never}`, sweeps and `size` exclude these ticks from all metrics; `run` covers the "
        "whole run.",
        table(
            ("metric", "unit", "meaning"),
            ((code(name), unit, meaning) for name, (unit, meaning) in METRIC_CATALOGUE.items()),
        ),
    )


def foreign_actions() -> set[str]:
    """The actions that only layers and panels of other installed packages have."""
    own: set[str] = set()
    others: set[str] = set()
    for registered in (layers(), panels()):
        for name, one in registered.by_name.items():
            (own if name in registered.own else others).add(one.action)
    return others - own


def keys_page() -> str:
    """The keys of the viewer, from its bindings, without those of plug-ins."""
    brought = foreign_actions()
    sections = [
        f"## {topic.name}\n\n"
        + table(
            ("keys", "action", "what it does"),
            (
                (
                    " ".join(code(key_text(key)) for key in action.keys.split(",")),
                    action.label,
                    action.meaning + (" (two runs)" if action.id in COMPARING else ""),
                )
                for action in topic.actions
                if action.id not in brought
            ),
        )
        for topic in TOPICS
    ]
    return page(
        "Keys of the viewer",
        "Press `?` in the viewer for the same list. The mouse works, too: click a robot, a shelf or a "
        "cell, drag the map or the timeline, and turn the wheel to zoom.",
        *sections,
    )


def conditions_page() -> str:
    """Conditions on robots, and the causes of lost time for use in them."""
    return page(
        "Conditions and causes of waiting",
        "The viewer can stop at a condition (`b`) and find the robots that meet one (`/`). A "
        "condition is one of the events below, or an expression of the fields of a robot, "
        "with comparisons, `and`, `or` and `not`: `loaded and waiting > 20`, `cause == "
        "'head-on'`.",
        "## Events\n",
        table(
            ("condition", "holds when"), ((code(name), meaning) for name, meaning in EVENTS.items())
        ),
        "## Fields of a robot\n",
        table(("field", "meaning"), ((code(name), meaning) for name, meaning in FIELDS.items())),
        "## Causes of waiting\n",
        "Each tick that a robot loses has exactly one cause; `explain` and the panels of the "
        "viewer show it.\n",
        table(
            ("cause", "what is shown", "rule or reason"),
            ((code(cause.name), cause.meaning, cause.rule) for cause in CAUSES[1:]),
        ),
    )


TABLE_ROWS: Final = {  # table: what a row stands for
    "orders": "an order of the scenario",
    "lines": "a line of an order; the table is empty if orders have no lines",
    "trips": (
        "a trip of a pod, which is lifted, carried to stations and stored; if orders have no "
        "lines, a row is an order"
    ),
    "events": "an event (with `--events`)",
    "states": "the state of a robot after a tick (with `--states`)",
    "robots": "a robot, with the values of `run --json`",
    "stations": "a station that receives pods or works on parts",
    "cells": "a drivable cell (with `--events` or `--states`)",
}


def tables_page() -> str:
    """The tables of a run and their columns."""
    sections = []
    for name, columns in TABLES.items():
        sections.append(f"## {name}\n\nA row is {TABLE_ROWS[name]}.\n")
        if columns:
            rows = [(code(one.name), one.kind, one.meaning) for one in columns]
            sections.append(table(("column", "holds", "meaning"), rows))
    events = ", ".join(map(code, filter(None, EVENT_NAMES)))
    return page(
        "Columns of tables",
        "The tables of `automaton run SCENARIO --csv DIR`, `--parquet` and `--xlsx`, of "
        "`simulate(tables=True)` and of recordings: "
        "[how to make them](../how-to/tables-for-pandas-and-excel.md). "
        "If `units.tick` is a time, each column in ticks has a companion in seconds, such as `done_s` "
        "for `done`. Robots, orders, lines and trips are numbered from 0, pods from 1. Unknown values "
        "are empty.",
        *sections,
        f"## Names of events\n\n{events}. Causes are those of [waiting](conditions.md).\n",
    )


def formats_page() -> str:
    """Recordings and folders of results: format numbers, frames and columns."""
    kinds = {
        contents.FRAME_KIND_HEADER: "the inputs of the run",
        contents.FRAME_KIND_CONDITIONS: "settings from the next tick on: at tick 0 and at each branch",
        contents.FRAME_KIND_KEYFRAME: f"the state, every {KEYFRAME_TICKS:,} ticks and at the end",
        contents.FRAME_KIND_TICKS: (
            f"decisions, actions, changes and digests of up to {contents.FRAME_TICKS} ticks"
        ),
        contents.FRAME_KIND_END: "how the run ended; absent if the recording was cut short",
    }
    rows = [
        (str(kind), meaning, ", ".join(map(code, contents._FRAMES[kind].__struct_fields__)))
        for kind, meaning in kinds.items()
    ]
    state = [
        (code(part), ", ".join(map(code, arrays)))
        for part, arrays in contents.KEYFRAME_ARRAYS.items()
    ]
    columns = [(code(name), kind) for name, kind in study.RESULT_COLUMNS.items()]
    return page(
        "Formats of files",
        "Each format has a number. A file with another number is rejected with an error message.",
        f"## Recordings (format {frames.RECORDING_FORMAT})\n",
        "A recording is one append-only file: a preamble (magic bytes and the format number), then "
        "frames. A frame has its kind, length, last tick, a CRC-32, a seal (a hash of the frame and of "
        "the previous seal) and its payload: MessagePack compressed by zlib. Arrays are "
        "little-endian.\n",
        table(("frame", "content", "fields"), rows),
        "A keyframe contains these arrays:\n",
        table(("part", "arrays"), state),
        f"## Results of a sweep (format {run_keys.MANIFEST_FORMAT})\n",
        "The folder contains `study.yaml` with copies of the scenarios and files that it needs, "
        "`sweep.json` (format, study, code, and declarations with their times), and `rows/*.parquet`. A "
        "row is a run. After the columns below come one for each factor and one for each "
        "[metric](metrics.md), which is null if the run did not measure it. `delivered` and the metrics "
        "exclude the warm-up, if there is one; `ticks` and `orders` cover the whole run. Studies of a "
        f"steady state add `{study.SERIES_COLUMN}` (deliveries per window) and "
        f"`{study.SUMS_COLUMN}` (sums per section). If a tick is a time, "
        f"`{study.PERIODS_COLUMN}` contains the run by quarters of an hour (by hours if it is long). "
        f"`{study.USES_COLUMN}` has the robot ticks of the whole run by use.\n",
        table(("column", "type"), columns),
    )


# What `import automaton` offers


def python_page() -> str:
    """The functions and classes of the package `automaton`, from their docstrings."""
    returned = {"simulate": headless.Outcome, "read": python_api.RecordedRun}
    sections = []
    for name in automaton.OFFERED:
        thing = getattr(automaton, name)
        shown = name if inspect.isclass(thing) and name == "Strategy" else _call(name, thing)
        sections += [f"## {name}\n", f"{code(shown)}\n", _prose(thing)]
        if name == "Simulation":
            sections.append(table(("member", "meaning"), _members_whole(thing)))
        for kind in (returned[name],) if name in returned else ():
            rows = _members_whole(kind) if name == "read" else _outcome_rows(kind)
            sections += [f"### {kind.__name__}\n", _prose(kind), table(("member", "meaning"), rows)]
    importing = "from automaton.environments import Environment"
    prose = _prose(Environment).replace("import automaton", importing, 1)
    sections += ["## automaton.environments.Environment\n"]
    sections += [f"{code(_call('Environment', Environment))}\n", prose]
    sections.append(table(("member", "meaning"), _members_whole(Environment)))
    return page(
        "Python API",
        "`import automaton` offers the names on this page. Each is loaded when first used, so "
        "the import itself is fast. The text of an InputError is one sentence: the place, the "
        "value found, and the allowed values. See also [keys of scenarios](scenario.md), "
        "[metrics](metrics.md) and [what a strategy sees and decides](strategy-contract.md).",
        *sections,
    )


def _prose(thing: Any) -> str:
    """A docstring as Markdown; its indented lines are Python."""
    lines: list[str] = []
    for part in re.split(
        r"(?:^|\n\n)((?:    .*(?:\n|$)|\n+(?=    ))+)", inspect.getdoc(thing) or ""
    ):
        is_code = part.startswith("    ")
        text = textwrap.dedent(part).strip()
        if text:
            gap = "\n\n\n" if text.startswith("class") else "\n\n"
            lines.append(f"```python\nimport automaton{gap}{text}\n```" if is_code else text)
    return "\n\n".join(lines) + "\n"


def _members_whole(kind: type) -> Iterator[tuple[str, str]]:
    """Yield the public methods and properties of a class with their full docstrings."""
    for name, member in vars(kind).items():
        if not name.startswith("_") and (
            inspect.isfunction(member) or isinstance(member, property)
        ):
            call = name if isinstance(member, property) else _call(name, member)
            yield code(call), inspect.getdoc(member) or ""


def _outcome_rows(kind: type) -> Iterator[tuple[str, str]]:
    """Yield the fields of a NamedTuple with their comments, then its methods."""
    for line in inspect.getsource(kind).splitlines():
        field = re.match(r"    (\w+): [^#]*(?:# (.*))?$", line)
        if field:
            yield code(field[1]), field[2] or ""
    yield from _members_whole(kind)


def main() -> int:
    """Write the pages."""
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
        print(FOLDER / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
