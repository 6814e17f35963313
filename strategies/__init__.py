"""The built-in strategies, one folder per layer; they see the world only through its public view.

What several layers need lies beside the folders: `linear_sum_assignment`.
"""

from pkgutil import extend_path

# A folder `strategies` beside a scenario adds modules to this package, and hides none of them.
__path__[:] = extend_path(__path__, __name__)
