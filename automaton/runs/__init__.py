"""One run: the simulation, its metrics, its report, and pictures of the world as text."""
