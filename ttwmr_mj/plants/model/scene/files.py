"""The files that make an MJCF scene: what it includes, its meshes and pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from ttwmr_mj.assets import models_folder
from ttwmr_mj.errors import Fault, InputError, cut
from ttwmr_mj.files import resolved

FOLDERS = ("assetdir", "meshdir", "texturedir")  # of <compiler>
MOST_BYTES = 16_000_000  # of an XML file
MOST_CELLS = 30_000_000  # of a texture or a height field that MuJoCo makes by itself
# tag → in words, and its sizes
SIZES = {"texture": ("a texture", "width", "height"), "hfield": ("a height field", "ncol", "nrow")}


def scene_files(scene: Path) -> list[Path]:
    """The scene, what it includes, and the meshes and pictures they name, as far as they exist."""
    return _walk(resolved(scene))[0]


def refuse_what_leads_away(scene: str, *key: str) -> None:
    """Scenes may be a stranger's: theirs name files beside them only, no entities and no plugins.

    Args:
        scene: path of the MJCF file.
        key: of the scenario, that names it.

    Raises:
        InputError: with everything that is wrong.
    """
    path = resolved(Path(scene))
    files, problems = _walk(path)
    homes = path.parent, resolved(models_folder())
    away = [file for file in files if not any(file.is_relative_to(home) for home in homes)]
    problems = [(problem, file) for problem, file in problems if file not in away]
    problems += [("the scene leads out of its folder", file) for file in away]
    hint = f"a scene is data: XML, meshes and pictures that lie beside {path.name}"
    faults = [Fault(key=key, problem=p, got=repr(str(file)), hint=hint) for p, file in problems]
    if faults:
        raise InputError(*faults)


def _walk(scene: Path) -> tuple[list[Path], list[tuple[str, Path]]]:
    """Every file of a scene that exists, each once; and which are no data, with the reason."""
    found, problems, waiting = dict[Path, None](), list[tuple[str, Path]](), [(scene, True)]
    while waiting:
        path, is_scene = waiting.pop()
        if path in found or path.is_dir() or not path.exists():
            continue
        found[path] = None
        if not path.is_file():  # reading a pipe would never end
            problems.append(("this is no regular file", path))
            continue
        if not is_scene:
            continue
        try:
            root = _read(path)
        except (OSError, ValueError, ElementTree.ParseError) as error:
            problems.append((f"cannot be read as a scene: {error}", path))
            continue
        if root.find(".//plugin") is not None:
            problems.append(("the scene asks for a plugin, which is code", path))
        problems += ((problem, path) for problem in _too_large(root))
        waiting += _named(root, {scene.parent, path.parent})
    return list(found), problems


def _read(path: Path) -> ElementTree.Element:
    with path.open("rb") as file:  # of a device no more than is allowed
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise ValueError(f"larger than {MOST_BYTES:,} bytes")
    # as text: MuJoCo does not hear what a file says of its own encoding
    text = content.decode()
    if "<!DOCTYPE" in text:
        raise ValueError("it has a DOCTYPE, which can define entities")
    return ElementTree.fromstring(text)


def _too_large(root: ElementTree.Element) -> Iterator[str]:
    for tag, (words, *names) in SIZES.items():
        for element in root.iter(tag):
            across, up = (element.get(name, "1") for name in names)
            # floats: int() takes no more than 4300 digits
            if across.isdecimal() and up.isdecimal() and float(across) * float(up) > MOST_CELLS:
                cells = f"{cut(across, 20)} × {cut(up, 20)} cells"
                yield f"{words} has {cells}; allowed: {MOST_CELLS:,}"


def _named(root: ElementTree.Element, homes: set[Path]) -> Iterator[tuple[Path, bool]]:
    """Where files may be that are named in a scene or a part of it, and whether they are one."""
    compilers = list(root.iter("compiler"))
    assets = {one.get(name, "") for one in compilers for name in FOLDERS}
    for element in root.iter():
        is_scene = element.tag in ("include", "model")
        # a cube's pictures are named by fileright, fileleft and so on
        for name in (value for key, value in element.items() if key.startswith("file")):
            for home in sorted(homes):
                for folder in sorted({"", *assets}):
                    yield resolved(home / folder / name), is_scene
