"""Rows of the numbers and counters that the stepping loop keeps for each lane."""

# Rows of the lanes' numbers, ``lane`` (LANE_ROWS, lanes).
TIME, STEP, LOG_ERROR, ERROR_SUM, LOG_ERROR_NEW, TIME_NEW, THETA = 0, 1, 2, 3, 4, 5, 6
LANE_ROWS = 7
# Rows of the lanes' counters, ``counters`` (COUNT_ROWS, lanes).
STATE, NEXT_SAMPLE, ACCEPTED, TRIED, REJECTED_LAST, IS_DUE = 0, 1, 2, 3, 4, 5
COUNT_ROWS = 6
# Values of the row STATE that are not a `Status`: empty, new, running.
IDLE, FRESH, RUNNING = -2, -1, 0
