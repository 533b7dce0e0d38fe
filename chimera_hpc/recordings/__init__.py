"""Time series of other people: read, resampled, measured, and judged by an atlas."""
