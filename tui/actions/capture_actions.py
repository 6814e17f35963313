"""Actions that take the picture with them, as a drawing or as text."""

from __future__ import annotations

import io
import os
import re
from contextlib import suppress
from pathlib import Path

from tui.actions.viewer_base import ViewerBase
from tui.playback.recording_files import capture_file, short_path
from tui.render.image_export import as_text
from tui.render.map_overlays import zone_key
from tui.render.service_zone_overlay import design_key

FROM_THE_INTERNET = re.compile(r"@font-face\s*\{[^}]*\}|<!--.*?-->", re.DOTALL)


class CaptureActions(ViewerBase):
    """Captures."""

    def action_screenshot(self) -> None:  # type: ignore[override]  # it takes no file name
        svg = self.export_screenshot(title=f"automaton: {self.opening.name}")
        # It has painted everything, and with that forgot what was still to be painted.
        self.screen.refresh()
        self._save(without_links(svg), ".svg")

    def action_copy_text(self) -> None:
        texts = [
            f"{title}, tick {self._tick_of(side):,}\n{as_text(self.codes_of(side), self.glyphs)}"
            f"{self._key(side)}"
            for side, title in enumerate(self.titles)
        ]
        text = "\n".join(texts)
        self.copy_to_clipboard(text)
        self._save(text, ".txt")

    def _key(self, side: int) -> str:
        """What the letters of zones mean, if they are shown: there is no legend beside a text."""
        if self.choice.layer == "service-zones":
            service_zones = self.pictures.scene(self.playback, self.choice, side).service_zones
            many = 0 if service_zones is None else len(service_zones.server)
            return "; ".join(design_key(many, self.glyphs)) + "\n"
        if self.choice.layer != "traffic-zones":
            return ""
        return "; ".join(zone_key(self.pictures.floors[side], self.glyphs)) + "\n"

    def _tick_of(self, side: int) -> int:
        return 0 if self.playback is None else self.playback.snapshots[side].tick

    def _save(self, text: str, suffix: str) -> None:
        tick = 0 if self.playback is None else self.playback.tick
        name = f"{self.opening.name}-{tick}"
        if self.is_web:
            self._deliver(text, f"{name}{suffix}")
            return
        try:
            path = capture_file(name, suffix, os.environ, here=not self.options.read_only)
            write_atomically(path, text)
        except OSError as error:
            self.notify(f"cannot save the picture: {error.strerror}", severity="error")
            return
        self.notify(f"saved {short_path(path)}")

    def _deliver(self, text: str, name: str) -> None:
        """To the browser."""
        if self.options.read_only:
            self.notify("this viewer is read-only: it hands out no files", severity="warning")
        else:
            self.deliver_text(io.StringIO(text), save_filename=name)


def write_atomically(path: Path, text: str) -> None:
    """The file is there when all of it is; raises OSError, and then leaves nothing."""
    part = path.with_name(f"{path.name}.part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError:
        with suppress(OSError):
            part.unlink()
        raise


def without_links(svg: str) -> str:
    """The drawing with the fonts that are there, not with some from the internet."""
    return FROM_THE_INTERNET.sub("", svg).replace("Fira Code, monospace", "monospace")
