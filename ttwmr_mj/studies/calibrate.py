"""What `ttwmr calibrate` does: a board shown to a simulated or a real camera."""

from io import BytesIO
from pathlib import Path

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.files import write_bytes
from ttwmr_mj.runs.build import generators
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.vision.calibration.board import SHEET_DPI, BoardView, board_sheet, find_board
from ttwmr_mj.vision.calibration.calibrate import Calibration, calibrate, calibrate_virtual
from ttwmr_mj.vision.options import CameraSensing
from ttwmr_mj.vision.pictures import SUFFIXES, picture_files, read_picture


def calibrate_scenario(scenario: Scenario) -> Calibration:
    """Show the board to a scenario's simulated camera, as it is believed to be.

    Raises:
        InputError: the scenario has no camera, or the board was not found often enough.
        MachineError: no OpenGL.
    """
    if not isinstance(scenario.sensing, CameraSensing):
        raise InputError.at(
            "sensing.kind",
            f"the scenario {scenario.name} has no camera to calibrate",
            got=repr(scenario.sensing.kind),
            hint="add --set sensing.kind=camera, or give a scenario with a camera",
        )
    rng = generators(scenario.seed, ("calibration",))["calibration"]
    return calibrate_virtual(scenario.believed_camera, rng)


def calibrate_from_images(folder: Path) -> tuple[Calibration, list[Path]]:
    """Calibrate from a real camera's pictures of the board; in which of them it was not found.

    Args:
        folder: holds held/ (the board in the hand, tilted, all over the picture), origin/ (flat
            on the floor, where the world's origin shall be, long side along x) and flat/ (flat,
            anywhere; may be absent).

    Raises:
        InputError: no pictures, some that cannot be read or differ in size, too few boards, or
            boards that determine no camera.
    """
    held, origin, flat = (picture_files(folder / name) for name in ("held", "origin", "flat"))
    if not held or not origin:
        raise InputError.at(
            "--images",
            f"needs pictures in {folder / 'held'} (got {len(held)}) and in "
            f"{folder / 'origin'} (got {len(origin)})",
            allowed=", ".join(SUFFIXES),
        )
    (width_px, height_px), seen = _looked_at([*held, *origin, *flat])
    views = [
        [view._replace(picture=str(path)) for path in files if (view := seen[path]) is not None]
        for files in (held, origin, flat)
    ]
    calibration = calibrate(views[0], views[1], views[2], width_px, height_px)
    return calibration, [path for path, view in seen.items() if view is None]


def _looked_at(files: list[Path]) -> tuple[tuple[int, int], dict[Path, BoardView | None]]:
    """The size of all pictures and the board in each: one at a time, however many there are."""
    size_px, seen = (0, 0), dict[Path, BoardView | None]()
    for path in files:
        image = read_picture(path)
        height_px, width_px = image.shape[:2]
        if not seen:
            size_px = width_px, height_px
        if (width_px, height_px) != size_px:
            unlike = Fault(
                got=f"{width_px}×{height_px} px",
                problem=f"{files[0]} has {size_px[0]}×{size_px[1]} px",
                hint="all pictures must come from one camera at one resolution",
            )
            raise InputError(unlike, file=str(path))
        seen[path] = find_board(image)
    return size_px, seen


def write_board(path: Path) -> None:
    """Write the board as a picture that knows how large it is to be printed.

    Raises:
        InputError: no such format.
        OSError: the file cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        allowed = f"a file that ends in {', '.join(SUFFIXES)}"
        raise InputError.at("--board", got=str(path), allowed=allowed)
    from PIL import Image as Pillow

    content, sheet = BytesIO(), Pillow.fromarray(board_sheet())
    kind = Pillow.registered_extensions()[path.suffix.lower()]
    sheet.save(content, kind, dpi=(SHEET_DPI, SHEET_DPI), quality=95)
    write_bytes(path, content.getvalue())
