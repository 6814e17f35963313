"""The speed of this machine: what `automaton bench` measures, and how."""
