"""The files that make an MJCF scene: what it includes, its meshes and pictures."""

from __future__ import annotations

import os
import re
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

from ttwmr_mj.assets import models_folder
from ttwmr_mj.errors import Fault, InputError, shown
from ttwmr_mj.files import resolved

FOLDERS = ("assetdir", "meshdir", "texturedir")  # of <compiler>
NAMES = ("file", *FOLDERS)  # what attributes begin with that name files or folders
MOST_BYTES = 16_000_000  # of a scene's XML files
MOST_PLACES = 20_000  # where files of a scene may be
# a name of a file or folder, as it is written; XML calls line breaks and tabs in it spaces, which
# MuJoCo does not
WRITTEN_NAME = re.compile(rf"""(?=\b(?:{"|".join(NAMES)})\w*\s*=\s*("[^"]*"|'[^']*'))""")
MISREAD = re.compile(r"[\t\r\n]|&#")


def scene_files(scene: Path) -> list[Path]:
    """The scene, what it includes, and the meshes and pictures they name, as far as they exist."""
    return _Walk(resolved(scene)).files


def refuse_what_leads_away(scene: str, *key: str) -> list[Path]:
    """Scenes may be a stranger's: theirs name files beside them only, no entities and no plugins.

    Args:
        scene: path of the MJCF file.
        key: of the scenario, that names it.

    Returns:
        The scene's files.

    Raises:
        InputError: with everything that is wrong.
    """
    path = resolved(Path(scene))
    walk = _Walk(path)
    homes = path.parent, resolved(models_folder())
    away = [file for file in walk.files if not any(file.is_relative_to(home) for home in homes)]
    problems = [(problem, file) for problem, file in walk.problems if file not in away]
    problems += [("the scene leads out of its folder", file) for file in away]
    hint = f"a scene is data: XML, meshes and pictures that lie beside {path.name}"
    faults = [Fault(key=key, problem=p, got=repr(str(file)), hint=hint) for p, file in problems]
    if faults:
        raise InputError(*faults)
    return walk.files


class _Walk:
    """Every file of a scene that exists, each once; and which are no data, with the reason.

    What one part of a scene says of folders holds for all of them.
    """

    def __init__(self, scene: Path) -> None:
        self.problems: list[tuple[str, Path]] = []
        self._scene = scene
        self._found: dict[Path, None] = {}
        self._left = MOST_BYTES
        self._parts: list[Path] = [scene]  # of XML
        self._names: dict[str, None] = {}  # of other files
        self._homes, self._folders = {scene.parent: None}, {"": None}
        looked_into = set()
        while self._parts:
            path = self._parts.pop()
            if path not in looked_into and self._is_there(path):
                looked_into.add(path)
                self._look_into(path)
        if self._fits(len(self._homes) * len(self._folders) * len(self._names)):
            for place in product(self._homes, self._folders, self._names):
                self._is_there(_reduced(*place))

    @property
    def files(self) -> list[Path]:
        return list(self._found)

    def _is_there(self, path: Path) -> bool:
        """Whether there is such a file, which is one of the scene's then."""
        if path.is_dir() or not path.exists():
            return False
        file = resolved(path)
        if not file.is_file() and file not in self._found:  # reading a pipe would never end
            self.problems.append(("this is no regular file", file))
        self._found[file] = None
        return file.is_file()

    def _look_into(self, path: Path) -> None:
        try:
            root = self._read(path)
        except (OSError, ValueError, ElementTree.ParseError) as error:
            self.problems.append((f"cannot be read as a scene: {error}", resolved(path)))
            return
        self._homes[path.parent] = None
        parts: dict[str, None] = {}
        for element in root.iter():
            tag = element.tag.lower()  # as MuJoCo compares these
            if tag == "plugin":
                problem = "the scene asks for a plugin, which is code"
                self.problems.append((problem, resolved(path)))
            if tag == "compiler":
                self._folders |= dict.fromkeys(element.get(name, "") for name in FOLDERS)
            # a cube's pictures are named by fileright, fileleft and so on
            names = [value for key, value in element.items() if key.startswith("file")]
            if tag in ("include", "model"):
                parts |= dict.fromkeys(names)
            else:  # with `strippath` MuJoCo takes the last word only
                last = [name.replace("\\", "/").rpartition("/")[2] for name in names]
                self._names |= dict.fromkeys(names + last)
        if self._fits(len(parts)):
            homes = self._scene.parent, path.parent
            self._parts += (_reduced(home, "", name) for home in homes for name in parts)

    def _read(self, path: Path) -> ElementTree.Element:
        with path.open("rb") as file:  # of a device no more than is allowed
            content = file.read(self._left + 1)
        self._left -= len(content)
        if self._left < 0:
            raise ValueError(f"with the scene's other parts larger than {MOST_BYTES:,} bytes")
        # as text: MuJoCo does not hear what a file says of its own encoding
        text = content.decode()
        if "<!DOCTYPE" in text:
            raise ValueError("it has a DOCTYPE, which can define entities")
        if any(MISREAD.search(written) for written in WRITTEN_NAME.findall(text)):
            raise ValueError(
                "a name of a file has a line break, a tab or a numeric character reference"
            )
        root = ElementTree.fromstring(text)
        for element in root.iter():
            if "{" in element.tag:
                raise ValueError("it has an XML namespace, of which MuJoCo knows nothing")
            for key, value in element.items():
                # as MuJoCo reads `a:/b` it lies in the working directory
                if key.startswith(NAMES) and ":" in value.removeprefix(Path(value).drive):
                    raise ValueError(f"the name {shown(value)} of a file has a colon")
        return root

    def _fits(self, places: int) -> bool:
        if places > MOST_PLACES:
            problem = f"it names {places:,} places of files; allowed: {MOST_PLACES:,}"
            self.problems.append((problem, self._scene))
        return places <= MOST_PLACES


def _reduced(home: Path, folder: str, name: str) -> Path:
    """Where a file is, as MuJoCo reads it: `..` takes back what is written before it.

    That may be a link, or nothing between two slashes. So pathlib would lead elsewhere.
    """
    place = os.path.join(home, *(word.replace("\\", "/") for word in (folder, name)))  # noqa: PTH118
    anchor = Path(place).anchor
    words: list[str] = []
    for word in place[len(anchor) :].replace("\\", "/").split("/"):
        if word == ".." and words and words[-1] != "..":
            words.pop()
        elif word != ".":
            words.append(word)
    return Path(anchor + "/".join(words))
