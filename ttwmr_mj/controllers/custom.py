"""A controller of the user's own, named `module:Class` in the scenario."""

import copy
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

from pydantic import Field

from ttwmr_mj.controllers.base import Controller, ControllerOptions
from ttwmr_mj.controllers.shared.own.loading import load
from ttwmr_mj.errors import InputError, Overrun, described, strangers
from ttwmr_mj.files import resolved


class CustomOptions(ControllerOptions):
    """Your own class, from the Python path or beside the scenario file."""

    kind: Literal["custom"] = "custom"
    target: str = Field(
        pattern=r"^[A-Za-z_][\w.]*:[A-Za-z_]\w*$", description="the class, as module:Class"
    )
    folder: str | None = Field(
        default=None,
        min_length=1,
        description="where the module is; left out: beside the scenario file, or on the Python "
        "path. The resolved scenario of a run says it",
    )
    needs_reference: ClassVar[bool] = False
    tows_trains: ClassVar[bool] = True
    options: dict[str, Any] = Field(default={}, description="keyword arguments passed to the class")

    @property
    def of_others(self) -> bool:
        """Always."""
        return True

    def placed(self, folder: Path) -> Self:
        """The same for a scenario file anywhere; this one's is in the folder."""
        return self.model_copy(update={"folder": str(resolved(folder / (self.folder or "")))})

    def make(self, folder: Path) -> Controller:
        """Import the module, from the scenario's folder or the Python path; make the controller.

        Raises:
            InputError: the module or class cannot be found or made, or is no `Controller`; its
                name may be taken, too.
            Overrun: from within the module; whoever calls may have set a deadline.
        """
        module_name, class_name = self.target.split(":")
        key, got = "controller.target", repr(self.target)
        strangers.append(f"the law {self.target}")
        module = load(self.target, resolved(folder / (self.folder or "")))
        found = getattr(module, class_name, None)
        if not (isinstance(found, type) and issubclass(found, Controller)):
            problem = (
                f"{module_name} has no class {class_name} that derives from ttwmr_mj.Controller"
            )
            raise InputError.at(key, problem, got=got)
        try:
            law = found(**copy.deepcopy(self.options))  # the scenario's own stay as they are
            if not isinstance(law, Controller):
                raise TypeError("it must make a Controller")
            return law
        except (KeyboardInterrupt, Overrun):
            raise
        except BaseException as error:
            problem = f"{class_name}(**controller.options) raised {described(error)}"
            raise InputError.at(key, problem, got=got) from error
