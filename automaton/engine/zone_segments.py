"""Copy segments of a zone design, as the world does when zones change or are out of sight."""

from automaton.engine.jit.kernel import kernel


@kernel
def copy_segment(source, m, design, to):
    """Copy a segment; source and design may be the same."""
    design.owner[to] = source.owner[m]
    design.ends[to, 0] = source.ends[m, 0]
    design.ends[to, 1] = source.ends[m, 1]
    design.points[to] = source.points[m]
    for k in range(source.points[m]):
        design.path[to, k] = source.path[m, k]
