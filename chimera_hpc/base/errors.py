"""The one exception that users cause."""


class BadInput(ValueError):
    """Input that cannot be used; its message is one line: what, where, what is allowed.

    The command line prints the message and leaves with exit status 2, without a traceback.
    """
