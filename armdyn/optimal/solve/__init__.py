"""One guess on one mesh, by IPOPT."""
