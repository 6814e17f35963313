"""The command line as a program: `automaton`, and `python -m automaton`.

Importing the command line takes 0.2 s. Ctrl-C in that time must end the process with one sentence, as
later, so this module handles it before any other import.
"""

import gc
import os
import sys

BAD_INPUT, INTERRUPTED = 2, 130
REPLACED = (
    "another distribution, probably 'automaton' of PyPI, has replaced a file of fleet-automaton; "
    "remove it, and install fleet-automaton again in a separate environment"
)


def main() -> int:
    """Run the command line of this process and return the exit code."""
    try:
        import signal

        usual = signal.getsignal(signal.SIGINT)
        if usual is signal.default_int_handler:  # unless Ctrl-C is ignored
            signal.signal(signal.SIGINT, _end_at_once)

        if not hasattr(sys.modules["automaton"], "OFFERED"):
            print(f"automaton: {REPLACED}", file=sys.stderr)
            return BAD_INPUT
        from automaton.garbage import suspend_while_starting

        suspend_while_starting()
        from automaton.commands import main as run_command_line

        signal.signal(signal.SIGINT, usual)
        code = run_command_line()
        gc.freeze()  # the process ends: no search for garbage
        return code
    except KeyboardInterrupt:
        return _end_at_once()


def _end_at_once(*_: object) -> int:
    """End the process at once: an exception within an import may be lost, or printed as a traceback."""
    try:
        os.write(2, b"automaton: interrupted\n")
    finally:
        os._exit(INTERRUPTED)  # also if the sentence cannot be printed


if __name__ == "__main__":
    if sys.path[0] in ("", os.getcwd()):
        # The current folder comes last, as for the console script: a folder `strategies` or `tui` in it
        # must not hide ours.
        sys.path.append(sys.path.pop(0))
    sys.exit(main())
