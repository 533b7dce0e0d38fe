"""Recordings of others: read, put on an even grid of times, measured, judged by an atlas."""
