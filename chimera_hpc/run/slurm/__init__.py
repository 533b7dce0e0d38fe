"""Runs on a SLURM cluster: scripts, the queue, certificates, workers, the remaining time."""
