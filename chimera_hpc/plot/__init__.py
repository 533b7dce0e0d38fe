"""One function a figure: takes arrays, returns a matplotlib Figure, writes nothing."""
