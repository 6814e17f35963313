"""The error for a Numba that compiled code cannot use. Importing it imports no Numba."""


class UnfitNumbaError(ImportError):
    """The installed Numba lacks parts that compiled code needs, or has other ones."""
