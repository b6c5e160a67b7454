"""A stranger's MJCF scene is data: it names files beside it, and brings no code."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from ttwmr_mj.assets import models_folder
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.scene.files import MOST_BYTES, scene_files
from ttwmr_mj.robot import RobotParameters

ROBOT = RobotParameters()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the shipped scene in it, and things outside it."""
    folder = tmp_path / "scene"
    folder.mkdir()
    for name in ("scene.xml", "ttwmr.xml"):
        shutil.copy(models_folder() / name, folder)
    (tmp_path / "secret.xml").write_text("<mujoco/>")
    (tmp_path / "secret.png").write_bytes(b"")
    return folder


def build(folder: Path, with_what: str = "") -> None:
    scene = folder / "scene.xml"
    scene.write_text(scene.read_text().replace("</mujoco>", f"{with_what}</mujoco>"))
    build_model(ROBOT, ContactOptions(model_path=str(scene)))


def test_a_scene_with_its_parts_beside_it_is_read(folder: Path) -> None:
    (folder / "more.xml").write_text('<mujoco><statistic extent="2"/></mujoco>')
    build(folder, '<include file="more.xml"/>')
    names = {path.name for path in scene_files(folder / "scene.xml")}
    assert names == {"scene.xml", "ttwmr.xml", "more.xml"}


def test_the_shipped_robot_may_be_included_from_anywhere(tmp_path: Path) -> None:
    robot = models_folder() / "ttwmr.xml"
    scene = (models_folder() / "scene.xml").read_text()
    (tmp_path / "scene.xml").write_text(scene.replace('"ttwmr.xml"', f'"{robot}"'))
    build(tmp_path)


LEADS_OUT = {  # TOP: the folder of the scene's folder
    "include": '<include file="TOP/secret.xml"/>',
    "include upwards": '<include file="../secret.xml"/>',
    "picture": '<asset><texture name="t" type="2d" file="TOP/secret.png"/></asset>',
    "cube": '<asset><texture type="cube" fileright="../secret.png"/></asset>',
    "meshes": '<compiler meshdir="TOP"/><asset><mesh name="m" file="secret.png"/></asset>',
    "part": '<asset><model name="m" file="TOP/secret.xml"/></asset>',
    "device": '<asset><hfield name="h" file="/dev/zero"/></asset>',
}


@pytest.mark.parametrize("kind", LEADS_OUT)
def test_nothing_outside_its_folder_is_read(kind: str, folder: Path) -> None:
    with pytest.raises(InputError, match="leads out of its folder") as refused:
        build(folder, LEADS_OUT[kind].replace("TOP", str(folder.parent)))
    (fault,) = refused.value.faults
    assert fault.where == "plant.contact.model_path"
    assert "secret" in fault.got or "/dev/zero" in fault.got
    assert "beside scene.xml" in fault.hint


def test_a_link_leads_out_too(folder: Path) -> None:
    (folder / "inside.xml").symlink_to(folder.parent / "secret.xml")
    with pytest.raises(InputError, match="leads out of its folder"):
        build(folder, '<include file="inside.xml"/>')


def test_a_part_of_the_scene_is_looked_into(folder: Path) -> None:
    (folder / "more.xml").write_text('<mujoco><include file="../secret.xml"/></mujoco>')
    with pytest.raises(InputError, match="leads out of its folder"):
        build(folder, '<include file="more.xml"/>')


MISREAD = {  # what is added, and the file beside the scene that it names
    "line break": ('<include file="a\nb.xml"/>', "a\nb.xml", "a line break"),
    "tab": ('<include file="a\tb.xml"/>', "a\tb.xml", "a tab"),
    "number": ('<include file="a&#10;b.xml"/>', "a\nb.xml", "a numeric character reference"),
    "folder": ('<compiler meshdir="a\tb"/>', "a\tb", "a tab"),
    "namespace": ('<include xmlns="a" file="ab.xml"/>', "ab.xml", "namespace"),
    "capitals": ('<INCLUDE file="ab.xml"/>', "ab.xml", "asks for a plugin"),
    "scheme": ('<include file="a:/b.xml"/>', "ab.xml", "'a:/b.xml' of a file has a colon"),
}


@pytest.mark.parametrize("kind", MISREAD)
def test_what_mujoco_reads_otherwise_is_refused(kind: str, folder: Path) -> None:
    added, name, problem = MISREAD[kind]
    plugin = '<mujoco><extension><plugin plugin="mujoco.pid"/></extension></mujoco>'
    (folder / name).write_text(plugin)
    with pytest.raises(InputError, match=problem):
        build(folder, added)


@pytest.mark.parametrize("name", ["a b.xml", "a&amp;b.xml", "sub//ab.xml", ".\\sub\\ab.xml"])
def test_other_names_are_read(name: str, folder: Path) -> None:
    (folder / "sub").mkdir()
    for file in ("a b.xml", "a&b.xml", "sub/ab.xml"):
        (folder / file).write_text('<mujoco><statistic extent="2"/></mujoco>')
    build(folder, f'<include file="{name}"/>')
    assert len(scene_files(folder / "scene.xml")) == 3


REACHES_OUT = {  # by the ways in which MuJoCo puts names together
    "backslash": ('<include file="..\\secret.xml"/>', "<mujoco/>"),
    "through a link": ('<include file="down/../../secret.xml"/>', "<mujoco/>"),
    "between slashes": ('<include file="sub//../../../secret.xml"/>', "<mujoco/>"),
    "stripped": (
        '<compiler strippath="true"/><asset><mesh name="m" file="sub/to_secret.stl"/></asset>',
        "<mujoco/>",
    ),
    "from a part": (
        '<compiler meshdir="TOP"/><include file="more.xml"/>',
        '<mujoco><asset><mesh name="m" file="secret.png"/></asset></mujoco>',
    ),
    "by a part": (
        '<include file="more.xml"/><asset><mesh name="m" file="secret.png"/></asset>',
        '<mujoco><compiler assetdir="TOP"/></mujoco>',
    ),
}


@pytest.mark.parametrize("kind", REACHES_OUT)
def test_names_lead_where_mujoco_looks(kind: str, folder: Path) -> None:
    added, more = (text.replace("TOP", str(folder.parent)) for text in REACHES_OUT[kind])
    (folder / "sub" / "deep").mkdir(parents=True)
    (folder / "down").symlink_to(folder / "sub" / "deep")
    (folder / "to_secret.stl").symlink_to(folder.parent / "secret.png")
    (folder / "more.xml").write_text(more)
    with pytest.raises(InputError, match="leads out of its folder") as refused:
        build(folder, added)
    assert "secret" in refused.value.faults[0].got


def test_a_linked_scene_has_its_parts_where_it_is(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "linked.xml").symlink_to(folder / "scene.xml")
    build_model(ROBOT, ContactOptions(model_path=str(tmp_path / "linked.xml")))


def test_names_of_files_are_counted_before_they_are_looked_for(folder: Path) -> None:
    meshes = "".join(f'<mesh file="{i}.stl"/>' for i in range(300))
    folders = "".join(f'<compiler meshdir="{i}"/>' for i in range(300))
    with pytest.raises(InputError, match="90,300 places of files; allowed: 20,000"):
        build(folder, f"<asset>{meshes}</asset>{folders}")
    parts = "".join(f'<include file="{i}.xml"/>' for i in range(20_001))
    with pytest.raises(InputError, match="places of files"):
        build(folder, parts)


@pytest.mark.parametrize(
    ("part", "problem"),
    [
        ('<mujoco><extension><plugin plugin="a.b"/></extension></mujoco>', "asks for a plugin"),
        ('<!DOCTYPE m [<!ENTITY a "b">]><mujoco/>', "DOCTYPE"),
        ("<mujoco>", "cannot be read as a scene"),
        ("<mujoco/>" + " " * MOST_BYTES, "larger than"),
    ],
)
def test_what_is_no_data_is_refused(part: str, problem: str, folder: Path) -> None:
    (folder / "more.xml").write_text(part)
    with pytest.raises(InputError, match=problem) as refused:
        build(folder, '<include file="more.xml"/>')
    assert "more.xml" in refused.value.faults[0].got


@pytest.mark.parametrize(
    ("part", "problem"),
    [
        ('<asset><mesh name="m" file="pipe"/></asset>', "this is no regular file"),
        ('<actuator><motor joint="hitch"/></actuator>', "a scene with 3 actuators"),
        ('<asset><mesh name="m" file="bad.stl"/></asset>', "this robot in this scene"),
    ],
)
def test_what_would_never_end_or_drives_else_is_refused(
    part: str, problem: str, folder: Path
) -> None:
    os.mkfifo(folder / "pipe")
    (folder / "bad.stl").write_bytes(b"solid nothing")
    with pytest.raises(InputError, match=problem) as refused:
        build(folder, part)
    assert refused.value.faults[0].where == "plant.contact.model_path"


def test_a_scene_that_includes_itself_ends(folder: Path) -> None:
    assert len(scene_files(folder / "scene.xml")) == 2
    with pytest.raises(InputError, match="MuJoCo"):
        build(folder, '<include file="scene.xml"/>')
    assert len(scene_files(folder / "scene.xml")) == 2


def test_everything_is_told_at_once_and_before_anything_is_written(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = folder / "scene.xml"
    parts = '<include file="../secret.xml"/><asset><texture file="../secret.png"/></asset>'
    scene.write_text(scene.read_text().replace("</mujoco>", f"{parts}</mujoco>"))
    out, given = folder / "out", f"plant.contact.model_path={scene}"
    assert main(["run", "lab_circle", "--set", given, "--out", str(out)]) == 2
    told = capsys.readouterr().err
    assert "secret.xml" in told
    assert "secret.png" in told
    assert not out.exists()
