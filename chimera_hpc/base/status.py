"""Status of a point: the codes in the store's ledger, each with a sentence."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Outcome of one point; 1-3 are results, 4-10 failures, 255 means that it never ran."""

    DONE = 1
    STEADY = 2
    NO_WINDOW = 3
    NON_FINITE = 4
    STEP_TOO_SMALL = 5
    STEP_BUDGET = 6
    TIME_OUT = 7
    WORKER_LOST = 8
    OUT_OF_MEMORY = 9
    NOT_STARTED = 10
    NEVER = 255

    @property
    def sentence(self) -> str:
        """The outcome in words, for reports and error lists."""
        return _SENTENCES[self]

    def reason(self, steps: int) -> str:
        """Return the outcome in words, for a point that made `steps` steps."""
        if self is Status.TIME_OUT and not steps:
            return _HANG
        return self.sentence

    @property
    def is_result(self) -> bool:
        """Whether the point is finished and has a result."""
        return Status.DONE <= self <= Status.NO_WINDOW

    @property
    def is_failure(self) -> bool:
        """Whether the point was tried and gave no result."""
        return Status.NON_FINITE <= self <= Status.NOT_STARTED


_HANG = (
    "time-out: the model did not return within integrator.time_out + run.patience seconds, not one "
    "step ended"
)
_SENTENCES = {
    Status.DONE: "done: it oscillates and its features are in the store",
    Status.STEADY: "steady: the signal stands still, so it has no amplitude, phase or frequency",
    Status.NO_WINDOW: "no complete window: the analysis interval holds too few maxima",
    Status.NON_FINITE: "non-finite: the state grew beyond all bounds",
    Status.STEP_TOO_SMALL: "step too small: the error control asked for a step below the "
    "resolution of time",
    Status.STEP_BUDGET: "step budget: integrator.max_steps was used up before t_end",
    Status.TIME_OUT: "time-out: integrator.time_out seconds of wall time were used up",
    Status.WORKER_LOST: "worker lost: the process that computed it died every time",
    Status.OUT_OF_MEMORY: "out of memory: the process that computed it ran into its memory limit",
    Status.NOT_STARTED: "not started: a point before it in its chain failed, so there is no state "
    "to start from",
    Status.NEVER: "never run",
}
