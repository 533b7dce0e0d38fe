"""Adaptive Runge-Kutta integration of many trajectories at once, in numba."""
