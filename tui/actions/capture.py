"""Actions that take the picture with them, as a drawing or as text."""

from __future__ import annotations

import io
import os
import re

from tui.recordings import capture_file, short_path
from tui.render.still import as_text
from tui.stage import Stage

FROM_THE_INTERNET = re.compile(r"@font-face\s*\{[^}]*\}|<!--.*?-->", re.DOTALL)


class CaptureActions(Stage):
    """Captures."""

    def action_screenshot(self) -> None:  # type: ignore[override]  # it takes no file name
        svg = self.export_screenshot(title=f"automaton: {self.opening.name}")
        # It has painted everything, and with that forgot what was still to be painted.
        self.screen.refresh()
        self._save(without_links(svg), ".svg")

    def action_copy_text(self) -> None:
        tick = 0 if self.shot is None else self.shot.tick
        texts = [
            f"{title}, tick {tick:,}\n{as_text(self.codes_of(side), self.glyphs)}"
            for side, title in enumerate(self.titles)
        ]
        text = "\n".join(texts)
        self.copy_to_clipboard(text)
        self._save(text, ".txt")

    def _save(self, text: str, suffix: str) -> None:
        tick = 0 if self.shot is None else self.shot.tick
        name = f"{self.opening.name}-{tick}"
        if self.is_web:
            self._deliver(text, f"{name}{suffix}")
            return
        try:
            path = capture_file(name, suffix, os.environ, here=not self.options.read_only)
            path.write_text(text, encoding="utf-8")
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


def without_links(svg: str) -> str:
    """The drawing with the fonts that are there, not with some from the internet."""
    return FROM_THE_INTERNET.sub("", svg).replace("Fira Code, monospace", "monospace")
