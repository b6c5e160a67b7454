"""A controller of the user's own, named `module:Class` in the scenario."""

import importlib
import sys
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import Field

from ttwmr_mj.controllers.base import Controller, ControllerOptions
from ttwmr_mj.errors import InputError, described


class CustomOptions(ControllerOptions):
    """Your own class, from the Python path or beside the scenario file."""

    kind: Literal["custom"] = "custom"
    target: str = Field(
        pattern=r"^[A-Za-z_][\w.]*:[A-Za-z_]\w*$", description="the class, as module:Class"
    )
    needs_reference: ClassVar[bool] = False
    alone: ClassVar[bool] = True
    options: dict[str, Any] = Field(default={}, description="keyword arguments passed to the class")

    def make(self, folder: Path) -> Controller:
        """Import the module, from the scenario's folder or the Python path; make the controller.

        Raises:
            InputError: the module or class cannot be found or made, or is no `Controller`.
        """
        module_name, class_name = self.target.split(":")
        key, got = "controller.target", repr(self.target)
        sys.path.insert(0, str(folder.resolve()))
        try:
            module = importlib.import_module(module_name)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a user's module may raise anything, and leave
            raise InputError.at(
                key,
                f"importing {module_name} raised {described(error)}",
                got=got,
                hint=f"it must be beside the scenario ({folder}) or on the Python path",
            ) from error
        finally:
            sys.path.pop(0)
        found = getattr(module, class_name, None)
        if not (isinstance(found, type) and issubclass(found, Controller)):
            problem = (
                f"{module_name} has no class {class_name} that derives from ttwmr_mj.Controller"
            )
            raise InputError.at(key, problem, got=got)
        try:
            return found(**self.options)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            problem = f"{class_name}(**controller.options) raised {described(error)}"
            raise InputError.at(key, problem, got=got) from error
