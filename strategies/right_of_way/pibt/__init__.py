"""Priority inheritance with backtracking, for robots whose turns and moves take time."""
