"""Try the package as it is installed in the environment that runs this; for tests/matrix.

    python installed_package.py DIGESTS [SCENARIO]

Standard library only. Writes the digest of each shipped scenario after 2,000 ticks to DIGESTS.
With SCENARIO only that one is run, and what would compile everything again is left out.
"""

from __future__ import annotations

import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

TICKS = 2000
BIN = Path(sys.executable).parent
SECONDS_TO_START = 400  # with compiling, beside the tests of CI
MINE = '''"""A strategy of the user in a folder that has the name of one of ours."""

from automaton.strategy.per_robot import deliver, park, per_robot, take


@per_robot("allocation")
def eager(me, view):
    """Take the nearest open order."""
    if me.load is not None:
        return deliver()
    orders = view.open_orders()
    return take(min(orders, key=me.ticks_to)) if orders else park()
'''


def output(*command: str, **environment: str | None) -> str:
    """What a command prints, with some variables set or (None) missing; ends the program if it fails."""
    changed = {**os.environ, **environment}
    given = {name: value for name, value in changed.items() if value is not None}
    done = subprocess.run(command, env=given, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def automaton(*arguments: str, **environment: str | None) -> str:
    return output(str(BIN / "automaton"), *arguments, **environment)


def watched(*arguments: str) -> bytes:
    """What `automaton watch` writes to a terminal until it has drawn a floor and was left by `q`."""
    child, terminal = pty.fork()
    if child == 0:
        os.environ["TERM"] = "xterm-256color"
        os.execv(BIN / "automaton", ["automaton", "watch", *arguments])
    written, end = b"", time.monotonic() + SECONDS_TO_START
    while time.monotonic() < end:
        if select.select([terminal], [], [], 0.5)[0]:
            try:
                written += os.read(terminal, 65536)
            except OSError:  # it has ended
                break
        elif b"tick" in written:
            os.write(terminal, b"q")
    else:
        os.kill(child, signal.SIGKILL)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code or b"tick" not in written:
        sys.exit(f"watch: exit code {code}\n{written[-2000:].decode(errors='replace')}")
    return written


def folders_of_the_user() -> None:
    """Folders that are called as ours: neither hides the other."""
    for name in ("strategies", "layouts", "tui"):
        Path(name).mkdir(exist_ok=True)
        Path(name, "mine.py").write_text(MINE, encoding="utf-8")
        module = f"{name}.mine:eager"
        automaton("check", "tabletop-mini", "--set", f"strategy.allocation={module}")
    output(sys.executable, "-m", "automaton", "run", "tabletop-mini")


def homes() -> None:
    """Without HOME, and with one in which nothing can be made: a file. Each compiles anew."""
    automaton("run", "tabletop-mini", HOME=None, AUTOMATON_CACHE_DIR=None)
    automaton("run", "tabletop-mini", HOME=__file__, AUTOMATON_CACHE_DIR=None)


def page_of_the_package() -> None:
    """Links on the page of the package are absolute, and its second command is there."""
    text = metadata.metadata("fleet-automaton").get_payload()
    relative = re.findall(r"\]\((?!https://|#)[^)]*\)", str(text))
    if relative:
        sys.exit(f"relative links: {relative}")
    output(str(BIN / "fleet-automaton"), "list", PYTHONSAFEPATH="1")


def main(file: str, chosen: str = "") -> None:
    print(automaton("--version").strip(), "with Python", sys.version.split()[0], flush=True)
    shipped = [one["name"] for one in json.loads(automaton("list", "--json"))["scenarios"]]
    with open(file, "w", encoding="utf-8") as digests:
        for name in [chosen] if chosen else shipped:
            outcome = json.loads(automaton("run", name, "--until", str(TICKS), "--json"))
            print(name, outcome["digest"], file=digests, flush=True)
    page_of_the_package()
    folders_of_the_user()
    watched("tabletop-mini")
    if not chosen:
        automaton("run", "tabletop-mini", "--set", "strategy.allocation=tui.mine:eager")
        homes()


if __name__ == "__main__":
    main(*sys.argv[1:])
