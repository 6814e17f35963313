"""The environment of a session's process: what it needs, and nothing else of the server's."""

from __future__ import annotations

from collections.abc import Mapping

ALLOWED_VARIABLES = {"PATH", "HOME", "TMPDIR", "LD_LIBRARY_PATH", "VIRTUAL_ENV"}
ALLOWED_PREFIXES = ("XDG_", "PYTHON", "NUMBA_", "AUTOMATON_")
PROTOCOL = {  # set by textual-serve
    "TEXTUAL_DRIVER",
    "TEXTUAL_FPS",
    "TEXTUAL_COLOR_SYSTEM",
    "TERM_PROGRAM",
    "TERM_PROGRAM_VERSION",
    "COLUMNS",
    "ROWS",
}
# The terminal is the browser's, whatever the server was started in.
TERMINAL = {"TERM": "xterm-256color", "COLORTERM": "truecolor", "LC_ALL": "C.UTF-8"}


def clean(environment: Mapping[str, str]) -> dict[str, str]:
    """What of `environment` a session may see: no passwords, no keys, no agent's socket."""
    allowed = ALLOWED_VARIABLES | PROTOCOL
    kept = {
        name: value
        for name, value in environment.items()
        if name in allowed or name.startswith(ALLOWED_PREFIXES)
    }
    return kept | TERMINAL
