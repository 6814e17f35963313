"""Import of layouts that are graphs of nodes and edges (VDMA LIF, openTCS)."""
