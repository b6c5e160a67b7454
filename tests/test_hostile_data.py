"""Whatever a calibration, plan, scene, trajectory or picture holds: data or an InputError."""

from __future__ import annotations

import os
import random
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from test_hostile_files import survives

from ttwmr_mj.assets import models_folder
from ttwmr_mj.errors import InputError, RunError
from ttwmr_mj.plants.model import mjcf
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.references.planned import Knots, Planned
from ttwmr_mj.results.metrics import score
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.calibrate import calibrate_from_images
from ttwmr_mj.vision.calibration.board import board_print
from ttwmr_mj.vision.calibration.calibrate import Calibration
from ttwmr_mj.vision.calibration.file import load_calibration, save_calibration
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.footage import open_footage

NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:[eE][-+]?\d+)?")
NUMBERS = ["0", "-1", "nan", "inf", "1e308", "-1e308", "1e-308", "9" * 400, "1e9", "3", "x", ""]
PIECES = [
    "\0",
    "\x1b[2J",
    "é",
    "<",
    ">",
    "&",
    ",",
    "\n",
    "'",
    '"',
    "[",
    "]",
    "!!binary ",
    "../",
    "%n",
]
ROBOT = RobotParameters()
CAMERA = CameraModel(
    width_px=64,
    height_px=48,
    focal_px=np.array([50.0, 50.0]),
    principal_px=np.array([32.0, 24.0]),
    distortion=np.zeros(5),
    rotation=np.diag([1.0, -1.0, -1.0]),
    position_m=np.array([0.0, 0.0, 1.0]),
)


def mutated_text(text: str, rng: random.Random) -> str:
    """With one to three numbers, pieces or lines replaced, added or left out, or cut off."""
    for _ in range(rng.choice([1, 1, 2, 3])):
        lines = text.splitlines(keepends=True) or [""]
        at, spot = rng.randrange(len(lines)), rng.randrange(len(text) + 1)
        what = rng.randrange(6)
        if what <= 1 and (numbers := list(NUMBER.finditer(text))):
            found = rng.choice(numbers)
            text = text[: found.start()] + rng.choice(NUMBERS) + text[found.end() :]
        elif what == 2:
            text = "".join(lines[:at] + lines[at + 1 :])
        elif what == 3:
            text = "".join(lines[: at + 1] + lines[at:])
        elif what == 4:
            text = text[:spot] + rng.choice(PIECES) + text[spot:]
        else:
            text = text[:spot] + (text[spot + rng.randrange(40) :] if rng.random() < 0.7 else "")
    return text


def mutated_bytes(content: bytes, rng: random.Random) -> bytes:
    """With some bytes replaced, left out or doubled, or cut off; often near the beginning."""
    data = bytearray(content)
    for _ in range(rng.choice([1, 1, 2, 5, 20])):
        last = len(data) if rng.random() < 0.5 else min(len(data), 200)
        at = rng.randrange(last + 1)
        match rng.randrange(5):
            case 0:
                del data[at:]
            case 1:
                del data[at : at + rng.randrange(1, 50)]
            case 2:
                data[at:at] = data[at : at + rng.randrange(1, 50)]
            case _:
                data[at : at + 1] = bytes([rng.choice([0, 1, 127, 128, 255, rng.randrange(256)])])
    return bytes(data)


class Kinds:
    """The files, as they should be, and what is made of each; a folder for what is tried."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        save_calibration(Calibration(CAMERA, 0.1, 0.1, 9), folder / "whole.yaml")
        self.calibration = (folder / "whole.yaml").read_text()
        shipped = Path(__file__).parent.parent / "ttwmr_mj/references/data/rest_to_rest.csv"
        plan = shipped.read_text().splitlines(keepends=True)
        self.plan_text = "".join(plan[:4] + plan[4::3])  # whole, as one that is cut is refused
        shutil.copytree(models_folder(), folder / "models")
        result = Experiment(load_scenario("lab_circle", ["plant.kind=analytic", "duration_s=1"]))
        self.rows = result.run().trajectory.to_columns()
        video = cv2.VideoWriter(
            str(folder / "whole.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (64, 48)
        )
        picture = cv2.cvtColor(cv2.resize(board_print(), (64, 48)), cv2.COLOR_GRAY2BGR)
        for _ in range(5):
            video.write(picture)
        video.release()
        self.video = (folder / "whole.avi").read_bytes()
        pictures = {end: cv2.imencode(end, picture)[1].tobytes() for end in (".png", ".jpg")}
        self.pictures = {**pictures, ".bmp": cv2.imencode(".bmp", picture)[1].tobytes()}

    def calibrations(self, rng: random.Random) -> Callable[[], object]:
        file = self.folder / "mine.yaml"
        file.write_text(mutated_text(self.calibration, rng))

        def read() -> None:
            camera = load_calibration(file).camera
            assert np.isfinite(camera.matrix).all()
            assert abs(np.linalg.det(camera.rotation) - 1.0) < 1e-4
            assert max(camera.width_px, camera.height_px) <= 100_000

        return read

    def plans(self, rng: random.Random) -> Callable[[], object]:
        file = self.folder / "mine.csv"
        file.write_text(mutated_text(self.plan_text, rng))

        def read() -> None:
            plan = Planned(plan=str(file))
            if faults := plan.faults(ROBOT):
                raise InputError(*faults)
            assert Knots.read(str(file)).duration_s > 0.0
            path = plan.sample(np.arange(0.0, 2.0, 0.033), ROBOT)
            assert np.isfinite(path.derivatives).all()

        return read

    def scenes(self, rng: random.Random) -> Callable[[], object]:
        names = ["scene.xml", "ttwmr.xml"]
        for name in names:
            shutil.copy(models_folder() / name, self.folder / "models" / name)
        file = self.folder / "models" / rng.choice(names)
        file.write_text(mutated_text(file.read_text(), rng))
        scene = str(self.folder / "models" / "scene.xml")
        return lambda: build_model(ROBOT, ContactOptions(model_path=scene))

    def trajectories(self, rng: random.Random) -> Callable[[], object]:
        file = self.folder / "mine.parquet"
        columns: dict[str, object] = dict(self.rows)
        count = len(self.rows["time_s"])
        for _ in range(rng.choice([0, 1, 2])):
            name = rng.choice(list(columns))
            columns[name] = rng.choice(
                [
                    ["x"] * count,
                    [None] * count,
                    [[1.0]] * count,
                    [{"a": 1}] * count,
                    np.full(count, rng.choice([np.nan, np.inf, 1e308, -1.0, 0.0])),
                    np.arange(count)[::-1].copy(),
                    np.ones(count, dtype=bool),
                ]
            )
            if rng.random() < 0.3:
                columns["a" * 10**3 if rng.random() < 0.5 else "theta99999_rad"] = columns.pop(name)
        table = pa.table(columns)
        pq.write_table(table.slice(0, rng.choice([0, 1, count, count])), file)
        if rng.random() < 0.5:
            file.write_bytes(mutated_bytes(file.read_bytes(), rng))

        def read() -> None:
            rows = Trajectory.read(file)
            assert rows.q.dtype == np.float64
            if len(rows) > 1:
                score(rows, ROBOT)

        return read

    def images(self, rng: random.Random) -> Callable[[], object]:
        folder = self.folder / "pictures"
        shutil.rmtree(folder, ignore_errors=True)
        for name in ("held", "origin"):
            (folder / name).mkdir(parents=True)
            end = rng.choice(list(self.pictures))
            (folder / name / f"a{end}").write_bytes(mutated_bytes(self.pictures[end], rng))
        return lambda: calibrate_from_images(folder)

    def videos(self, rng: random.Random) -> Callable[[], object]:
        file = self.folder / "mine.avi"
        file.write_bytes(mutated_bytes(self.video, rng))

        def read() -> None:
            with open_footage(str(file), CAMERA) as frames, suppress(RunError):
                for frame, _ in zip(frames, range(20), strict=False):
                    assert frame.image.shape == (48, 64, 3)
                    assert np.isfinite(frame.time_s)

        return read


@pytest.fixture(scope="module")
def kinds(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Kinds]:
    folder, before = tmp_path_factory.mktemp("data"), Path.cwd()
    os.chdir(folder)  # MuJoCo writes its log where it is
    with pytest.MonkeyPatch.context() as patch:  # a process for each scene takes longer than all
        patch.setattr(mjcf, "refuse_what_takes_too_much", lambda *_: None)
        yield Kinds(folder)
    os.chdir(before)


QUICK = {"calibrations": 150, "plans": 80, "scenes": 30, "trajectories": 40, "images": 60}
QUICK |= {"videos": 30}
SLOW = {"calibrations": 3000, "plans": 2000, "scenes": 800, "trajectories": 600, "images": 1200}
SLOW |= {"videos": 600}


def try_many(kinds: Kinds, kind: str, seeds: range, capfd: pytest.CaptureFixture[str]) -> None:
    accepted = 0
    for seed in seeds:
        read = getattr(kinds, kind)(random.Random(seed))
        accepted += survives(read, (kind, seed))
        assert capfd.readouterr() == ("", ""), (kind, seed)
    assert accepted < len(seeds)
    assert not list(kinds.folder.rglob("*.part"))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", QUICK)
def test_files_of_all_kinds(kinds: Kinds, kind: str, capfd: pytest.CaptureFixture[str]) -> None:
    try_many(kinds, kind, range(QUICK[kind]), capfd)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", QUICK)
def test_a_great_many_of_them(kinds: Kinds, kind: str, capfd: pytest.CaptureFixture[str]) -> None:
    try_many(kinds, kind, range(1_000, 1_000 + SLOW[kind]), capfd)
