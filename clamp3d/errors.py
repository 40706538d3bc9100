"""Errors of the package: one clear line each, naming value, rule and choices."""


class Clamp3dError(Exception):
    """Base of every error that clamp3d raises on purpose."""


class InputError(Clamp3dError, ValueError):
    """A value from outside breaks a rule. The message names the value and the rule (exit code 2)."""


class SolverError(Clamp3dError):
    """A solver could not prove its answer. The message says which condition does not hold."""


class MissingLibraryError(Clamp3dError, ImportError):
    """An optional library is not installed. The message says what to install."""
