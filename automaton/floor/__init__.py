"""The floor as plain data: cells, plan, drawings, matrices, reachability. No Numba."""
