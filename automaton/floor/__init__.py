"""The floor as plain data: cells, plan, drawings, matrices, what can be reached. No Numba."""
