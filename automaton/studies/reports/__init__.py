"""Reports on folders of results: tables, intervals, comparisons, curves and maps, to give away."""
