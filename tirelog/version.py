"""The version of the package; here, so that nothing has to import the whole for it."""

__version__ = "0.2.0.dev0"
