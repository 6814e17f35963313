"""The floor as data, the state of a run and how one becomes the other."""
