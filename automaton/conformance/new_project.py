"""Write a project with a strategy that works at once, from the templates of this package."""

from __future__ import annotations

import keyword
import re
import sys
from pathlib import Path
from string import Template
from typing import Final, NamedTuple

from automaton.errors import InputError

TEMPLATES: Final = Path(__file__).with_name("templates")
NAME: Final = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
STATION_FLOOR: Final = "t...t\\n.....\\n.###.\\n.....\\nt...t"
CHARGER_FLOOR: Final = "t.c.t\\n.....\\n.###.\\n.....\\nt...t"
BATTERY: Final = (
    '\n        "battery": {"drain": {"move": 0.5}, "charge_rate": 5.0, "initial_charge": 30},'
)
CHARGING_REMARK: Final = """
The threshold must last for an order and the way to a charger after it: the strategy does not look at
orders. In `depots` as shipped a move uses 3 % of a battery, and robots strand unless `below` is about
80; in the example a move uses 0.5 %. The shipped `insertion` plans with the orders instead.
"""
REFUSAL_OF_PARTS: Final = '''
    def check_scenario(self, scenario, floor_plan):
        """Refuse parts: zones of a factory queue the orders of parts, which these do not."""
        if scenario.orders.parts is not None:
            return "parts need zones that queue orders, as strategies.zoning.zone_queues does"
        return None
'''


class LayerTemplate(NamedTuple):
    """What the project of a layer says, and its one parameter."""

    summary: str
    parameter: str
    kind: str
    default: str
    limits: str
    meaning: str
    example: str = "tabletop-1"  # scenario and settings of a run that shows the strategy
    remark: str = ""

    def example_run(self, layer: str, name: str) -> str:
        """The command that runs the example with the strategy."""
        return f"automaton run {self.example} --set strategy.{layer}={name}"


LAYERS: Final = {
    "zoning": LayerTemplate(
        "Fixed zones: each robot keeps the zone of its number.",
        *("period", "int", "50", "ge=1, le=1_000_000"),
        "ticks after which robots without a zone get one",
        "depots",
    ),
    "charging": LayerTemplate(
        "Below a threshold, a robot charges at the nearest charger until it is full.",
        *("below", "int", "20", "ge=1, le=100"),
        "charge in per cent below which a robot goes to charge",
        "depots --set battery.drain.move=0.05",
        CHARGING_REMARK,
    ),
    "allocation": LayerTemplate(
        "Every robot takes the nearest open order.",
        *("choice", "int", "1_000", "ge=1, le=1_000_000"),
        "number of open orders to choose from",
    ),
    "routing": LayerTemplate(
        "The shortest route; after a retreat around the robots in the way.",
        *("around_robots", "bool", "True", ""),
        "whether a route after a retreat avoids robots",
    ),
    "right_of_way": LayerTemplate(
        "Wait; after a few retries retreat by some moves and plan again.",
        *("retreat_moves", "int", "4", "ge=1, le=1_000"),
        "most moves of a retreat after the last retry",
    ),
}


def write_project(name: str, layer: str, compiled: bool, parent: Path) -> list[Path]:
    """Write the project into the folder `name` of another folder; returns its files.

    Raises InputError for a name that is taken or not allowed; then nothing is written.
    """
    from automaton.conformance.random_cases import plain_strategies

    check_name(name)
    folder = parent / name
    if folder.exists():
        raise InputError(
            "exists already; choose another name, or another folder with --to", f"{folder}"
        )
    module = name.replace("-", "_")
    template = LAYERS[layer]
    text = f'description="{template.meaning}"'
    limits = f"{template.limits}, " if template.limits else ""
    other = plain_strategies()
    del other[layer]
    values = {
        "name": name,
        "module": module,
        "kind": "".join(part.capitalize() for part in name.split("-")),
        "layer": layer,
        "summary": template.summary,
        "parameter": template.parameter,
        "default": template.default,
        "bounds": f"{template.kind}, Meta({limits}{text})",
        "example": template.example_run(layer, name),
        "remark": template.remark,
        "floor": CHARGER_FLOOR if layer == "charging" else STATION_FLOOR,
        "strategies": "\n".join(f'{" " * 12}"{one}": "{its}",' for one, its in other.items()),
        "check": REFUSAL_OF_PARTS if layer == "zoning" else "",
        "more": BATTERY if layer == "charging" else "",
    }
    form = "compiled" if compiled else "python"
    files = {
        folder / "pyproject.toml": "pyproject.toml",
        folder / "README.md": "README.md",
        folder / "src" / module / "parameters.py": "parameters.py",
        folder / "src" / module / "strategy.py": f"{layer}-{form}",
        folder / "tests" / f"test_{module}.py": "test.py",
    }
    texts = {file: filled(source, values) for file, source in files.items()}
    texts[folder / "src" / module / "__init__.py"] = f'"""{template.summary}"""\n'
    try:
        for file, content in texts.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(content, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", str(folder)) from error
    return sorted(texts)


def filled(source: str, values: dict[str, str]) -> str:
    """A template with its values."""
    text = (TEMPLATES / f"{source}.txt").read_text(encoding="utf-8")
    return Template(text).substitute(values)


def check_name(name: str) -> None:
    """Raises InputError for a name that cannot be that of a package and of a strategy."""
    from automaton.strategy.lookup import names

    module = name.replace("-", "_")
    if not NAME.fullmatch(name) or keyword.iskeyword(module):
        text = "a name has lower-case letters, digits and hyphens, and begins with a letter"
        raise InputError(f"{text}, such as nearest-first", name)
    if module in sys.stdlib_module_names:
        raise InputError("is a module of Python; choose another name", name)
    for layer in LAYERS:
        if name in names(layer):
            text = f"is the name of a strategy for {layer.replace('_', ' ')}; choose another"
            raise InputError(text, name)
