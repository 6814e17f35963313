"""The independent validator, and the comparison of recordings with repeated runs."""
