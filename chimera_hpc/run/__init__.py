"""Computes a sweep: driver, executors, Dask clusters, SLURM, adaptive rounds, signals, progress."""
