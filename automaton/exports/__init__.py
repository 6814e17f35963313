"""Export recordings as files of other programs."""
