"""The viewer on a walking fleet, in a process of its own for the benchmark and the tests.

    python -m tui.bench.walking_viewer '{"width": 200, "height": 57, "robots": 1000, "notes": "FILE"}'

When the fleet walks, `notes` holds the native id of the thread that computes it.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

from automaton.evidence.history.watched_run import Run
from tui.bench.walking_fleet import Walk, walkers
from tui.playback.player import TICKS_PER_S
from tui.playback.run_source import Opening
from tui.terminal.options import Options
from tui.viewer.app import Viewer


def main(argument: str) -> int:
    """Show the fleet until somebody presses q."""
    wanted = json.loads(argument)
    resolved = walkers(wanted["width"], wanted["height"], wanted["robots"])
    fps = wanted.get("fps", 30)
    per_second = wanted.get("ticks", fps)  # one tick a frame unless it says otherwise
    speed = math.inf if per_second is None else per_second / TICKS_PER_S

    def begin() -> list[Run]:
        return [Walk(resolved)]

    viewer = Viewer(
        Opening(("walk",), (resolved,), True, begin),
        Options(read_only=True, fps=fps, speed=speed),
    )

    def note() -> None:
        if viewer.session.player is None:
            viewer.set_timer(0.05, note)
        else:
            if not wanted.get("panels", True):
                viewer.panels.show("off")
            Path(wanted["notes"]).write_text(str(viewer.session.player.thread))

    viewer.call_later(note)
    viewer.run()
    viewer.session.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
