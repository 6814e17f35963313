"""What the viewer costs: `automaton bench --only viewer`."""
