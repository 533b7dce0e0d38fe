"""The exception for errors in a user's input."""


class BadInput(ValueError):
    """Input that cannot be used; its message is one line: what, where, what is allowed.

    The command line prints the message and leaves with exit status 2, without a traceback.
    """
