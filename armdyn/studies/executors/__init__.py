"""Who works on the cases: processes of this machine, or a Dask cluster."""
