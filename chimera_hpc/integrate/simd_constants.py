"""Width of a SIMD vector and the order in which running sums are added within one."""

LANES = 8
"""Lanes of a vector: eight float64 fill one 512-bit register, or two of 256 bits."""

SCAN = ((8, 0, 8, 2, 8, 4, 8, 6), (8, 8, 1, 1, 8, 8, 5, 5), (8, 8, 8, 8, 3, 3, 3, 3))
"""Running sums of eight in three levels: the lane that is added to each lane, 8 for none."""
