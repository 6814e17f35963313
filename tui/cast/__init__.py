"""Films and pictures of recorded runs, made without a terminal: with the viewer's renderer, without
Textual."""
