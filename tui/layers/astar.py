"""Cells explored by A*, and predicted paths of robots: figures 3 and 4 of Bhattathiri, Li & Kuhl.

explored     1 in cells explored by the search for the selected robot, 2 on the resulting path
predicted    by cell, the number of robots that will drive through it, without the selected one

tui.layers.astar_paths computes both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL, Array
from automaton.strategy.lookup import SEARCHES_BY_ASTAR, declares
from tui.render.cell_looks import heat_codes
from tui.render.layer import Layer, ScaleLine

if TYPE_CHECKING:
    from automaton.runs.simulation import Simulation
    from tui.layers.astar_paths import Paths
    from tui.render.scene import Choice, Scene
    from tui.render.styles import Entries, GlyphSet


EXPLORED, ON_PATH = 4, 7  # heat levels of explored cells and of the path
PREDICTED: Final = (3, 5, 6, 7, 8)  # heat levels of the least number of paths, one more, ...
MAX_RUNS_SHOWN: Final = 2  # runs shown at once
MAX_PREDICTED_PATHS: Final = 5  # largest choice of the least number of paths


class AstarLayer(Layer):
    """A* paths on the empty floor of the shown world; scratch memory is reused between pictures."""

    pause_s = 0.25

    def __init__(self) -> None:
        self._paths: list[Paths] = []  # of the runs shown last

    def numbers(self, simulation: Simulation, selected: int) -> Array:
        from tui.layers.astar_paths import Paths, ties_of  # imports Numba

        world, ties = simulation.world, ties_of(simulation.resolved.scenario)
        fitting = [paths for paths in self._paths if paths.fit(world, ties)]
        paths = fitting[0] if fitting else Paths(world, ties)
        self._paths = [paths, *(other for other in self._paths if other is not paths)][
            :MAX_RUNS_SHOWN
        ]
        return self.field(simulation, paths, selected)

    def field(self, simulation: Simulation, paths: Paths, selected: int) -> Array:
        """(C,) int32."""
        raise NotImplementedError

    def entries(self, scene: Scene, glyphs: GlyphSet) -> Entries:
        heat = heat_codes(glyphs)
        said = self.meanings(scene)
        return [((int(heat[level]),) if level else (), text) for level, text in said]

    def scale(self, scene: Scene, glyphs: GlyphSet) -> ScaleLine:
        heat, line = heat_codes(glyphs), ScaleLine()
        for level, words in self.short_meanings(scene):
            line += [(int(heat[level]),)] if level else []
            line += [words] if words else []
        return line

    def short_meanings(self, scene: Scene) -> list[tuple[int, str]]:
        """The meanings in a few words each, for one line."""
        raise NotImplementedError

    def meanings(self, scene: Scene) -> list[tuple[int, str]]:
        """Heat levels and their meanings now, with numbers of cells; level 0 has no sign."""
        raise NotImplementedError


class Explored(AstarLayer):
    """The cells that A* explores for the selected robot, if the scenario routes by A*.

    Otherwise the cells that A* would explore; the path may differ from the robot's route.
    """

    key, label, position = "f9,E", "Explored", 70
    meaning = "cells that A* explores for the selected robot"

    def field(self, simulation: Simulation, paths: Paths, selected: int) -> Array:
        from tui.layers.astar_paths import explored

        return explored(simulation.world, paths, selected)

    def levels(self, scene: Scene, values: NDArray[np.int32]) -> NDArray[np.uint8]:
        return np.array([0, EXPLORED, ON_PATH], np.uint8)[values]

    def meanings(self, scene: Scene) -> list[tuple[int, str]]:
        values, robot = scene.values, f"robot {scene.selected}"
        if scene.selected == NIL:
            return [(0, "explored: select a robot, and its search is shown")]
        if values is None or not values.any():
            return [(0, f"explored: {robot} has no goal")]
        found, path = np.count_nonzero(values), np.count_nonzero(values == 2)
        if is_hypothetical(scene):
            return [
                (0, f"hypothetical: this scenario routes by {scene.floor.routing}, not by A*"),
                (EXPLORED, f"A* would explore for {robot}: {found:,} cells"),
                (ON_PATH, f"the path that it would find: {path:,} cells"),
            ]
        return [
            (EXPLORED, f"explored by the search of A* for {robot}: {found:,} cells"),
            (ON_PATH, f"the path that it finds: {path:,} cells"),
        ]

    def short_meanings(self, scene: Scene) -> list[tuple[int, str]]:
        values = scene.values
        if scene.selected == NIL:
            return [(0, "explored: select a robot")]
        if values is None or not values.any():
            return [(0, f"explored: robot {scene.selected} has no goal")]
        explored, path = np.count_nonzero(values), np.count_nonzero(values == 2)
        return [
            *([(0, f"A*, hypothetical ({scene.floor.routing} routes)")] * is_hypothetical(scene)),
            (EXPLORED, f"explored {explored:,} cells"),
            (ON_PATH, f"path {path:,}"),
        ]

    def value_words(self, value: int) -> list[str]:
        return [["not explored"], ["explored"], ["explored", "on the path of A*"]][value]

    def shown(self, choice: Choice, again: bool) -> str:
        return "" if choice.robot != NIL else "select a robot, and the search for its way is shown"


def is_hypothetical(scene: Scene) -> bool:
    """Whether the scenario is known not to route by A*."""
    routing = scene.floor.routing
    return bool(routing) and not declares("routing", routing, SEARCHES_BY_ASTAR)


class Predicted(AstarLayer):
    """Predicted paths of other robots.

    Pressed again, the key raises the least number of paths by 1, from MAX_PREDICTED_PATHS to 1.
    """

    key, label, position = "f10,P", "Predicted", 80
    meaning = "where 2 or more others will drive; then 3, 4, 5, 1"
    counted = "robots will drive here"

    def field(self, simulation: Simulation, paths: Paths, selected: int) -> Array:
        return paths.counted(simulation.world, selected)

    def levels(self, scene: Scene, values: NDArray[np.int32]) -> NDArray[np.uint8]:
        table = np.array([0, *PREDICTED], np.uint8)
        levels: NDArray[np.uint8] = table[np.clip(values - (scene.least - 1), 0, len(PREDICTED))]
        return levels

    def meanings(self, scene: Scene) -> list[tuple[int, str]]:
        values, said = scene.values, list[tuple[int, str]]()
        others = "robots" if scene.selected == NIL else "other robots"
        if values is None:
            return []
        for at, level in enumerate(PREDICTED):
            many, more = scene.least + at, at == len(PREDICTED) - 1
            cells = np.count_nonzero(values >= many if more else values == many)
            words = f"{many}{' or more' if more else ''} {others} will drive here: {cells:,} cells"
            said.append((level, words))
        return said

    def short_meanings(self, scene: Scene) -> list[tuple[int, str]]:
        values, last = scene.values, scene.least + len(PREDICTED) - 1
        if values is None:
            return []
        if values.max(initial=0) < scene.least:
            return [(0, f"no cell through which {scene.least} or more will drive")]
        return [
            (0, f"robots to come: {scene.least}"),
            *((level, "") for level in PREDICTED),
            (0, f"{last} or more"),
        ]

    def title(self, choice: Choice) -> str:
        return f"predicted {choice.least}+"

    def shown(self, choice: Choice, again: bool) -> str:
        if again:
            choice.least = choice.least % MAX_PREDICTED_PATHS + 1
        others = "other robots" if choice.robot != NIL else "robots"
        return f"cells through which {choice.least} or more {others} will drive"
