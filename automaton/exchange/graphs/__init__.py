"""Layouts that are graphs of nodes and edges (VDMA LIF, openTCS), and how they become floors."""
