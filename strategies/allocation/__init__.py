"""Allocation: which order does a robot do next, and where does it drop the load?"""

from pkgutil import extend_path

__path__[:] = extend_path(__path__, __name__)  # as in `strategies`
