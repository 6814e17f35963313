"""The viewer in a browser: one process of the viewer for each browser session.

    browser --HTTP--> access: Host, token, Origin --> page, static files
            <--WS--->                             --> session <--pipes--> python -m automaton watch

Built on textual-serve, whose stock server asks nobody who they are, starts processes without limit
through a shell with the whole environment, and waits for ever for one that does not end.
"""
