"""What every other folder may need: errors, statuses, files, processes, random streams."""
