"""`python -m automaton`: the command line."""

from __future__ import annotations

import os
import sys

if __name__ == "__main__":
    if sys.path[0] in ("", os.getcwd()):
        # Last, as for the console script: a folder `strategies` or `tui` there must not hide ours.
        sys.path.append(sys.path.pop(0))
    from automaton.commands import main

    sys.exit(main())
