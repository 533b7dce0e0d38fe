"""Measures of oscillations: pure functions of times t (T,) and signals u (T, N)."""
