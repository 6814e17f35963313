"""Cost of the viewer: `automaton bench --only viewer`."""
