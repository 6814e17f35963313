"""The command line as a program: `automaton`, and `python -m automaton`.

Ctrl-C while the command line is imported, a fifth of a second, ends the process in a sentence, as it does
later: this module imports nothing else before it has seen to that.
"""

import gc
import os
import sys

BAD_INPUT, INTERRUPTED = 2, 130
REPLACED = (
    "another distribution, probably 'automaton' of PyPI, has replaced a file of fleet-automaton; "
    "remove it, and install fleet-automaton again, in an environment of its own"
)


def main() -> int:
    """Run the command line of this process and return the exit code."""
    try:
        import signal

        usual = signal.getsignal(signal.SIGINT)
        if usual is signal.default_int_handler:  # not where Ctrl-C is ignored
            signal.signal(signal.SIGINT, _end_at_once)

        if not hasattr(sys.modules["automaton"], "OFFERED"):
            print(f"automaton: {REPLACED}", file=sys.stderr)
            return BAD_INPUT
        from automaton.garbage import suspend_while_starting

        suspend_while_starting()
        from automaton.commands import main as run_command_line

        signal.signal(signal.SIGINT, usual)
        code = run_command_line()
        gc.freeze()  # what is left ends with the process: it is not searched for garbage
        return code
    except KeyboardInterrupt:
        return _end_at_once()


def _end_at_once(*_: object) -> int:
    """End the process: raised within an import, an exception may be lost, or printed as a traceback."""
    try:
        os.write(2, b"automaton: interrupted\n")
    finally:
        os._exit(INTERRUPTED)  # whatever became of the sentence


if __name__ == "__main__":
    if sys.path[0] in ("", os.getcwd()):
        # Last, as for the console script: a folder `strategies` or `tui` there must not hide ours.
        sys.path.append(sys.path.pop(0))
    sys.exit(main())
