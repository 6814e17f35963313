"""Floors and scenarios as data, with the generators of floors."""

from pkgutil import extend_path

# A folder `layouts` beside a scenario adds modules to this package, and hides none of them.
__path__[:] = extend_path(__path__, __name__)
