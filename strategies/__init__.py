"""The built-in strategies, one folder per layer; they see the world only through its public view.

`linear_sum_assignment`, which several layers use, is beside the folders.
"""

from pkgutil import extend_path

# A folder `strategies` beside a scenario adds modules to this package but hides none of ours.
__path__[:] = extend_path(__path__, __name__)
