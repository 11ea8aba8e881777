"""COLLADA, glTF and USD: the solid where the file's nodes place it, in its unit, along its axes; and nothing else."""

from __future__ import annotations

import re
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scene_files import POINTS, TRIANGLES, collada, gltf, usd, usd_box

from softseam_protocol.scene.whole_file import Unreadable, whole_file
from softseam_services.body.embed import read_solid
from softseam_services.body.errors import MeshError
from softseam_services.body.surface_check import enclosed_volume

MM = '<unit name="millimeter" meter="0.001"/>'
NODE = '<node id="n" name="pad"><instance_geometry url="#g"/></node>'
TURNED = (
    '<node id="n"><translate>10 20 30</translate><rotate>0 0 1 90</rotate><node><scale>2 2 2</scale>'
    '<instance_geometry url="#g"/></node></node>'
)
MIRRORED = '<node id="n"><matrix>-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#g"/></node>'
QUARTER = [0.0, 0.0, 0.5**0.5, 0.5**0.5]

# format -> file, and the extents of the solid in metres along the scene's x, y and z
PLACED = {
    "COLLADA in mm": ("a.dae", collada(NODE, MM), (0.004, 0.003, 0.002)),
    "COLLADA without a unit": ("a.dae", collada(NODE), (4.0, 3.0, 2.0)),
    "COLLADA, y up": ("a.dae", collada(NODE, MM, "Y_UP"), (0.002, 0.004, 0.003)),
    "COLLADA, x up": ("a.dae", collada(NODE, MM, "X_UP"), (0.003, 0.002, 0.004)),
    "COLLADA, nodes in nodes": ("a.dae", collada(TURNED, MM), (0.006, 0.008, 0.004)),
    "COLLADA, a node of the library": ("a.dae", collada('<node id="m"><instance_node url="#twice"/></node>', MM),
                                       (0.004, 0.003, 0.002)),
    "COLLADA, mirrored": ("a.dae", collada(MIRRORED, MM), (0.004, 0.003, 0.002)),
    "glTF, y up": ("a.glb", gltf([{"mesh": 0}], True), (2.0, 4.0, 3.0)),
    "glTF as text": ("a.gltf", gltf([{"mesh": 0}], False), (2.0, 4.0, 3.0)),
    "glTF, scaled and turned": ("a.glb", gltf([{"mesh": 0, "scale": [0.01, 0.02, 0.03], "rotation": QUARTER}], True),
                                (0.06, 0.06, 0.04)),
    "glTF, a matrix": ("a.glb", gltf([{"mesh": 0, "matrix": [.1, 0, 0, 0, 0, 0, .1, 0, 0, .1, 0, 0, 5, 6, 7, 1]}],
                                     True),
                       (0.3, 0.4, 0.2)),
    "USD in cm": ("a.usda", usd(usd_box("pad"), 0.01), (0.04, 0.03, 0.02)),
    "USD, y up": ("a.usd", usd(usd_box("pad"), 0.01, "Y"), (0.02, 0.04, 0.03)),
    "USD, scaled in a frame": ("a.usda", usd('def Xform "arm" {\n double3 xformOp:scale = (2, 2, 3)\n uniform token[] '
                                             'xformOpOrder = ["xformOp:scale"]\n' + usd_box("pad") + "}", 0.01),
                               (0.08, 0.06, 0.06)),
}  # fmt: skip


@pytest.mark.kernels
@pytest.mark.parametrize(("name", "data", "size"), PLACED.values(), ids=PLACED.keys())
def test_the_solid_stands_as_the_file_tells(name: str, data: bytes, size: tuple[float, float, float]) -> None:
    vertices, triangles, notes = read_solid(name, data, None, None)
    np.testing.assert_allclose(np.ptp(vertices, axis=0), size, rtol=1e-6)  # float32 in pycollada and glTF
    assert enclosed_volume(vertices, triangles) == pytest.approx(np.prod(size), rel=1e-6)
    assert not [note for note in notes if "turned" in note], "mirrored frames turn polygons round"


def polygons(kind: str, one_list: bool = False, counts: str = "") -> bytes:
    """The box's triangles as such primitives, with normals that the file has not, and lines beside them."""
    each = [" ".join(f"{corner} 7" for corner in triangle) for triangle in TRIANGLES.tolist()]
    lists = "".join(f"<p>{text}</p>" for text in ([" ".join(each)] if one_list else each))
    inputs = '<input semantic="VERTEX" source="#v" offset="0"/>'
    normals = '<input semantic="NORMAL" source="#gone" offset="1"/>'
    lines = f'<linestrips count="1">{inputs}<p>0 1 2</p></linestrips><triangles count="0">{inputs}</triangles>'
    found = f'<{kind} count="12">{inputs}{normals}{counts}{lists}</{kind}>{lines}'
    return re.sub(rb"<triangles.*</triangles>", found.encode(), collada(NODE))


ODD = {
    "triangles": polygons("triangles", True),
    "polylist": polygons("polylist", True, f"<vcount>{'3 ' * 12}</vcount>"),
    "polygons": polygons("polygons"),
    "strips": polygons("tristrips"),
    "fans": polygons("trifans"),
    "no namespace": re.sub(rb" xmlns=\S+", b"", collada(NODE)),
    "version 1.5": collada(NODE).replace(b"2005/11/", b"2008/03/").replace(b"1.4.1", b"1.5.0"),
    "no scene chosen": re.sub(rb"<scene>.*</scene>", b"", collada(NODE)),
    "no scene at all": re.sub(rb"<library_v.*</scene>", b"", collada(NODE), flags=re.S),
    "names with blanks": collada(NODE.replace("#g", "#a%20box")).replace(b'id="g"', b'id="a box"'),
    "a document type": collada(NODE, head="<!DOCTYPE COLLADA>"),
    "blanks about the axis": collada(NODE, up=" Z_UP\n"),
    "four numbers a point": re.sub(rb"(<float_array[^>]*>)[^<]*", lambda found: found[1] + " ".join(
        f"{x} {y} {z} 1" for x, y, z in POINTS.tolist()).encode(), collada(NODE)).replace(b'"3"', b'"4"'),
    "a camera that looks": collada(NODE + '<node id="c"><lookat>0 0 9 0 0 0 0 1 0</lookat></node>'),
}  # fmt: skip


@pytest.mark.kernels
@pytest.mark.parametrize("data", ODD.values(), ids=ODD.keys())
def test_collada_of_other_kinds(data: bytes) -> None:
    vertices, triangles, _ = read_solid("a.dae", data, None, None)
    np.testing.assert_allclose(np.ptp(vertices, axis=0), (4.0, 3.0, 2.0))
    assert enclosed_volume(vertices, triangles) == pytest.approx(24.0)


@pytest.mark.kernels
def test_names_of_sources_are_those_of_one_geometry() -> None:
    """As FreeCAD writes them: each geometry has the sources `p` and `v`."""
    one = re.search(rb"<geometry.*</geometry>", collada(NODE), re.S)
    assert one is not None
    rod = one[0].replace(b'"g"', b'"h"').replace(b"4.0", b"8.0")
    data = collada('<node id="m"><instance_geometry url="#h"/></node>').replace(b"</library_g", rod + b"</library_g")
    for node, length in ((b"#h", 8.0), (b"#g", 4.0)):
        vertices = read_solid("a.dae", data.replace(b'y url="#h"', b'y url="' + node + b'"'), None, None)[0]
        np.testing.assert_allclose(np.ptp(vertices, axis=0), (length, 3.0, 2.0))


@pytest.mark.kernels
def test_what_a_stage_shows_at_first() -> None:
    """Points that move are where they are first; what is hidden is left out."""
    hidden = usd_box("old", "double3 xformOp:translate = (9, 0, 0)", 'token visibility = "invisible"')
    moves = re.sub(r"points = (.*)", r"points.timeSamples = {3: \1}", usd_box("pad"))
    vertices = read_solid("a.usda", usd(moves + hidden), None, None)[0]
    np.testing.assert_allclose(np.ptp(vertices, axis=0), (4.0, 3.0, 2.0))


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["COLLADA in mm", "glTF, y up", "USD in cm"])
def test_a_scene_may_tell_unit_and_axis_in_place_of_the_file(name: str) -> None:
    path, data, _ = PLACED[name]
    vertices = read_solid(path, data, 0.01, "z")[0]
    np.testing.assert_allclose(np.ptp(vertices, axis=0), [0.04, 0.03, 0.02], rtol=1e-6)


TWO = {
    "COLLADA": ("a.dae", collada(NODE + '<node id="m" name="rod"><translate>9 0 0</translate><scale>.5 .5 .5</scale>'
                                 '<instance_geometry url="#g"/></node>')),
    "glTF": ("a.glb", gltf([{"mesh": 0, "name": "pad"},
                            {"mesh": 0, "name": "rod", "translation": [9, 0, 0], "scale": [0.5, 0.5, 0.5]}], True)),
    "USD": ("a.usda", usd(usd_box("pad") + usd_box("rod", "matrix4d xformOp:transform = "
                                                   "((.5, 0, 0, 0), (0, .5, 0, 0), (0, 0, .5, 0), (9, 0, 0, 1))"))),
}  # fmt: skip


@pytest.mark.kernels
@pytest.mark.parametrize(("name", "data"), TWO.values(), ids=TWO.keys())
def test_one_of_several_is_taken_by_its_name(name: str, data: bytes) -> None:
    with pytest.raises(MeshError, match=r"2 separate bodies.*`part: 1` .*\(pad\).*\(rod\)"):
        read_solid(name, data, None, None)
    for part, volume in (("pad", 24.0), ("rod", 3.0), (2, 3.0)):
        found = enclosed_volume(*read_solid(name, data, None, None, part)[:2])
        assert found == pytest.approx(volume, rel=1e-6), part
    with pytest.raises(MeshError, match="has no part called 'hand'; it has pad, rod"):
        read_solid(name, data, None, None, "hand")


SEVEN = "".join(
    f'<node id="n{k + 1}">' + f'<instance_node url="#n{k}"/>' * 30 + "</node>" for k in range(7)
)  # each holds thirty of the one before

REFUSED = {
    "entities of XML": ("a.dae", collada('&b;', head='<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/hostname">]>'),
                        ["no whole COLLADA file", "undefined entity"]),
    "a unit of no length": ("a.dae", collada(NODE, '<unit meter="0"/>'), ["its unit is 0 m"]),
    "a hole in a polygon": ("a.dae", polygons("polygons", counts="<ph><p>0 7</p><h/></ph>"), ["a polygon has holes"]),
    "a coordinate that is none": ("a.dae", collada(NODE).replace(b"4.0", b"NaN"), ["not finite"]),
    "a mesh of another file": ("a.dae", collada('<node id="n"><instance_geometry url="other.dae#g"/></node>'),
                               ["no whole COLLADA file", "other.dae"]),
    "a skin": ("a.dae", collada('<node id="n"><instance_controller url="#c"/></node>'), ["has a skin"]),
    "nodes by the billion": ("a.dae", collada('<node id="n0"><instance_geometry url="#g"/></node>' + SEVEN),
                             ["more than 10,000 nodes"]),
    "half a file": ("a.dae", collada(NODE)[:900], ["no whole COLLADA file"]),
    "a scene of nothing": ("a.dae", collada(""), ["holds no triangles"]),
    "a buffer in another file": ("a.gltf", gltf([{"mesh": 0}], False, "box.bin"), ["'box.bin'", "export it as .glb"]),
    "a compressed mesh": ("a.glb", gltf([{"mesh": 0}], True, extensionsRequired=["KHR_draco_mesh_compression"]),
                          ["KHR_draco_mesh_compression", "without compression"]),
    "an accessor of nothing": ("a.glb", gltf([{"mesh": 0}], True, accessors=[
        {"componentType": 5126, "count": 10**12, "type": "VEC3"}]), ["no whole glTF file", "accessor 0"]),
    "nodes in a ring": ("a.glb", gltf([{"children": [0, 0]}], True), ["more than 10,000 nodes"]),
    "half a glb": ("a.glb", gltf([{"mesh": 0}], True)[:-100], ["no whole glTF file", "ends at byte"]),
    "instances by an extension": ("a.glb", gltf([{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {}}}], True),
                                  ["EXT_mesh_gpu_instancing"]),
    "a ball beside the mesh": ("a.usda", usd(usd_box("pad") + 'def Sphere "tip" {\n}\n'), ["'tip' is a Sphere"]),
    "no length in USD": ("a.usda", usd(usd_box("pad"), 0.0), ["its unit is 0 m"]),
    "another layer": ("a.usda", usd('def "pad" (references = @/etc/hostname@) {}'),
                      ["a.usda: refers to '/etc/hostname', which is another file"]),
    "a sublayer": ("a.usda", b"#usda 1.0\n(subLayers = [@./other.usda@])\n", ["./other.usda", "another file"]),
    "no text": ("a.usda", usd(usd_box("pad")).replace(b"faceVertexCounts", b"\x8fVertexCounts"), ["no whole USD file"]),
    "counts of more than there is": ("a.usda", usd(usd_box("pad").replace("Counts = [3", "Counts = [300")),
                                     ["'pad' has 36 corners in place of 333"]),
    "no stage": ("a.usda", b"#usda 1.0\ndef Mesh {\n", ["no whole USD file"]),
}  # fmt: skip


@pytest.mark.parametrize(("name", "data", "words"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_refused(name: str, data: bytes, words: list[str], capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(MeshError) as caught:
        read_solid(name, data, None, None)
    for word in (f"{name}: ", *words):
        assert word in str(caught.value), str(caught.value)
    assert "".join(capfd.readouterr()) == ""


def packed(folder: Path, layers: dict[str, str]) -> bytes:
    """A .usdz of layers, the first its own, stored as they are at multiples of 64 bytes, as usd-core writes it."""
    from pxr import UsdUtils

    for name, text in layers.items():
        (folder / name).write_text(text)
    assert UsdUtils.CreateNewUsdzPackage(str(folder / next(iter(layers))), str(folder / "a.usdz"))
    return (folder / "a.usdz").read_bytes()


@pytest.mark.kernels
def test_crates_and_packages_of_usd(tmp_path: Path) -> None:
    from pxr import Sdf

    (tmp_path / "a.usda").write_bytes(usd(usd_box("pad"), 0.01))
    assert Sdf.Layer.FindOrOpen(str(tmp_path / "a.usda")).Export(str(tmp_path / "a.usdc"))
    inner = '#usda 1.0\n(metersPerUnit = 0.01\n upAxis = "Z")\ndef "arm" (references = @pad.usda@</pad>) {}\n'
    package = packed(tmp_path, {"arm.usda": inner, "pad.usda": usd(usd_box("pad"), 0.01).decode()})
    for name, data in (("a.usdc", (tmp_path / "a.usdc").read_bytes()), ("b.usdz", package)):
        np.testing.assert_allclose(np.ptp(read_solid(name, data, None, None)[0], axis=0), [0.04, 0.03, 0.02], rtol=1e-6)


def test_a_package_of_usd_reaches_no_further(tmp_path: Path) -> None:
    """A layer of it that refers to a file outside is refused, though the first does not."""
    (tmp_path / "out.usda").write_bytes(usd(usd_box("pad"), 0.01))
    layers = {name: f"#usda 1.0\n{text}\n" for name, text in (("arm.usda", 'def "arm" (references = @pad.usda@) {}'),
                                                            ("pad.usda", 'def "pad" {}'))}  # fmt: skip
    data = packed(tmp_path, layers)
    there = layers["pad.usda"].encode()
    assert data.count(there) == 1
    reaching = tmp_path / "r.usdz"
    with zipfile.ZipFile(reaching, "w") as package:
        for name in zipfile.ZipFile(tmp_path / "a.usdz").namelist():
            text = zipfile.ZipFile(tmp_path / "a.usdz").read(name)
            package.writestr(
                name, f'#usda 1.0\ndef "pad" (references = @{tmp_path}/out.usda@) {{}}\n' if text == there else text
            )
    with pytest.raises(MeshError, match=r"refers to '.*out\.usda', which is another file"):
        read_solid("r.usdz", reaching.read_bytes(), None, None)


def test_usd_without_its_extra_is_named_with_the_line_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(MeshError, match=r"^a\.usda: USD is read by usd-core.*pip install 'softseam\[usd\]'"):
        read_solid("a.usda", usd(usd_box("pad")), None, None)


@pytest.mark.kernels
def test_a_gltf_takes_its_buffers_along(tmp_path: Path) -> None:
    (tmp_path / "a.gltf").write_bytes(gltf([{"mesh": 0}], False, "the%20box.bin"))
    (tmp_path / "the box.bin").write_bytes(gltf([{"mesh": 0}], True)[-504:])
    vertices = read_solid("a.gltf", whole_file(tmp_path / "a.gltf"), None, None)[0]
    np.testing.assert_allclose(np.ptp(vertices, axis=0), [2.0, 4.0, 3.0])
    for uri in ("../b.bin", "/etc/hostname", "http://example.org/b.bin"):
        (tmp_path / "a.gltf").write_bytes(gltf([{"mesh": 0}], False, uri))
        with pytest.raises(Unreadable, match="only files of its own folder"):
            whole_file(tmp_path / "a.gltf")
