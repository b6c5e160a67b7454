"""The errors users meet: what was got, where, what is allowed, what to do."""


class TtwmrError(Exception):
    """Base class of every error this package raises on purpose."""


class InputError(TtwmrError):
    """Something given from outside is wrong: scenario, option, file (exit code 2)."""


class RunError(TtwmrError):
    """A run that started could not be finished: divergence, broken physics (exit code 1)."""


class MachineError(TtwmrError):
    """This machine lacks something the request needs, and the message says what (exit code 2)."""
