"""Solve one guess on one mesh, by IPOPT or the stagewise method."""
