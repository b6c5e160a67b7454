"""ttwmr-mj: a MuJoCo testbed for a tractor towing a spherical-wheeled trailer."""

from importlib.metadata import version

__version__ = version("ttwmr-mj")
