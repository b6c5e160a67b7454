"""A controller of the user's own, named `module:Class` in the scenario."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from ttwmr_mj.controllers.base import Controller
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.schema import CustomController


def load_controller(options: CustomController, folder: Path) -> Controller:
    """Import the module, from the scenario's folder or the Python path, and make the controller.

    Raises:
        InputError: the module or class cannot be found or made, or is no `Controller`.
    """
    module_name, class_name = options.target.split(":")
    where = f"controller.target = {options.target!r}"
    sys.path.insert(0, str(folder.resolve()))
    try:
        module = importlib.import_module(module_name)
    except Exception as error:  # a user's module may raise anything
        raise InputError(
            f"{where}: importing {module_name} raised {type(error).__name__}: {error}; it must be "
            f"beside the scenario ({folder}) or on the Python path"
        ) from error
    finally:
        sys.path.pop(0)
    found = getattr(module, class_name, None)
    if not (isinstance(found, type) and issubclass(found, Controller)):
        raise InputError(
            f"{where}: {module_name} has no class {class_name} that derives from "
            "ttwmr_mj.controllers.base.Controller"
        )
    try:
        return found(**options.options)
    except Exception as error:
        raise InputError(
            f"{where}: {class_name}(**controller.options) raised {type(error).__name__}: {error}"
        ) from error
