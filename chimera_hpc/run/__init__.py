"""Computing a sweep: blocks of work, executors, clusters, signals, progress."""
