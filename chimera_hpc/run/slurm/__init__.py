"""Running on a SLURM cluster: scripts, the queue, certificates, workers, the time that is left."""
