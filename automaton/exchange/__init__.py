"""Files of other programs: problems that become scenarios, and outputs that are checked."""
