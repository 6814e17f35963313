"""The viewer in a browser: one process of the viewer for each browser session.

    browser --HTTP--> access: Host, token, Origin --> page, static files
            <--WS--->                             --> session <--pipes--> python -m automaton watch

It builds on textual-serve, whose own server authenticates nobody, starts any number of processes
through a shell with its whole environment, and waits forever for a process that does not end.
"""
