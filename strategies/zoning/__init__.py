"""Zoning: which robot serves which part of the floor."""

from pkgutil import extend_path

__path__[:] = extend_path(__path__, __name__)  # as in `strategies`
