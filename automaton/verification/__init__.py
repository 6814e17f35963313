"""The independent validator, and recordings run again and compared."""
