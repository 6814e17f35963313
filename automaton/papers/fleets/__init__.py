"""Large fleets on grids where one robot fits in a cell: published problems, ours beside theirs."""
