"""Right of way: what does a blocked robot do?"""

from pkgutil import extend_path

__path__[:] = extend_path(__path__, __name__)  # as in `strategies`
