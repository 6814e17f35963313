"""What the screens of the terminal program are made of."""
