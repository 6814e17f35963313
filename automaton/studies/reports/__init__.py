"""Reports on results folders: tables, intervals, comparisons, curves and maps, in files to share."""
