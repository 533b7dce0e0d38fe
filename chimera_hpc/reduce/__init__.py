"""From features of runs to classes, curves and results: reads arrays, never simulates."""
