"""Files of other programs: import of problems and floors, checks of outputs, export of layouts."""
