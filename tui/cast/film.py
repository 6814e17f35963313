"""A recording as pictures: the map as the viewer draws it, with a line or two below."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from automaton.engine.state import NIL
from automaton.errors import InputError, alternatives
from automaton.recording.recording_reader import title_of
from automaton.units import unit
from tui.cast.film_frame import aim, checked_size, size_for
from tui.cast.film_request import Request
from tui.cast.film_status import Status
from tui.playback.frame_cache import Pictures
from tui.playback.run_source import recorded
from tui.registration import failure, layer_named, layers
from tui.render.choice import Choice
from tui.render.depth import DEPTHS, Depth
from tui.render.glyphs import ASCII, SHADED, UNICODE, Codes
from tui.render.styles import Look

if TYPE_CHECKING:  # they need Numba
    from automaton.history.snapshot import Snapshot
    from tui.playback.playback_state import PlaybackState


class Film:
    """One recording, as requested. Nothing is played before pictures are asked for."""

    def __init__(self, path: Path, request: Request) -> None:
        """Raises InputError for a file that is not a recording, and for requests that it does not
        meet."""
        self._opening = recorded(path)
        (self.recording,), (self._resolved,) = self._opening.recordings, self._opening.resolved
        self.last = self.recording.ticks
        self.look = Look(DEPTHS[request.color], request.theme)
        bare = SHADED if self.look.depth == Depth.NONE else UNICODE
        self.glyphs = ASCII if request.ascii else bare
        self._choice = self._chosen(request)
        self._pictures = Pictures(self._opening, self.glyphs)
        self._status = self._said(request)
        floor_plan, robots = self._resolved.floor_plan, self._resolved.scenario.fleet.robots
        self.columns, self.rows = (
            checked_size(*request.size)
            if request.size
            else size_for(floor_plan, robots, request.zoom, self._status)
        )
        map_rows = self.rows - self._status.rows(self.columns)
        self._pictures.resize(map_rows, self.columns)
        aim(self._pictures.camera, request.zoom)

    @property
    def title(self) -> str:
        """The run in a few words; where its file lies is not among them."""
        recording = self.recording
        return title_of(self._resolved, recording.header["seed"], recording.stored())

    @property
    def size(self) -> str:
        """As it is said."""
        return f"{self.columns}x{self.rows}"

    def checked(self, tick: int) -> int:
        """A tick, if it was recorded. Raises InputError."""
        if tick > self.last:
            raise InputError(f"there is no tick {tick:,}: the recording ends at tick {self.last:,}")
        return tick

    def codes_at(self, ticks: Iterable[int]) -> Iterator[Codes]:
        """(rows, columns) codes of each of these ticks, which ascend.

        Raises InputError if the layer of another distribution raises.
        """
        from automaton.history.playback import Playback
        from automaton.history.snapshot import take_snapshot
        from tui.playback.laid_over import Overlays

        overlays = Overlays()
        playback = Playback(self.recording.header, self.recording.stored())
        robot, layer = self._choice.robot, self._choice.layer
        for tick in ticks:
            playback.go_to(tick)
            bare = take_snapshot(playback.simulation, robot, layer)
            codes = self._codes(overlays.laid_over(bare, playback.simulation, layer, playing=False))
            if failed := failure():
                raise InputError(failed)
            yield codes

    def _codes(self, snapshot: Snapshot) -> Codes:
        playback, camera = self._playback(snapshot), self._pictures.camera
        self._pictures.follow(playback, self._choice)
        scene = self._pictures.scene(playback, self._choice, 0)
        floor = self._pictures.picture(scene, self._choice, camera.rows, camera.columns)
        return np.vstack((floor, self._status.codes(snapshot, self.columns)))

    def _playback(self, snapshot: Snapshot) -> PlaybackState:
        from tui.playback.playback_state import PlaybackState

        return PlaybackState(
            runs=(),
            stops=0,
            seq=0,
            tick=snapshot.tick,
            snapshots=(snapshot,),
            figures=(),
            playing=1,
            asked=0.0,
            achieved=0.0,
            head=self.last,
            known=self.last,
            ends=(self.last,),
            live=False,
            stopped="",
            breakpoint_robots=(),
            side=0,
            error="",
        )

    def _chosen(self, request: Request) -> Choice:
        robots = self._resolved.scenario.fleet.robots
        if request.follow >= robots:
            raise InputError(
                f"there is no robot {request.follow}: the last one is robot {robots - 1}"
            )
        known, problems = layers().by_name, layers().problems
        if request.layer and request.layer not in known:
            about = [
                problem
                for problem in problems
                if not known or problem.startswith(f"layer {request.layer!r}")
            ]
            allowed = f"unknown layer '{request.layer}': allowed are {alternatives(list(known))}"
            raise InputError(about[0] if about else allowed)
        if request.layer == "explored" and request.follow == NIL:
            raise InputError("explored shows the search for one robot: --follow says for which")
        return Choice(request.follow, layer=request.layer, following=request.follow != NIL)

    def _said(self, request: Request) -> Status:
        scenario = self._resolved.scenario
        chosen = [request.layer] if request.layer else []
        chosen += [f"robot {request.follow}"] if request.follow != NIL else []
        lines = self.recording.header.get("lines")
        orders = max(lines["order"], default=-1) + 1 if lines else 0
        orders = orders or len(self.recording.header["orders"]["source"])
        tick = unit(scenario.units.tick)
        scene = self._pictures.scene(None, self._choice, 0)
        key = layer_named(request.layer).key_words(scene, self._resolved, self.glyphs)
        return Status(self.last, scenario.fleet.robots, orders, tick, "  ".join(chosen), key)
