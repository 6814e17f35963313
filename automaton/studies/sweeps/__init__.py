"""Study files and the execution of their runs."""
